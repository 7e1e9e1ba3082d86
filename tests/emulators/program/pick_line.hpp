#pragma once

#include <optional>
#include <string>

#include "drivers/robot/session.hpp"
#include "tests/emulators/plc/plc.hpp"
#include "tests/emulators/program/bin.hpp"

/// What one pick looked like from outside, as text and as a verdict.
namespace binpick::emulators {
struct PickSeen {
  std::optional<PlcResult> result;           ///< Absent when the PLC is not played here.
  std::optional<drivers::robot::Pick> read;  ///< Absent when the robot is not.
  std::optional<Bin::Nearest> nearest;       ///< Truth; absent when no object was left.
  std::optional<GripResult> grip;            ///< What the gripper did; absent when it never closed.
  std::string how;                           ///< The robot's report: "done", "FAILED"; empty without a robot.
};
struct PickVerdict {
  bool right = false;  ///< The pose within tolerance, PLC and robot told the same, and the report fits what happened.
  bool taken = false;  ///< By the gripper; a grip may fail at a right pose.
  std::string line;
};
/// "sequence 3, sweep 1.02 s, 367 profiles, 58310 points, 512 hypotheses, detection 143 ms, error 1.3 mm 0.8 deg, robot
/// read pick 3 at (1.2034 -0.1021 0.1534) m, taken, done".
PickVerdict judge(const PickSeen& pick, double tolerance_mm, double tolerance_deg);
std::string no_pick_line(const PlcResult& result);
}  // namespace binpick::emulators
