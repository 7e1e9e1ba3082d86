#pragma once

#include <ctime>
#include <sys/socket.h>

#include "base/clock.hpp"

namespace binpick::drivers::link {
/// A kernel receive time stamp (wall clock) on the steady clock; `now` when the stamp makes no sense, as after the
/// wall clock was set.
TimePoint to_steady(const timespec& stamp, TimePoint now);

/// The software receive time of a message read with SO_TIMESTAMPING or SO_TIMESTAMPNS; `now` when it has none.
TimePoint received_at(msghdr& message, TimePoint now);
}  // namespace binpick::drivers::link
