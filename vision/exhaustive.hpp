#pragma once

#include <Eigen/Core>
#include <vector>

#include "vision/knowledge_base_impl.hpp"
#include "vision/scene.hpp"
#include "vision/team.hpp"

/// Every view with each of its anchors at every maximum: what votes only guess is tried, sixteen samples at a time.
/// Nothing is lost but what has no maximum, and the time is known beforehand.
namespace binpick::vision {
struct ExhaustiveOptions {
  float tolerance_mm = 5;  ///< Of the samples; as wide as the grid of rotations is coarse.
  float z_floor_mm = 0;    ///< No part of the object lies lower.
  /// Bounds of the views kept for one maximum, each the best of its surroundings: the more maxima, the fewer.
  std::size_t per_maximum_min = 8, per_maximum_max = 24;
  double in_all = 4000;     ///< Shared evenly between these bounds.
  double apart_rad = 0.14;  ///< Views nearer to a better one of the same maximum are dropped.
  double effort = 1;        ///< Multiplies the bounds.
  bool all_anchors = true;  ///< Else each view's first only.
  int threads = 2;
};

/// A view at a maximum that the picture does not speak against.
struct Standing {
  std::uint32_t maximum = 0;
  std::uint16_t view = 0;
  std::uint16_t anchor = 0;  ///< Which of the view's anchors the maximum is.
  float evidence = 0;        ///< As sparse_evidence().
};

/// The search in one picture; what does not depend on the maxima is made once. Uses scene and part until it goes.
class ExhaustiveSearch {
 public:
  ExhaustiveSearch(const Scene& scene, const KnowledgeBase::Impl& part, const ExhaustiveOptions& options);
  /// In the order of the maxima, each maximum's best first. `tested` grows by the number of views that got past the
  /// first sixteen samples. The result does not depend on the number of threads.
  std::vector<Standing> at(const std::vector<Eigen::Vector3f>& maxima, const Deadline& deadline,
                           std::size_t& tested) const;

 private:
  /// Where a maximum lies in the picture, and what may stand there.
  struct Place {
    const float* at = nullptr;  ///< In the padded picture; nothing: outside.
    std::size_t rows = 0;       ///< Those that do not reach through the floor.
  };
  Place place_of(const Eigen::Vector3f& maximum) const;
  std::vector<Standing> standing_at(const Eigen::Vector3f& maximum, std::uint32_t index,
                                    const std::vector<std::uint32_t>& passed, std::size_t most) const;
  void thin_out(std::vector<Standing>& found, std::size_t most) const;

  const Scene& scene_;
  const KnowledgeBase::Impl& part_;
  ExhaustiveOptions options_;
  /// The picture with a frame as wide as the part, so that no sample needs to be asked whether it is inside.
  int margin_px_, padded_cols_;
  std::vector<float> padded_mm_;
  std::vector<std::int32_t> offsets_;  ///< Of the samples of all rows, from their anchor, in the padded picture.
};
}  // namespace binpick::vision
