#pragma once

#include <Eigen/Core>
#include <array>
#include <functional>
#include <optional>
#include <vector>

#include "vision/knowledge_base_impl.hpp"
#include "vision/selection.hpp"
#include "vision/shadows.hpp"
#include "vision/team.hpp"

/// From a pose that may be right to one that is refined and tested by its own render.
namespace binpick::vision {
struct FinishOptions {
  int threads = 2;
  bool edges = true;              ///< Depth edges pull, too.
  bool second_refinement = true;  ///< Once more, on single heights, from the refined pose's own render.
};

class Finisher {
 public:
  /// All of it is used until the finisher goes.
  Finisher(const Scene& scene, const KnowledgeBase::Impl& part, const Deadline& deadline, const FinishOptions& options);

  /// To be called once the scene is prepared, before all else.
  void begin(const SupplyBox& supply) { shadows_.emplace(scene_, supply); }
  /// Evidence of the poses as they are by a coarse render: cheaper than refinement by far.
  std::vector<float> looked_at(const std::vector<Pose>& poses) const;
  /// Refined against its own render, twice; then the rendered test.
  Candidate finished(Pose pose, Template& drawn) const;
  /// Parts look much alike from both sides, or end for end. The strongest candidates are tried in the turns about
  /// the part's principal axes that are no symmetry: either the turned one is better, or how much worse it is tells
  /// how sure the first one is. Adds what comes near.
  void add_turned(std::vector<Candidate>& candidates, std::size_t strongest, double same_mm) const;
  /// A part that is nearly round shows how it is turned by little: a wheel by its spokes, which may be hidden, while
  /// its rim's edges look as if they told. What the picture says of each turn is measured: a better one is taken, if it
  /// is possible, and Candidate::loose_turn_rad2 tells how many are nearly as good: all, where the deadline came first.
  void weigh_turns(std::vector<Candidate*> candidates, const std::function<bool(const Pose&)>& possible) const;

  /// Of (translation mm, rotation rad) about the centroid, supply axes.
  Matrix6 covariance_of(const Candidate& candidate) const;
  const Rasteriser& rasteriser() const { return rasteriser_; }
  const Eigen::Vector3f& centroid_mm() const { return centroid_; }  ///< Object frame.
  double radius_mm() const { return radius_mm_; }                   ///< Rms distance of the vertices from there.
  /// Edges pull from as far as the pose may be off: pixels, or a share of the part where pixels are small.
  float edge_gate_px(float pixels, double diameters) const;

 private:
  struct Principal {
    Eigen::Vector3d axis;  ///< Object frame, through the centroid.
    bool nearly_round = false;
  };
  std::array<Principal, 3> principal_axes() const;
  Eigen::Isometry3d turned(const Eigen::Vector3d& axis, double angle_rad) const;
  std::vector<Eigen::Matrix3f> principal_turns() const;
  /// Turns about an axis that are tried beside each other, from low to high; 0 is one of them.
  struct Fan {
    Eigen::Vector3d axis;  ///< Object frame, through the centroid.
    std::vector<double> angles_rad;
  };
  static void add_loose(Candidate& candidate, const Fan& fan, double variance_rad2);
  void weigh_turns(Candidate& candidate, const Fan& fan, const std::function<bool(const Pose&)>& possible,
                   Template& drawn) const;
  float looseness_of(const Candidate& candidate) const;
  std::vector<Template> canvases() const;

  const Scene& scene_;
  std::optional<Shadows> shadows_;
  const KnowledgeBase::Impl& part_;
  const Deadline& deadline_;
  FinishOptions options_;
  const Rasteriser& rasteriser_;
  Eigen::Vector3f centroid_;
  double radius_mm_ = 1;
};
}  // namespace binpick::vision
