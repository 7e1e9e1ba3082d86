#pragma once

#include <cstdint>

#include "base/clock.hpp"
#include "drivers/pivot/ramp.hpp"

namespace binpick::drivers::pivot {
/// One FSTEP: be at `position_rad` when `time_ms` have passed.
struct Setpoint {
  double position_rad = 0;
  std::uint16_t time_ms = 0;
};

/// A ramp cut into set-points of a short horizon. Each one goes on at the ramp's present speed for one horizon and
/// never past its target, so a module that hears no further one stands still a horizon later, and a late or lost one
/// costs no more than a small correction of speed.
class SetpointStream {
 public:
  /// `horizon` must be at least `cycle` + 10 ms, as public drivers keep it (PowerCubeCtrl.cpp).
  SetpointStream(const Ramp& ramp, TimePoint start, Duration cycle, Duration horizon)
      : ramp_{ramp}, start_{start}, cycle_{cycle}, horizon_{horizon} {}

  Setpoint at(TimePoint now) const;
  double position(TimePoint now) const { return ramp_.position(in_s(now - start_)); }
  double speed(TimePoint now) const { return ramp_.speed(in_s(now - start_)); }
  double target() const { return ramp_.target(); }
  TimePoint end() const { return start_ + from_s(ramp_.duration_s()); }

 private:
  Ramp ramp_;
  TimePoint start_;
  Duration cycle_;
  Duration horizon_;
};
}  // namespace binpick::drivers::pivot
