#pragma once

#include <cstdint>
#include <map>

#include "config/config.hpp"
#include "tests/emulators/robot/robot.hpp"

namespace binpick::emulators {
/// The paths that an emulated robot was taught over a supply.
inline constexpr std::uint16_t kLinearPath = 1;  ///< Straight above it.
inline constexpr std::uint16_t kPanPath = 2;     ///< Turning over it.
std::map<std::uint16_t, ScanPath> scan_paths(const config::Config& config, const config::Supply& supply);
}  // namespace binpick::emulators
