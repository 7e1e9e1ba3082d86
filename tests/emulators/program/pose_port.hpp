#pragma once

#include <optional>
#include <string>

#include "config/config.hpp"
#include "tests/emulators/program/ports.hpp"
#include "tests/emulators/robot/pose_sender.hpp"
#include "tests/emulators/robot/rtde_device.hpp"

namespace binpick::emulators {
/// Where a robot that carries the scanner tells its poses: the RTDE port of its controller, or the background program
/// that sends them to the daemon, as its make does.
class PosePort {
 public:
  /// `daemon` is where lines are sent to. Throws std::runtime_error when it cannot listen for RTDE.
  PosePort(drivers::link::Loop& loop, const config::Config& config, const drivers::link::Endpoint& daemon,
           FlangeMotion motion, std::uint64_t seed);

  void turn(TimePoint now);
  std::optional<TimePoint> deadline() const;
  Faults& faults();

 private:
  drivers::link::ConnectionId connection_ = 0;
  std::optional<RtdeDevice> rtde_;
  std::optional<drivers::link::TcpServer> server_;
  std::optional<ClientPort<PoseSender>> sender_;
};
}  // namespace binpick::emulators
