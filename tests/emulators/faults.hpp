#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <optional>

#include "base/clock.hpp"

/// What an emulated device does wrong, on purpose. One value, changed at any time; default: a healthy device.
namespace binpick::emulators {
struct Faults {
  bool unplugged = false;  ///< No link at all: connections are refused or cut, frames vanish.
  bool silent = false;     ///< The link stands, nothing is answered or sent.
  Duration delay{0};       ///< Added to every answer.
  bool garbage = false;    ///< Bytes (or frame contents) are corrupted.
  std::optional<std::size_t>
      disconnect_after_bytes;     ///< Sent by the device, counted from when this was set; then the link is cut once.
  bool split_every_byte = false;  ///< One byte per segment (streams).
  bool wrong_id = false;          ///< Answers under another id (CAN id, transaction id, pick id).
  std::optional<std::uint32_t> error_code;  ///< The device answers with this error of its own.
  bool emergency_stop = false;              ///< Motor supply gone, logic alive (pivot, robot).
  bool bus_off = false;                     ///< CAN only.
};
}  // namespace binpick::emulators
