#include "drivers/scanner/scan_clock.hpp"

#include <algorithm>
#include <cmath>

namespace binpick::drivers::scanner {
namespace {
constexpr double kWindow_s = 1.5;
constexpr std::size_t kArrivalsMax = 1024;
/// Below this span the slope is the nominal one: a few late telegrams would turn the line.
constexpr double kSlopeSpan_s = 0.5;
constexpr double kSlopeMax = 2e-3;
/// Arrival and counter may disagree by this much before the counter is taken to have jumped.
constexpr double kJump_s = 0.5;
}  // namespace

ScanClock::ScanClock(Duration nominal_period) { restart(nominal_period); }

void ScanClock::restart(Duration nominal_period) {
  period_s_ = std::max(1e-4, in_s(nominal_period));
  scan_ = -1;
  arrivals_.clear();
}

/// Height of the line of the last scans at the newest one.
double ScanClock::lateness() const {
  const double newest_s = arrivals_.back().at_s;
  const bool is_short = newest_s - arrivals_.front().at_s < kSlopeSpan_s;
  return (is_short ? line_under_with(arrivals_, 0) : line_under(arrivals_, kSlopeMax)).at(newest_s);
}

ScanClock::Reading ScanClock::on_scan(std::uint16_t counter, TimePoint received_at) {
  Reading reading;
  std::int64_t step = static_cast<std::uint16_t>(counter - counter_);
  if (step == 0) step = 1;  // a device whose counter stands still: every telegram is the next scan
  if (scan_ >= 0) {
    const double passed_s = in_s(received_at - last_received_at_);
    if (std::abs(passed_s - static_cast<double>(step) * period_s_) > kJump_s) {
      reading.counter_jumped = true;
      reading.lost = static_cast<std::uint64_t>(std::max(0.0, std::round(passed_s / period_s_) - 1));
      scan_ = -1;
    } else {
      reading.lost = static_cast<std::uint64_t>(step - 1);
    }
  }
  counter_ = counter;
  last_received_at_ = received_at;
  if (scan_ < 0) {
    arrivals_.clear();
    origin_ = received_at;
    scan_ = 0;
  } else {
    scan_ += step;
  }
  const double nominal_s = static_cast<double>(scan_) * period_s_;
  arrivals_.push_back({nominal_s, in_s(received_at - origin_) - nominal_s});
  while (arrivals_.size() > kArrivalsMax || nominal_s - arrivals_.front().at_s > kWindow_s) arrivals_.pop_front();
  reading.measured_at = std::min(received_at, origin_ + from_s(nominal_s + lateness()));
  return reading;
}
}  // namespace binpick::drivers::scanner
