#include "drivers/robot/remote_clock.hpp"

#include <algorithm>
#include <cmath>

namespace binpick::drivers::robot {
namespace {
constexpr double kWindow_s = 0.5;
constexpr double kSpan_s = 180;
/// Below this span the slope is not known: a few late messages would turn the line.
constexpr double kDriftSpan_s = 5;
/// Crystals are within 100 ppm, which is all that a short span may claim; over a long one the sender is believed more.
constexpr double kLongSpan_s = 30;
constexpr double kDriftMaxShort = 1e-4, kDriftMax = 1e-3;

constexpr double kStopped_s = 0.5;
/// No message comes before it was sent. What comes earlier than the line by more than this (a new least delay comes
/// earlier by a little) was stamped by another clock, or the first messages were very late ones.
constexpr double kEarly_s = 0.01;
/// A burst of delay ends; a clock that was set back stays late. What comes first after a pause may well be late.
constexpr double kLate_s = 0.02, kLateFor_s = 10, kPause_s = 1;
}  // namespace

void RemoteClock::restart() { *this = {}; }

void RemoteClock::begin(double sender_s, TimePoint arrival) {
  restart();
  begun_ = true;
  origin_s_ = last_s_ = sender_s;
  origin_ = last_arrival_ = moved_at_ = arrival;
  least_ = Arrival{};
}

RemoteClock::Reading RemoteClock::add(double sender_s, TimePoint arrival) {
  if (!std::isfinite(sender_s)) return begun_ ? Reading::Repeated : Reading::Jumped;
  if (!begun_) {
    begin(sender_s, arrival);
    return Reading::Good;
  }
  if (sender_s == last_s_) {
    last_arrival_ = arrival;
    if (stop_told_ || in_s(arrival - moved_at_) < kStopped_s) return Reading::Repeated;
    stop_told_ = true;
    return Reading::Stopped;
  }
  const Arrival a{sender_s - origin_s_, in_s(arrival - origin_) - (sender_s - origin_s_)};
  const double above_s = a.late_s - line_.at(a.at_s);
  const double silent_s = in_s(arrival - last_arrival_);
  if (above_s < kLate_s)
    late_since_.reset();
  else if (!late_since_ || silent_s > kPause_s)
    late_since_ = arrival;
  // After a silence of minutes nothing of what is known tells of now.
  const bool was_silent = silent_s > kSpan_s;
  const bool is_early = above_s < -kEarly_s;
  const bool is_late = late_since_ && in_s(arrival - *late_since_) > kLateFor_s;
  if (sender_s < last_s_ || was_silent || is_early || is_late) {
    const bool has_jumped = sender_s < last_s_ || (!was_silent && (is_late || settled()));
    begin(sender_s, arrival);
    return has_jumped ? Reading::Jumped : Reading::Good;
  }
  last_s_ = sender_s;
  last_arrival_ = moved_at_ = arrival;
  stop_told_ = false;
  if (!least_ || a.late_s < least_->late_s) least_ = a;
  if (a.at_s - window_begin_s_ >= kWindow_s) close_window(a.at_s);
  line_.late_s += std::min(0.0, a.late_s - line_.at(a.at_s));
  return Reading::Good;
}

void RemoteClock::close_window(double at_s) {
  least_late_.push_back(*least_);
  least_.reset();
  window_begin_s_ = at_s;
  const double span_max_s = drift_known_ ? kSpan_s : kDriftSpan_s + kWindow_s;
  while (at_s - least_late_.front().at_s > span_max_s && least_late_.size() > 1) least_late_.pop_front();
  const double span_s = least_late_.back().at_s - least_late_.front().at_s;
  if (span_s >= kDriftSpan_s) {
    line_ = line_under(least_late_, span_s < kLongSpan_s ? kDriftMaxShort : kDriftMax);
    drift_known_ = true;
  } else {
    line_ = line_under_with(least_late_, line_.slope);
  }
}

TimePoint RemoteClock::at(double sender_s) const {
  const double at_s = sender_s - origin_s_;
  return origin_ + from_s(at_s + line_.at(at_s));
}

double RemoteClock::drift_ppm() const { return -1e6 * line_.slope; }

std::optional<Duration> RemoteClock::uncertainty() const {
  if (least_late_.size() < 2) return std::nullopt;
  double above_s = 0;
  for (const Arrival& a : least_late_) above_s += a.late_s - line_.at(a.at_s);
  above_s /= static_cast<double>(least_late_.size());
  const double span_s = least_late_.back().at_s - least_late_.front().at_s;
  return from_s(above_s + (drift_known_ ? 0 : kDriftMaxShort * span_s));
}

bool RemoteClock::settled() const { return drift_known_; }
}  // namespace binpick::drivers::robot
