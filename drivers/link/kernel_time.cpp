#include "drivers/link/kernel_time.hpp"

#include <array>
#include <chrono>
#include <cstring>

namespace binpick::drivers::link {
TimePoint to_steady(const timespec& stamp, TimePoint now) {
  using namespace std::chrono;
  const auto wall = seconds(stamp.tv_sec) + nanoseconds(stamp.tv_nsec);
  const auto age = system_clock::now().time_since_epoch() - wall;
  if (age < -1ms || age > 1s) return now;
  return steady_clock::now() - duration_cast<Duration>(age < 0ns ? nanoseconds(0) : nanoseconds(age));
}

TimePoint received_at(msghdr& message, TimePoint now) {
  for (cmsghdr* header = CMSG_FIRSTHDR(&message); header != nullptr; header = CMSG_NXTHDR(&message, header)) {
    // SO_TIMESTAMPING carries three stamps (software, unused, hardware), SO_TIMESTAMPNS one: the first is the one
    // wanted. Hardware stamps are in the adapter's own clock and of no use without its offset.
    if (header->cmsg_level != SOL_SOCKET ||
        (header->cmsg_type != SO_TIMESTAMPING && header->cmsg_type != SO_TIMESTAMPNS))
      continue;
    timespec stamp{};
    std::memcpy(&stamp, CMSG_DATA(header), sizeof stamp);
    if (stamp.tv_sec != 0) return to_steady(stamp, now);
  }
  return now;
}
}  // namespace binpick::drivers::link
