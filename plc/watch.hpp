#pragma once

#include <chrono>
#include <optional>
#include <utility>

#include "base/clock.hpp"

namespace binpick::plc {
/// The watch on the PLC: its heartbeat, or without one, its connection.
class Watch {
 public:
  /// 0: the heartbeat is not watched.
  explicit Watch(std::chrono::milliseconds heartbeat_timeout) : timeout_{heartbeat_timeout} {}
  void set_timeout(std::chrono::milliseconds heartbeat_timeout) { timeout_ = heartbeat_timeout; }
  bool heartbeat_watched() const { return timeout_.count() > 0; }

  void begin(TimePoint now) { last_beat_ = unconnected_since_ = now, begun_ = true; }
  void set_connected(bool connected, TimePoint now) {
    if (connected_ && !connected) unconnected_since_ = now;
    connected_ = connected;
  }
  bool connected() const { return connected_; }
  /// True when the PLC had been lost and is back.
  bool on_beat(TimePoint now) {
    last_beat_ = now;
    return std::exchange(lost_, false);
  }
  /// When the PLC is lost unless something comes; nullopt: never, or lost already.
  std::optional<TimePoint> expiry() const {
    if (lost_ || !begun_) return std::nullopt;
    if (heartbeat_watched()) return last_beat_ + timeout_;
    if (!connected_) return unconnected_since_ + kUnconnectedMax;
    return std::nullopt;
  }
  void lose() { lost_ = true; }

 private:
  /// Without a heartbeat watch, this long without any connection means that the PLC is gone.
  static constexpr Duration kUnconnectedMax = std::chrono::seconds(3);
  std::chrono::milliseconds timeout_;
  bool begun_ = false, connected_ = false, lost_ = false;
  TimePoint last_beat_{}, unconnected_since_{};
};
}  // namespace binpick::plc
