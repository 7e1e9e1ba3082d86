#include "drivers/scanner/scan_clock.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

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

/// Height at `scan` of the line under all arrivals that is nearest to them on average: the edge of their lower convex
/// hull below their mean.
double ScanClock::line_at(std::int64_t scan) const {
  const double span_s = static_cast<double>(arrivals_.back().scan - arrivals_.front().scan) * period_s_;
  const auto lowest_with = [&](double slope) {
    double lowest = arrivals_.front().late_s - slope * static_cast<double>(arrivals_.front().scan - scan);
    for (const Arrival& a : arrivals_) lowest = std::min(lowest, a.late_s - slope * static_cast<double>(a.scan - scan));
    return lowest;
  };
  if (span_s < kSlopeSpan_s) return lowest_with(0);

  std::vector<Arrival> hull;
  double mean_scan = 0;
  for (const Arrival& a : arrivals_) {
    mean_scan += static_cast<double>(a.scan);
    const auto turns_down = [&] {
      const Arrival &p = hull[hull.size() - 2], &q = hull.back();
      return (q.late_s - p.late_s) * static_cast<double>(a.scan - p.scan) >=
             (a.late_s - p.late_s) * static_cast<double>(q.scan - p.scan);
    };
    while (hull.size() >= 2 && turns_down()) hull.pop_back();
    hull.push_back(a);
  }
  mean_scan /= static_cast<double>(arrivals_.size());
  std::size_t right = 1;
  while (right + 1 < hull.size() && static_cast<double>(hull[right].scan) < mean_scan) ++right;
  const Arrival &p = hull[right - 1], &q = hull[right];
  const double slope = (q.late_s - p.late_s) / static_cast<double>(q.scan - p.scan);
  return lowest_with(std::clamp(slope, -kSlopeMax * period_s_, kSlopeMax * period_s_));
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
  arrivals_.push_back({scan_, in_s(received_at - origin_) - nominal_s});
  while (arrivals_.size() > kArrivalsMax || static_cast<double>(scan_ - arrivals_.front().scan) * period_s_ > kWindow_s)
    arrivals_.pop_front();
  reading.measured_at = std::min(received_at, origin_ + from_s(nominal_s + line_at(scan_)));
  return reading;
}
}  // namespace binpick::drivers::scanner
