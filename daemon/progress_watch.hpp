#pragma once

#include <cstdint>

#include "base/clock.hpp"

namespace binpick::daemon {
/// Whether the vision worker gets on with its work. It is never waited for, so this is how a hang is noticed. A worker
/// without work counts up too, twice a second: one that hangs before it takes its next scan is noticed all the same.
class ProgressWatch {
 public:
  /// No picture of a detection takes this long.
  static constexpr Duration kSlack = std::chrono::seconds(17);

  /// `deadline` is what the configuration grants a detection: up to a minute.
  bool alive(std::uint64_t progress, Duration deadline, TimePoint now) {
    if (progress != progress_) {
      progress_ = progress;
      progress_at_ = now;
    }
    return now - progress_at_ < deadline + kSlack;
  }

 private:
  std::uint64_t progress_ = ~std::uint64_t{0};  // of nobody yet
  TimePoint progress_at_{};
};
}  // namespace binpick::daemon
