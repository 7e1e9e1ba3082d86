#include "tests/emulators/pivot/axis.hpp"

#include <cmath>

namespace binpick::emulators {
namespace {
constexpr double kStandstill_rad = 1e-9;
constexpr Duration kMemory = std::chrono::seconds(10);
}  // namespace

Axis::Axis(double position) {
  legs_.push_back(Leg{TimePoint::min(), TimePoint::min(), position, position, std::nullopt});
}

const Axis::Leg& Axis::leg_at(TimePoint at) const {
  for (auto leg = legs_.rbegin(); leg != legs_.rend(); ++leg)
    if (leg->start <= at) return *leg;
  return legs_.front();
}

double Axis::position(TimePoint at) const {
  const Leg& leg = leg_at(at);
  if (leg.end <= at) return leg.to;
  if (leg.start >= at) return leg.from;
  if (leg.ramp) return leg.ramp->position(in_s(at - leg.start));
  return leg.from + (leg.to - leg.from) * in_s(at - leg.start) / in_s(leg.end - leg.start);
}

double Axis::speed(TimePoint at) const {
  const Leg& leg = leg_at(at);
  if (leg.end <= at || leg.start > at) return 0;
  if (leg.ramp) return leg.ramp->speed(in_s(at - leg.start));
  return (leg.to - leg.from) / in_s(leg.end - leg.start);
}

bool Axis::moving(TimePoint at) const {
  const Leg& leg = leg_at(at);
  return at < leg.end && at >= leg.start && std::abs(leg.to - leg.from) > kStandstill_rad;
}

bool Axis::queued(TimePoint at) const { return legs_.back().start > at; }

bool Axis::in_line(TimePoint at) const {
  const Leg& leg = leg_at(at);
  return !leg.ramp && at < leg.end;
}

TimePoint Axis::leg_end(TimePoint at) const { return leg_at(at).end; }

void Axis::begin(Leg leg, TimePoint now) {
  while (legs_.size() > 1 && legs_.back().start >= leg.start) legs_.pop_back();
  legs_.push_back(leg);
  while (legs_.size() > 1 && legs_[1].start < now - kMemory) legs_.pop_front();
}

void Axis::ramp_to(double target, double speed_max, double acceleration, TimePoint now) {
  const double from = position(now);
  const auto ramp = drivers::pivot::Ramp::plan(from, speed(now), target, speed_max, acceleration);
  begin(Leg{now, now + from_s(ramp.duration_s()), from, target, ramp}, now);
}

void Axis::line_to(double target, Duration time, TimePoint now) {
  begin(Leg{now, now + time, position(now), target, std::nullopt}, now);
}

void Axis::brake(double deceleration, TimePoint now) {
  const double v = speed(now);
  if (v == 0) return line_to(position(now), Duration{0}, now);
  ramp_to(position(now) + v * std::abs(v) / (2 * deceleration), std::abs(v), deceleration, now);
}

void Axis::queue_line(double target, Duration time, TimePoint now) {
  if (!moving(now)) return line_to(target, time, now);
  const Leg present = leg_at(now);
  begin(Leg{present.end, present.end + time, present.to, target, std::nullopt}, now);
}
}  // namespace binpick::emulators
