#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "base/frames.hpp"

/// How far a gripper goes, and why it cannot go somewhere.
namespace binpick::vision {
/// What stands where nothing was measured.
enum class Unmeasured {
  Free,     ///< Nothing.
  Blocked,  ///< What surrounds that place goes on in it, and a shadow may hide as much as it can.
  Last,     ///< As blocked while anything can be taken so; then as free.
};

struct ReachLimits {
  double tilt_max_rad = 0.7;     ///< Between tcp z and straight down (-z of the supply).
  double wall_clearance_mm = 0;  ///< The tcp stays this far inside the supply's walls.
  /// Gripper and held part stay this far from walls, floor and all that was measured; absent: by the noise.
  std::optional<double> clearance_mm = std::nullopt;
  Unmeasured unmeasured = Unmeasured::Blocked;
  double radius_max_mm = 0;  ///< Of the tcp from the origin of the robot's base; 0: no limit.
  double axis_min_mm = 0;    ///< Of the tcp from the z axis of the robot's base.
  Transform<frame::Base, frame::Supply> T_base_supply = {};  ///< For these two, and for what is up.
};

/// Why a grasp is not offered. The order is that of the tests; the values are the PLC's (register unreachable_reason).
enum class Obstacle : std::uint8_t {
  None = 0,
  NoGrasp = 1,     ///< The part has none.
  Tilt = 2,        ///< Too steep.
  Reach = 3,       ///< Beyond what the robot reaches.
  Wall = 4,        ///< A wall of the supply.
  Itself = 5,      ///< The gripper hits the part itself: the part file is wrong.
  Covered = 6,     ///< Something lies on the object.
  Floor = 7,       ///< The supply's floor.
  Neighbour = 8,   ///< What was measured beside the object.
  Unmeasured = 9,  ///< A place where nothing was measured (reach.unmeasured = "blocked").
};
const char* to_string(Obstacle obstacle);
}  // namespace binpick::vision
