#include "tools/pose_probe.hpp"

#include <chrono>
#include <cmath>
#include <cstdio>
#include <optional>
#include <stdexcept>

#include "base/clock.hpp"
#include "base/overloaded.hpp"
#include "base/peer_address.hpp"
#include "drivers/link/tcp.hpp"
#include "drivers/robot/pose_source.hpp"

namespace binpick::tools {
namespace link = drivers::link;
namespace robot = drivers::robot;
namespace {
constexpr Duration kConnectMax = std::chrono::seconds(4);  // or nothing understood of it
constexpr Duration kComeMax = std::chrono::seconds(12);    // the robot's clock takes five to be known
constexpr Duration kCountFor = std::chrono::seconds(1);    // poses

/// What has come from the source.
struct Heard {
  std::optional<robot::PoseReady> ready;
  std::optional<TimePoint> first;  ///< Pose, and the last of them.
  TimePoint last;
  std::size_t poses = 0;
  std::optional<Transform<frame::Base, frame::Flange>> T_base_flange;
  std::string failed;

  void take(robot::PoseSource& poses_of, TimePoint now) {
    while (const auto event = poses_of.take_event())
      std::visit(Overloaded{
                     [&](const robot::PoseReady& news) { ready = news; },
                     [&](const robot::PoseSample& sample) {
                       if (!first) first = now;
                       last = now;
                       ++poses;
                       T_base_flange = sample.T_base_flange;
                     },
                     [&](const robot::PoseFailed& news) { failed = news.text; },
                 },
                 *event);
  }
  bool enough() const { return first && last - *first >= kCountFor; }
};

std::string good_text(const Heard& heard, const robot::PoseSource& source) {
  const Eigen::Vector3d at_mm = heard.T_base_flange->iso.translation();
  char text[200];
  std::snprintf(text, sizeof text,
                "%.0f poses per second, their times known within %.1f ms; the flange is at %.0f, %.0f, %.0f mm",
                static_cast<double>(heard.poses - 1) / in_s(heard.last - *heard.first), in_ms(heard.ready->uncertainty),
                at_mm.x(), at_mm.y(), at_mm.z());
  const std::string trouble = source.trouble();
  const std::string controller = source.controller();
  return (controller.empty() ? "" : controller + ", ") + text + (trouble.empty() ? "" : " (" + trouble + ")");
}

/// Pumps `turn` until there are enough poses, or no hope.
template <class Turn>
void gather(link::Loop& loop, robot::PoseSource& source, Heard& heard, Turn turn) {
  const SystemClock clock;
  TimePoint now = clock.now();
  const TimePoint began = now;
  while (!heard.enough() && heard.failed.empty()) {
    const Duration patience = source.state() == robot::PoseState::Offline ? kConnectMax : kComeMax;
    if (!heard.first && now - began > patience) return;
    if (const auto due = source.deadline(); due && *due <= now) source.on_deadline(now);
    const auto deadline = turn(now);
    heard.take(source, now);
    now = loop.wait(earlier(earlier(deadline, source.deadline()), now + std::chrono::milliseconds(100)));
    heard.take(source, now);
  }
}

Answer ask_rtde(link::Loop& loop, const config::Config& config) {
  const auto endpoint = link::parse_endpoint(config.pose_address);
  if (!endpoint) return {false, endpoint.error()};
  robot::PoseSource source{config.pose_options()};
  link::TcpClient client{loop,
                         *endpoint,
                         {.on_connected = [&](TimePoint now) { source.on_connected(now); },
                          .on_bytes = [&](ByteView bytes, TimePoint now) { source.on_bytes(bytes, now); },
                          .on_disconnected = [&](TimePoint now) { source.on_disconnected(now); },
                          .take_output = [&] { return source.take_output(); }}};
  Heard heard;
  gather(loop, source, heard, [&](TimePoint now) {
    client.on_deadline(now);
    client.flush(now);
    return client.deadline();
  });
  if (heard.enough()) return {true, good_text(heard, source)};
  if (!heard.failed.empty()) return {false, heard.failed};
  if (!client.connected())
    return {false, "no connection: " + client.last_error() +
                       "; check address, port (30004), cable, and that RTDE is enabled on the controller"};
  return {false, source.controller() + ", but no poses: " +
                     (source.trouble().empty() ? "its clock could not be made out" : source.trouble())};
}

Answer wait_for_lines(link::Loop& loop, const config::Config& config) {
  const auto endpoint = link::parse_endpoint(config.pose_listen);
  if (!endpoint) return {false, endpoint.error()};
  robot::PoseSource source{config.pose_options()};
  link::ConnectionId counts = 0;
  std::string from, refused;
  std::optional<link::TcpServer> server;
  try {
    server.emplace(
        loop, *endpoint,
        link::ServerPeer{.on_accept =
                             [&](link::ConnectionId id, const std::string& address, std::uint16_t, TimePoint now) {
                               if (!may_connect(config.robot_allow, address)) {
                                 refused = address;
                                 return false;
                               }
                               if (counts != 0) source.on_disconnected(now);
                               counts = id;
                               from = address;
                               source.on_connected(now);
                               return true;
                             },
                         .on_bytes =
                             [&](link::ConnectionId id, ByteView bytes, TimePoint now) {
                               if (id == counts) source.on_bytes(bytes, now);
                             },
                         .on_closed =
                             [&](link::ConnectionId id, TimePoint now) {
                               if (id == counts) source.on_disconnected(now);
                             },
                         .take_output = [](link::ConnectionId) { return Bytes{}; },
                         .wants_close = [&](link::ConnectionId id) { return id != counts; }},
        link::TcpServerOptions{.connections_max = 2, .newest_wins = true});
  } catch (const std::runtime_error& failure) {
    return {false, failure.what()};
  }
  Heard heard;
  gather(loop, source, heard, [&](TimePoint now) {
    server->flush(now);
    return std::optional<TimePoint>{};
  });
  if (heard.enough()) return {true, "from " + from + ": " + good_text(heard, source)};
  if (!heard.failed.empty()) return {false, "from " + from + ": " + heard.failed};
  if (!from.empty()) return {false, from + " is connected, but no poses come; look at its background program"};
  if (!refused.empty()) return {false, refused + " connects, but is not in robot.allow; add it there"};
  return {false, "the port is free, but nobody sends poses to it; start the robot's background program"};
}
}  // namespace

Answer ask_poses(link::Loop& loop, const config::Config& config) {
  return config.pose_listen.empty() ? ask_rtde(loop, config) : wait_for_lines(loop, config);
}
}  // namespace binpick::tools
