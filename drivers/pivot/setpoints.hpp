#pragma once

#include <cstdint>

#include "base/clock.hpp"
#include "drivers/pivot/ramp.hpp"

namespace binpick::drivers::pivot {
/// Be at `position_rad` when `time_ms` have passed. 0: as soon as the module's own ramp allows.
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

  /// The move begins only now.
  void begin(TimePoint now) { start_ = now; }
  /// For a module that goes straight to where it is told (FSTEP).
  Setpoint at(TimePoint now) const;
  /// For a module that makes its own ramps (MOVE POS): as far ahead that it need not begin to brake before the next
  /// one, and no further. Without another one it stands a horizon later, or as soon as its acceleration lets it where
  /// the horizon is shorter than that (speed / acceleration).
  Setpoint ahead(TimePoint now) const;
  double position(TimePoint now) const { return ramp_.position(in_s(now - start_)); }
  double speed(TimePoint now) const { return ramp_.speed(in_s(now - start_)); }
  double target() const { return ramp_.target(); }
  double acceleration() const { return ramp_.acceleration(); }
  TimePoint end() const { return start_ + from_s(ramp_.duration_s()); }

 private:
  Ramp ramp_;
  TimePoint start_;
  Duration cycle_;
  Duration horizon_;
};
}  // namespace binpick::drivers::pivot
