#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "vision/candidates.hpp"

/// From thousands of hypotheses to the few that are worth a render.
namespace binpick::vision {
struct Hypothesis {
  std::uint32_t maximum = 0;  ///< Of the scene.
  std::uint16_t view = 0;
  Pose pose;
  float evidence = 0;
};
inline bool stronger(const Hypothesis& a, const Hypothesis& b) { return a.evidence > b.evidence; }

class Narrowing {
 public:
  /// All of it is used until the narrowing goes.
  Narrowing(const Scene& scene, const KnowledgeBase::Impl& part, const Finisher& finisher, const Deadline& deadline,
            int threads, bool edges)
      : scene_{scene}, part_{part}, finish_{finisher}, deadline_{deadline}, threads_{threads}, edges_{edges} {}

  /// Of those that start from nearly the same pose the strongest: refinement would make them one.
  std::vector<Hypothesis> thinned(std::vector<Hypothesis> hypotheses) const;
  /// Refinement on the view's own samples: two steps on few of them for all, then, for the `best`, some more on all;
  /// each time the sparse test again, more strictly.
  void nudge(std::vector<Hypothesis>& hypotheses, std::size_t best) const;
  /// The strongest that are not each other's copies, no more than `crowd` of one place.
  std::vector<Hypothesis> distinct(std::vector<Hypothesis> hypotheses, std::size_t most, std::size_t crowd) const;
  /// Drops what explains less of its silhouette than `share` (below zero: what is contradicted by more).
  void look_at(std::vector<Hypothesis>& hypotheses, float share) const;
  /// Poses with centres nearer than this are of one place.
  float place_mm() const;

 private:
  Eigen::Vector3f centre_of(const Pose& pose) const { return pose.R * finish_.centroid_mm() + pose.t; }

  const Scene& scene_;
  const KnowledgeBase::Impl& part_;
  const Finisher& finish_;
  const Deadline& deadline_;
  int threads_;
  bool edges_;
};
}  // namespace binpick::vision
