#pragma once

#include <cstdint>
#include <string>

namespace binpick::daemon {
/// Counts the daemon's starts in `state_dir`/boot_count, so that the PLC sees a restart. 1 … 65535, then 1 again. It
/// is on the disk when this returns: after a power cut too, the next count is another one. A folder that cannot be
/// written costs nothing but a warning: the count then comes from the wall clock.
std::uint16_t next_boot_count(const std::string& state_dir);
}  // namespace binpick::daemon
