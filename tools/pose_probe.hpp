#pragma once

#include "config/config.hpp"
#include "drivers/link/loop.hpp"
#include "tools/answer.hpp"

namespace binpick::tools {
/// Takes the poses of the robot that carries the scanner for a moment, as the daemon would: asks the controller for
/// them (robot.pose_address), or waits for its background program to send them (robot.pose_listen).
Answer ask_poses(drivers::link::Loop& loop, const config::Config& config);
}  // namespace binpick::tools
