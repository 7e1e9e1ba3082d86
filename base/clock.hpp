#pragma once

#include <chrono>
#include <optional>

namespace binpick {
using TimePoint = std::chrono::steady_clock::time_point;
using Duration = std::chrono::steady_clock::duration;

/// Only the event loop reads it, once per wake-up; everyone else is handed `now`.
class Clock {
 public:
  virtual ~Clock() = default;
  virtual TimePoint now() const = 0;
};

/// The machine's monotonic clock.
class SystemClock final : public Clock {
 public:
  TimePoint now() const override { return std::chrono::steady_clock::now(); }
};

/// The earlier of two deadlines, where either may be absent.
inline std::optional<TimePoint> earlier(std::optional<TimePoint> a, std::optional<TimePoint> b) {
  if (!a) return b;
  if (!b) return a;
  return *a < *b ? a : b;
}

inline double in_s(Duration d) { return std::chrono::duration<double>(d).count(); }
inline double in_ms(Duration d) { return std::chrono::duration<double, std::milli>(d).count(); }
inline Duration from_s(double s) { return std::chrono::duration_cast<Duration>(std::chrono::duration<double>(s)); }
}  // namespace binpick
