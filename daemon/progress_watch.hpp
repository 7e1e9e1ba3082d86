#pragma once

#include <cstdint>

#include "base/clock.hpp"

namespace binpick::daemon {
/// Whether the vision worker gets on with its work. It is never waited for, so this is how a hang is noticed.
class ProgressWatch {
 public:
  /// No picture of a detection takes this long.
  static constexpr Duration kSlack = std::chrono::seconds(17);

  /// `deadline` is what the configuration grants a detection: up to a minute.
  bool alive(std::uint64_t progress, bool busy, Duration deadline, TimePoint now) {
    if (progress != progress_ || !busy) {
      progress_ = progress;
      progress_at_ = now;
    }
    return now - progress_at_ < deadline + kSlack;
  }

 private:
  std::uint64_t progress_ = 0;
  TimePoint progress_at_{};
};
}  // namespace binpick::daemon
