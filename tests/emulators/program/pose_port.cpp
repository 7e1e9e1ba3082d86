#include "tests/emulators/program/pose_port.hpp"

#include <stdexcept>

namespace binpick::emulators {
namespace link = drivers::link;
namespace {
/// Of a controller that was switched on this morning, and does not keep our time.
PoseClock worn_clock() {
  return {.drift_ppm = 50, .first_s = 0, .started = SystemClock{}.now() - std::chrono::hours(8)};
}
}  // namespace

PosePort::PosePort(link::Loop& loop, const config::Config& config, const link::Endpoint& daemon, FlangeMotion motion,
                   std::uint64_t seed) {
  if (config.robot.dialect != drivers::robot::Dialect::UniversalRobots) {
    sender_.emplace(loop, daemon,
                    PoseSender{std::move(motion),
                               {.dialect = config.robot.dialect,
                                .clock = worn_clock(),
                                .T_flange_tcp = config.T_flange_tcp,
                                .seed = seed}});
    return;
  }
  RtdeDevice::Options options;
  options.clock = worn_clock();
  options.T_flange_tcp.iso.translation() = Eigen::Vector3d{0, 0, 180};  // of the gripper; RTDE tells it by itself
  options.seed = seed;
  rtde_.emplace(std::move(motion), options);
  const auto endpoint = link::parse_endpoint(config.pose_address);
  if (!endpoint) throw std::runtime_error("robot.pose_address: " + endpoint.error());
  server_.emplace(loop, *endpoint, serve_one(*rtde_, connection_),
                  link::TcpServerOptions{.connections_max = 2, .newest_wins = true});
}

void PosePort::turn(TimePoint now) {
  if (sender_) return sender_->turn(now);
  if (rtde_->faults.unplugged && connection_ != 0) server_->close(connection_, now);
  if (rtde_->deadline() && *rtde_->deadline() <= now) rtde_->on_deadline(now);
  server_->flush(now);
}

std::optional<TimePoint> PosePort::deadline() const { return sender_ ? sender_->deadline() : rtde_->deadline(); }

Faults& PosePort::faults() { return sender_ ? sender_->device.faults : rtde_->faults; }
}  // namespace binpick::emulators
