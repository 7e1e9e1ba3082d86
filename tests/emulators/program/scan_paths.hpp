#pragma once

#include <cstdint>
#include <map>

#include "config/config.hpp"
#include "tests/emulators/robot/robot.hpp"

namespace binpick::support {
/// The paths that the robot of an emulated cell was taught, over its first supply.
inline constexpr std::uint16_t kLinearPath = 1;  ///< Straight above it.
inline constexpr std::uint16_t kPanPath = 2;     ///< Turning over it.
std::map<std::uint16_t, emulators::ScanPath> scan_paths(const config::Config& config);
}  // namespace binpick::support
