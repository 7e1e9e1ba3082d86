#pragma once

#include <cstdint>
#include <deque>
#include <optional>
#include <string>
#include <vector>

#include "drivers/link/can.hpp"

namespace binpick::drivers::link {
/// SocketCAN's error classes, as a frame with `error` set carries them in its id (linux/can/error.h).
namespace can_error {
inline constexpr std::uint32_t kController = 0x004;  ///< payload[1]: 10, 20 passive; 40 active again.
inline constexpr std::uint32_t kBusOff = 0x040;
inline constexpr std::uint32_t kRestarted = 0x100;
}  // namespace can_error

/// Why socket(PF_CAN) gave `error`, as far as can be told from it, and what to do.
std::string no_can_socket_text(int error);

/// One SocketCAN interface: exact filters, error frames, the kernel's receive times. An interface that is down or gone
/// is on_down; it is looked for again after 200 ms, 400 ms … 1 s.
class CanSocket final : public CanLink {
 public:
  CanSocket(Loop& loop, std::string interface, std::vector<CanFilter> filters, CanPeer peer);
  ~CanSocket() override;
  CanSocket(const CanSocket&) = delete;
  CanSocket& operator=(const CanSocket&) = delete;

  void on_deadline(TimePoint now) override;
  std::optional<TimePoint> deadline() const override;
  void flush(TimePoint now) override;

  struct Counters {
    std::uint64_t sent = 0, received = 0;
    std::uint64_t queue_full = 0;         ///< Times the kernel took no frame (ENOBUFS, EAGAIN) and it was tried again.
    std::uint64_t unsent = 0;             ///< Frames given up after waiting too long.
    std::uint64_t dropped_by_kernel = 0;  ///< Received, but we were too slow (SO_RXQ_OVFL).
    std::uint64_t kernel_times = 0;       ///< Frames that carried a kernel time stamp.
  };
  const Counters& counters() const { return counters_; }

 private:
  struct Waiting {
    CanFrame frame;
    TimePoint since;
  };
  void open(TimePoint now);
  std::string try_open();
  void close(TimePoint now, const std::string& why);
  void close_fd();
  void receive(TimePoint now);
  void on_frame(const CanFrame& frame, TimePoint received, TimePoint now);

  Loop& loop_;
  std::string interface_;
  std::vector<CanFilter> filters_;
  CanPeer peer_;
  int fd_ = -1;
  bool bus_off_ = false;
  std::optional<TimePoint> open_at_ = TimePoint{};  // at once
  std::optional<TimePoint> send_at_;                ///< Next try after the kernel's queue was full.
  Duration retry_;
  std::string last_why_;
  std::deque<Waiting> unsent_;
  std::uint32_t overflow_ = 0;
  Counters counters_;
};
}  // namespace binpick::drivers::link
