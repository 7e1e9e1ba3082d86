#pragma once

#include <deque>
#include <optional>

#include "base/clock.hpp"
#include "base/units.hpp"

namespace binpick::drivers::sweep {
/// Where the pivot was, by time: samples in, interpolated angles out.
class AngleTrack {
 public:
  /// `at` must not go back; a sample that does is ignored.
  void add(TimePoint at, Angle angle);
  /// Linear between the two samples around `at`; nothing before the first or after the last sample, or across a gap
  /// longer than gap_max (the pivot may have done anything in it).
  std::optional<Angle> at(TimePoint at) const;
  std::optional<TimePoint> newest() const;
  std::optional<TimePoint> oldest() const;
  void clear() { samples_.clear(); }

  static constexpr Duration gap_max = std::chrono::milliseconds(250);

 private:
  struct Sample {
    TimePoint at;
    Angle angle;
  };
  static constexpr std::size_t kSamplesMax = 4096;  // 40 s at 10 ms: longer than any sweep
  std::deque<Sample> samples_;
};
}  // namespace binpick::drivers::sweep
