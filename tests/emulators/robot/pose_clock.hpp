#pragma once

#include <algorithm>
#include <deque>
#include <functional>
#include <optional>
#include <random>

#include "base/bytes.hpp"
#include "base/clock.hpp"
#include "base/frames.hpp"
#include "tests/emulators/faults.hpp"

/// What emulated senders of poses have in common: a motion, a clock of their own, and a network that delays.
namespace binpick::emulators {
/// Where the flange is at a time.
using FlangeMotion = std::function<Transform<frame::Base, frame::Flange>(TimePoint)>;

/// The sender's clock: seconds since it was started, faster than ours by drift_ppm.
struct PoseClock {
  double drift_ppm = 0;
  double first_s = 0;  ///< What it shows when it starts.
  TimePoint started{};
  double at(TimePoint now) const { return first_s + in_s(now - started) * (1 + 1e-6 * drift_ppm); }
};

/// Bytes on their way: each telegram by a delay of its own, none overtakes.
class DelayLine {
 public:
  DelayLine(Duration least, Duration most, std::uint64_t seed) : least_{least}, most_{most}, random_{seed} {}

  void send(Bytes telegram, TimePoint now, const Faults& faults) {
    if (faults.silent) return;
    if (faults.garbage) telegram.at(random_() % telegram.size()) ^= static_cast<std::byte>(1 + random_() % 255);
    const double part = std::uniform_real_distribution<double>{0, 1}(random_);
    last_at_ = std::max(last_at_, now + faults.delay + least_ + from_s(part * in_s(most_ - least_)));
    due_.push_back({last_at_, std::move(telegram)});
  }
  std::optional<TimePoint> deadline() const { return due_.empty() ? std::nullopt : std::optional{due_.front().at}; }
  /// What has arrived by now: with split_every_byte one byte.
  Bytes take(TimePoint now, const Faults& faults) {
    Bytes out;
    while (!due_.empty() && due_.front().at <= now) {
      Bytes& telegram = due_.front().telegram;
      if (faults.split_every_byte) {
        out.push_back(telegram.front());
        telegram.erase(telegram.begin());
        if (telegram.empty()) due_.pop_front();
        return out;
      }
      append(out, telegram);
      due_.pop_front();
    }
    return out;
  }
  void clear() { due_.clear(); }

 private:
  struct Due {
    TimePoint at;
    Bytes telegram;
  };
  Duration least_, most_;
  std::mt19937_64 random_;
  TimePoint last_at_{};
  std::deque<Due> due_;
};
}  // namespace binpick::emulators
