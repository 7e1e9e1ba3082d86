#pragma once

#include <optional>
#include <string>
#include <vector>

#include "base/frames.hpp"
#include "vision/detector.hpp"

namespace binpick::vision {
/// How a gripper takes a part. The tcp's z axis is the direction of approach.
struct Grasp {
  std::string name;
  Transform<frame::Object, frame::Tcp> T_object_tcp;
  double approach_mm = 100;  ///< The approach pose stands this far back along tcp z.
  /// Between the jaws on the way in; the gripper's widest where it is not said.
  std::optional<double> opening_mm;
  /// Between the jaws when they hold the part. Wider than on the way in: they hold it from within, in a bore.
  std::optional<double> holding_mm;
  /// Straight up from the approach pose, the way in and out is free so far. 0: out of the supply.
  double retreat_mm = 0;
  double preference = 0;  ///< Of an object's grasps that are free, one with the highest value is taken.
};

/// What stands where nothing was measured.
enum class Unmeasured {
  Free,     ///< Nothing.
  Blocked,  ///< Something as high as the highest that was measured at the border of that hole.
};

struct ReachLimits {
  double tilt_max_rad = 0.7;     ///< Between tcp z and straight down (-z of the supply).
  double wall_clearance_mm = 0;  ///< The tcp stays this far inside the supply's walls.
  /// Gripper and held part stay this far from walls, floor and all that was measured; twice the noise if absent.
  std::optional<double> clearance_mm = std::nullopt;
  Unmeasured unmeasured = Unmeasured::Blocked;
  double radius_max_mm = 0;  ///< Of the tcp from the origin of the robot's base; 0: no limit.
  double axis_min_mm = 0;    ///< Of the tcp from the z axis of the robot's base.
};

/// Probability that a detection is right and lies so near to the truth that a grasp holds: its score, times what its
/// covariance leaves within 3 mm and 3 degrees in the worst direction. A turn that the symmetry makes nothing of does
/// not count. A wheel whose spokes are hidden is surely a wheel, and yet not the one to pick first.
double probability_of_holding(const Detection& detection, const Symmetry& symmetry);

struct Reachable {
  std::size_t detection = 0;  ///< Index in the report.
  std::size_t grasp = 0;
  Transform<frame::Supply, frame::Tcp> T_supply_grasp;
  Transform<frame::Supply, frame::Tcp> T_supply_approach;
};
struct Unreachable {
  std::size_t detection = 0;
  std::string reason;  ///< "tilt 51 deg is over 40 deg", "tcp 12 mm outside the wall x max".
};
struct GraspChoice {
  /// At most one per detection, its steepest; best first: the surest to hold (in steps of 0.02), then the highest.
  std::vector<Reachable> reachable;
  std::vector<Unreachable>
      unreachable;  ///< Detections without any reachable grasp, with the reason of the least bad one.
};

/// Grasps are tried in every pose that the part's symmetry allows (a revolution in steps of 15 degrees).
GraspChoice choose_grasps(const DetectionReport& report, const Symmetry& symmetry, const std::vector<Grasp>& grasps,
                          const SupplyBox& supply, const ReachLimits& limits);
}  // namespace binpick::vision
