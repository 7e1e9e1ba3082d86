#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "drivers/robot/rtde/codec.hpp"
#include "tests/emulators/robot/pose_clock.hpp"

namespace binpick::emulators {
/// A Universal Robots controller seen from its RTDE port (TCP server side, one client): answers the handshake, then
/// sends samples on its own beat until it is asked to pause or the connection ends. After a new connection it sends
/// nothing until the whole handshake has come again.
///
/// Faults: silent, delay, garbage (one byte of each package), split_every_byte, disconnect_after_bytes, unplugged.
class RtdeDevice {
 public:
  struct Options {
    drivers::rtde::ControllerVersion version{5, 11, 0, 0};
    PoseClock clock{.drift_ppm = 0, .first_s = 1234.5, .started = {}};
    Duration delay_min = std::chrono::microseconds(200), delay_max = std::chrono::milliseconds(5);
    Transform<frame::Flange, frame::Tcp> T_flange_tcp;  ///< The active tcp.
    bool greets = false;                                ///< A text message on each connection, as PolyScope X sends.
    std::uint64_t seed = 1;
  };
  RtdeDevice(FlangeMotion motion, const Options& options);

  void on_connected(TimePoint now);
  void on_bytes(ByteView bytes, TimePoint now);
  void on_disconnected(TimePoint now);
  void on_deadline(TimePoint now);
  std::optional<TimePoint> deadline() const;
  /// What is due. With split_every_byte one byte per call, and deadline() stays in the past until all is out.
  Bytes take_output();
  bool wants_close() const { return wants_close_ || faults.unplugged; }
  bool wants_link() const { return !faults.unplugged; }

  /// Power off and on: the time stamps begin anew, the connection ends.
  void restart(TimePoint now);
  void cut() { wants_close_ = true; }
  const std::optional<drivers::rtde::SetupOutputs>& asked() const { return asked_; }

  Faults faults;
  bool accepts_version = true, accepts_start = true;
  std::map<std::string, std::string> types;  ///< Of outputs that are not as usual: NOT_FOUND, IN_USE, another type.
  bool time_stands_still = false;
  std::int32_t robot_mode = 7, safety_mode = 1;
  std::uint32_t runtime_state = 2;
  Transform<frame::Flange, frame::Tcp> T_flange_tcp;  ///< A program may change it at any time.

 private:
  void answer(const drivers::rtde::Reply& reply, TimePoint now);
  void on_request(const drivers::rtde::Request& request, TimePoint now);
  void send_sample(TimePoint now);

  FlangeMotion motion_;
  Options options_;
  PoseClock clock_;
  DelayLine line_;
  TimePoint now_{};
  bool wants_close_ = false;
  Bytes received_;
  std::size_t bytes_sent_ = 0;
  std::optional<drivers::rtde::SetupOutputs> asked_;
  std::vector<drivers::rtde::Field> recipe_;
  std::optional<TimePoint> next_beat_;  // sending
  double stamp_ = 0;
};
}  // namespace binpick::emulators
