#pragma once

#include <span>
#include <string>

#include "vision/calibration/adjustment.hpp"

namespace binpick::vision::calibration {
/// What kind of pose is missing among the scans, as a sentence of what to add: the sphere at other sides, distances or
/// angles, or the flange turned. Empty: every kind is there.
std::string missing_poses(std::span<const SphereSight> sights, const Adjusted& adjusted);
}  // namespace binpick::vision::calibration
