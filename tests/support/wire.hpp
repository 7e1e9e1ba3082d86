#pragma once

#include <functional>
#include <optional>

#include "base/bytes.hpp"
#include "base/clock.hpp"

namespace binpick::support {
/// A byte stream between the cell and an emulated device, as TCP would carry it: connects when both ends are there,
/// again half a second after a cut, and moves bytes both ways.
class Wire {
 public:
  struct End {
    std::function<bool()> there;  ///< False: this end is unplugged or not running; the wire is cut.
    std::function<void(TimePoint)> on_connected;
    std::function<void(ByteView, TimePoint)> on_bytes;
    std::function<void(TimePoint)> on_disconnected;
    std::function<Bytes()> take_output;
    std::function<bool()> wants_close;
  };
  Wire(End cell, End device) : cell_{std::move(cell)}, device_{std::move(device)} {}

  /// True when anything happened.
  bool pump(TimePoint now);
  std::optional<TimePoint> deadline() const { return connected_ ? std::nullopt : std::optional{retry_at_}; }

 private:
  void cut(TimePoint now);

  End cell_, device_;
  bool connected_ = false;
  TimePoint retry_at_{};
};
}  // namespace binpick::support
