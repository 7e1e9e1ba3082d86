#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "vision/detector.hpp"
#include "vision/rasteriser.hpp"

/// Parts that hang in each other, rings through rings, cannot be lifted straight up and yet be drawn out aslant.
namespace binpick::vision {
struct WayOut {
  Eigen::Vector3d way_mm;  ///< In a straight line, the part turned as it is; from its end on straight up.
  double covered_mm = 0;   ///< So far others still reach over it on that way (overlaps.hpp).
};

/// For each detection that is `wanted` the ways on which it passes all the others, by their poses; first those where
/// others reach least over it, on that way and on those beside it, as poses have errors; of these the steepest.
/// `pixel_mm`: of what is drawn; `diameter_mm`: of the part; `covered_max_mm`: as far others may reach over it.
std::vector<std::vector<WayOut>> ways_out(const Rasteriser& part, double diameter_mm,
                                          std::span<const Detection> detections, const std::vector<bool>& wanted,
                                          double pixel_mm, double covered_max_mm);
}  // namespace binpick::vision
