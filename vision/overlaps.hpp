#pragma once

#include <functional>
#include <span>
#include <vector>

#include "vision/detector.hpp"
#include "vision/rasteriser.hpp"

/// What lies on an object that was found, or leans over its edge, is lifted with it.
namespace binpick::vision {
/// Of each detection: how far others reach over it, in mm: the side of the largest square, seen from above, in which
/// one of them stands higher than it. Poses alone count, not what was measured. A gap of less than `pixel_mm` is none.
/// `up`, of length 1: seen from there, higher is farther along it; what an object would meet on the way out. `wanted`:
/// only of these, 0 for the rest; none: of all.
std::vector<double> overlaps_mm(const Rasteriser& part, std::span<const Detection> detections, double pixel_mm,
                                const Eigen::Vector3d& up = Eigen::Vector3d::UnitZ(),
                                const std::vector<bool>& wanted = {});

/// The same of one detection if it stood elsewhere and the others where they are; seen from above. The others are drawn
/// once, whatever is asked.
using OverlapElsewhere = std::function<double(std::size_t detection, const Eigen::Isometry3d& T_supply_elsewhere)>;
OverlapElsewhere overlap_elsewhere(const Rasteriser& part, std::span<const Detection> detections, double pixel_mm);
}  // namespace binpick::vision
