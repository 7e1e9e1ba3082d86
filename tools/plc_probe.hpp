#pragma once

#include "config/config.hpp"
#include "drivers/link/loop.hpp"
#include "tools/answer.hpp"

namespace binpick::tools {
/// Reads the map in the Modbus server of a PLC that the daemon would ask (plc.role = "client"); nothing is written.
Answer ask_plc(drivers::link::Loop& loop, const config::Config& config);
}  // namespace binpick::tools
