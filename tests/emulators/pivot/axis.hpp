#pragma once

#include <deque>
#include <optional>

#include "base/clock.hpp"
#include "drivers/pivot/ramp.hpp"

namespace binpick::emulators {
/// One turning axis as legs of motion over time: a ramp, or a straight line to a position. Radians. It remembers the
/// last ten seconds, so that it can be asked where it stood.
class Axis {
 public:
  explicit Axis(double position);

  double position(TimePoint at) const;
  double speed(TimePoint at) const;
  bool moving(TimePoint at) const;
  bool queued(TimePoint at) const;        ///< A leg waits for the present one to end.
  bool in_line(TimePoint at) const;       ///< On its way along a straight line.
  TimePoint leg_end(TimePoint at) const;  ///< End of the leg that runs at `at`, or in the past.

  /// Each of these forgets what was planned after `now`.
  void ramp_to(double target, double speed_max, double acceleration, TimePoint now);
  void line_to(double target, Duration time, TimePoint now);
  void brake(double deceleration, TimePoint now);
  /// A line that starts when the present leg ends; it replaces one that waits already.
  void queue_line(double target, Duration time, TimePoint now);

 private:
  struct Leg {
    TimePoint start, end;
    double from = 0, to = 0;
    std::optional<drivers::pivot::Ramp> ramp;  ///< Absent: a straight line.
  };
  const Leg& leg_at(TimePoint at) const;
  void begin(Leg leg, TimePoint now);

  std::deque<Leg> legs_;  ///< By start; the first holds for all time before.
};
}  // namespace binpick::emulators
