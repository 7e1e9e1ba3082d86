#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "base/clock.hpp"
#include "base/expected.hpp"
#include "drivers/link/loop.hpp"

namespace binpick::drivers::link {
/// One classic CAN frame, or one of SocketCAN's error frames.
struct CanFrame {
  std::uint32_t id = 0;  ///< 11 or 29 bits, without flags; of an error frame: the error classes.
  bool extended = false;
  bool rtr = false;
  bool error = false;
  std::uint8_t length = 0;  ///< 0 … 8.
  std::array<std::uint8_t, 8> payload{};
  friend bool operator==(const CanFrame&, const CanFrame&) = default;
};

/// Frames that pass: (id & mask) == (filter.id & mask), standard data frames only. A link without filters passes all
/// frames; error frames always pass.
struct CanFilter {
  std::uint32_t id = 0;
  std::uint32_t mask = 0x7FF;
};

/// A session's face as a CAN link pumps it. `received_at` is the kernel's receive time where the link has one.
struct CanPeer {
  std::function<void(TimePoint)> on_up;
  std::function<void(const CanFrame&, TimePoint received_at)> on_frame;
  std::function<void(const std::string& why, TimePoint)> on_down;
  std::function<std::vector<CanFrame>()> take_frames;
};

/// A CAN bus, by whatever means. Reopens by itself (interface gone, bus-off over) with a capped back-off.
class CanLink {
 public:
  virtual ~CanLink() = default;
  virtual void on_deadline(TimePoint now) = 0;
  virtual std::optional<TimePoint> deadline() const = 0;
  virtual void flush(TimePoint now) = 0;
};

/// `address`: "can0" (SocketCAN interface) or "cannelloni://HOST:PORT" (CAN over UDP, data frames version 2). For
/// cannelloni, `listen_port` is the local UDP port, 0 for any.
/// Throws std::runtime_error for an address that can never work; a missing interface or peer is on_down and retried.
std::unique_ptr<CanLink> open_can(Loop& loop, const std::string& address, std::vector<CanFilter> filters, CanPeer peer,
                                  std::uint16_t listen_port = 0);
}  // namespace binpick::drivers::link
