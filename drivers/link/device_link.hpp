#pragma once

#include <optional>
#include <string>

#include "base/clock.hpp"

namespace binpick::drivers::link {
/// last_error() after reopen(): nothing has failed.
inline constexpr const char* kClosedByUs = "closed by us";

/// Our end of the way to one device, TCP or UDP. Opens by itself, again and again; what comes goes to the session whose
/// face it was given.
class DeviceLink {
 public:
  virtual ~DeviceLink() = default;
  virtual void on_deadline(TimePoint now) = 0;
  virtual std::optional<TimePoint> deadline() const = 0;  ///< When to call on_deadline.
  virtual void flush(TimePoint now) = 0;                  ///< Sends what the session has to say.
  virtual void reopen(TimePoint now) = 0;                 ///< Closes; the session is told; opens again after a pause.
  virtual std::string last_error() const = 0;             ///< Why it is not open, for the log.
};
}  // namespace binpick::drivers::link
