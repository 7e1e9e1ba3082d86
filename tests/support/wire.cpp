#include "tests/support/wire.hpp"

namespace binpick::support {
bool Wire::pump(TimePoint now) {
  const bool both = cell_.there() && device_.there();
  if (!connected_) {
    if (now < retry_at_) return false;
    if (!both) {
      retry_at_ = now + std::chrono::milliseconds(500);
      return false;
    }
    connected_ = true;
    device_.on_connected(now);
    cell_.on_connected(now);
    return true;
  }
  if (!both || cell_.wants_close() || device_.wants_close()) {
    cut(now);
    return true;
  }
  bool moved = false;
  if (const Bytes to_device = cell_.take_output(); !to_device.empty()) {
    device_.on_bytes(to_device, now);
    moved = true;
  }
  if (const Bytes to_cell = device_.take_output(); !to_cell.empty()) {
    cell_.on_bytes(to_cell, now);
    moved = true;
  }
  return moved;
}

void Wire::cut(TimePoint now) {
  connected_ = false;
  retry_at_ = now + std::chrono::milliseconds(500);
  device_.on_disconnected(now);
  if (cell_.there()) cell_.on_disconnected(now);
}
}  // namespace binpick::support
