#pragma once

#include <chrono>
#include <memory>
#include <optional>
#include <string>

#include "base/bytes.hpp"
#include "drivers/robot/pose_sample.hpp"

/// Poses of a Universal Robots controller over RTDE, as a session without I/O: the cell is the client of port 30004.
namespace binpick::drivers::rtde {
struct Options {
  /// Samples per second; absent: all that the controller has, 500 Hz from software 5 on, 125 Hz before (CB3).
  std::optional<double> frequency_hz{};
  /// RTDE gives the pose of the active tcp. Controllers from software 3.12 and 5.5.1 on tell where that tcp sits on the
  /// flange, and it is taken off again, also when a program changes it. For older ones it has to be given here, and no
  /// program may change it while the robot scans.
  std::optional<Transform<frame::Flange, frame::Tcp>> T_flange_tcp{};
  std::chrono::milliseconds reply_timeout{1000};  ///< For each step of the handshake.
  std::chrono::milliseconds silence_max{250};     ///< Without a pose while they should come; at least three periods.
};

/// One connection: version, controller version, outputs, start, data. After any loss all of it again: a controller that
/// is only connected anew sends nothing.
/// Owns no socket, reads no clock. Not thread-safe: used by the loop's thread only.
class Session {
 public:
  explicit Session(const Options& options);

  void on_connected(TimePoint now);
  void on_bytes(ByteView bytes, TimePoint now);
  void on_disconnected(TimePoint now);
  void on_deadline(TimePoint now);
  std::optional<TimePoint> deadline() const;
  Bytes take_output();
  std::optional<robot::PoseEvent> take_event();
  bool take_reopen();  ///< True once when the connection must be dropped and opened again.
  robot::PoseState state() const;

  std::optional<Duration> uncertainty() const;  ///< Of the samples' times; nullopt: not known yet.
  std::string controller() const;               ///< "controller software 5.11.0"; empty: not known yet.
  /// Why the arm cannot move, as the controller says ("protective stop"); empty: it can, or nothing is known. While it
  /// has no power there are no samples.
  std::string trouble() const;

 private:
  struct Impl;
  std::shared_ptr<Impl> impl_;
};
}  // namespace binpick::drivers::rtde
