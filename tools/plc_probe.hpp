#pragma once

#include <string>

#include "config/config.hpp"
#include "drivers/link/loop.hpp"

namespace binpick::tools {
struct PlcAnswer {
  bool good = false;
  std::string text;  ///< What it said, or what to do.
};
/// Reads the map in the Modbus server of a PLC that the daemon would ask (plc.role = "client"); nothing is written.
PlcAnswer ask_plc(drivers::link::Loop& loop, const config::Config& config);
}  // namespace binpick::tools
