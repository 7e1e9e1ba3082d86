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
  float tolerance_mm = 5;        ///< Of the samples; as wide as the grid of rotations is coarse.
  float z_floor_mm = 0;          ///< No part of the object lies lower.
  std::size_t per_maximum = 24;  ///< Bound of the views kept for one maximum, each the best of its surroundings.
  double apart_rad = 0.14;       ///< Views nearer to a better one of the same maximum are dropped.
  double effort = 1;             ///< Multiplies the bounds.
  bool all_anchors = true;       ///< Else each view's first only.
  int threads = 2;
};

/// A view at a maximum that the picture does not speak against.
struct Standing {
  std::uint32_t maximum = 0;
  std::uint16_t view = 0;
  std::uint16_t anchor = 0;  ///< Which of the view's anchors the maximum is.
  float evidence = 0;        ///< As sparse_evidence().
};

/// In the order of the maxima, each maximum's best first. `tested` becomes the number of views that got past the first
/// sixteen samples. The result does not depend on the number of threads.
std::vector<Standing> search_all(const Scene& scene, const KnowledgeBase::Impl& part,
                                 const std::vector<Eigen::Vector3f>& maxima, const ExhaustiveOptions& options,
                                 const Deadline& deadline, std::size_t& tested);
}  // namespace binpick::vision
