#include "drivers/pivot/setpoints.hpp"

#include <algorithm>
#include <cmath>

namespace binpick::drivers::pivot {
namespace {
constexpr double kStepMargin_s = 0.010;  // a step must outlast the wait for the next one by this much
constexpr double kCyclesAhead = 3;       // a lost set-point, and the next one late, must not make the module brake
}  // namespace

Setpoint SetpointStream::at(TimePoint now) const {
  const double t = in_s(now - start_);
  const double cycle_s = in_s(cycle_);
  const double horizon_s = in_s(horizon_);
  const double shortest_s = std::min(cycle_s + kStepMargin_s, horizon_s);
  const double here = ramp_.position(t);
  const double speed = (ramp_.position(t + cycle_s) - here) / cycle_s;
  const double left = ramp_.target() - here;
  double to = here + speed * horizon_s;
  double in_s = horizon_s;
  if (t >= ramp_.duration_s() || speed == 0) {
    to = t >= ramp_.duration_s() ? ramp_.target() : here;
    in_s = shortest_s;
  } else if (speed * left > 0 && std::abs(speed * horizon_s) > std::abs(left)) {
    to = ramp_.target();
    in_s = std::clamp(left / speed, shortest_s, horizon_s);
  }
  return {to, static_cast<std::uint16_t>(std::clamp(std::lround(in_s * 1e3), 1L, 65535L))};
}

Setpoint SetpointStream::ahead(TimePoint now) const {
  // Braking from `speed` takes speed / acceleration, half of which is lost against driving on to the same point.
  const double half_braking_s = ramp_.speed_max() / (2 * ramp_.acceleration());
  const double ahead_s = std::max(in_s(horizon_) - half_braking_s, half_braking_s + kCyclesAhead * in_s(cycle_));
  return {ramp_.position(in_s(now - start_) + ahead_s), 0};
}
}  // namespace binpick::drivers::pivot
