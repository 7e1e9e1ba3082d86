#pragma once

#include <span>
#include <vector>

#include "vision/detector.hpp"
#include "vision/rasteriser.hpp"

/// What lies on an object that was found, or leans over its edge, is lifted with it.
namespace binpick::vision {
/// Of each detection: how far others reach over it, in mm: the side of the largest square, seen from above, in which
/// one of them stands higher than it. Poses alone count, not what was measured. A gap of less than `pixel_mm` is none.
std::vector<double> overlaps_mm(const Rasteriser& part, std::span<const Detection> detections, double pixel_mm);
}  // namespace binpick::vision
