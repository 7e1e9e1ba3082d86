#pragma once

#include <Eigen/Core>
#include <vector>

#include "vision/scene.hpp"

namespace binpick::vision {
struct MaximaOptions {
  double diameter_mm = 100;  ///< Of the part.
  float z_min_mm = 0;        ///< No anchor below: nothing of the part can be so low.
  int threads = 2;           ///< The result does not depend on it.
};

/// Where a part's highest point may be, supply frame, the highest plateau first, of each its middle first: local maxima
/// of the depth image, each within its own piece of surface (what lies beyond a depth jump does not count: a part
/// beside a higher one has a maximum of its own). Of a plateau the centroid, or a grid of points where it is wide: with
/// measurement noise the highest point of a flat face lies anywhere on it.
std::vector<Eigen::Vector3f> find_maxima(const Scene& scene, const MaximaOptions& options);
}  // namespace binpick::vision
