#include "daemon/links.hpp"

#include <stdexcept>
#include <utility>

#include "base/log.hpp"
#include "base/peer_address.hpp"
#include "drivers/scanner/any/scanner_link.hpp"

namespace binpick::daemon {
namespace link = drivers::link;
namespace {
link::Endpoint endpoint(const std::string& text) {
  auto parsed = link::parse_endpoint(text);
  if (!parsed) throw std::runtime_error(parsed.error());
  return *parsed;
}

/// A socket that cannot be opened is told by its key.
template <class Open>
void open_for(const char* key, Open open) {
  try {
    open();
  } catch (const std::runtime_error& failure) {
    throw std::runtime_error(std::string{key} + ": " + failure.what());
  }
}

link::ServerPeer plc_peer(Cell& cell) {
  return {
      .on_accept = [&cell](link::ConnectionId id, const std::string& address, std::uint16_t port,
                           TimePoint now) { return cell.plc().on_accept(id, address, port, now); },
      .on_bytes = [&cell](link::ConnectionId id, ByteView bytes,
                          TimePoint now) { cell.plc().on_bytes(id, bytes, now); },
      .on_closed = [&cell](link::ConnectionId id, TimePoint now) { cell.plc().on_closed(id, now); },
      .take_output = [&cell](link::ConnectionId id) { return cell.plc().take_output(id); },
      .wants_close = [&cell](link::ConnectionId id) { return cell.plc().wants_close(id); },
  };
}

link::StreamPeer plc_server_of(Cell& cell) {
  return {
      .on_connected = [&cell](TimePoint now) { cell.plc().on_connected(now); },
      .on_bytes = [&cell](ByteView bytes, TimePoint now) { cell.plc().on_bytes(bytes, now); },
      .on_disconnected = [&cell](TimePoint now) { cell.plc().on_disconnected(now); },
      .take_output = [&cell] { return cell.plc().take_output(); },
  };
}

std::unique_ptr<link::CanLink> open_pivot(link::Loop& loop, Cell& cell) {
  const auto& config = cell.data().config;
  return link::open_can(
      loop, config.pivot_can, cell.pivot().filters(),
      {
          .on_up = [&cell](TimePoint now) { cell.pivot().on_link_up(now); },
          .on_frame = [&cell](const link::CanFrame& frame, TimePoint at) { cell.pivot().on_frame(frame, at); },
          .on_down = [&cell](const std::string& why, TimePoint now) { cell.pivot().on_link_down(why, now); },
          .take_frames = [&cell] { return cell.pivot().take_frames(); },
      },
      config.pivot_can_listen_port);
}
}  // namespace

Links::Links(link::Loop& loop, Cell& cell)
    : cell_{cell},
      pivot_{cell.poses() == nullptr ? open_pivot(loop, cell) : nullptr},
      scanner_{drivers::scanner::open_link(loop, cell.data().config.scanner_address,
                                           cell.data().config.scanner_listen_port, cell.scanner())} {
  open_plc(loop);
  open_poses(loop);
  if (cell.data().config.robot_listen.empty()) return;  // the PLC forwards the movement
  open_for("robot.listen", [&] {
    robot_.emplace(loop, endpoint(cell.data().config.robot_listen),
                   one_robot(
                       robot_connection_, [this](TimePoint now) { cell_.robot().on_connected(now); },
                       [this](ByteView bytes, TimePoint now) { cell_.robot().on_bytes(bytes, now); },
                       [this](TimePoint now) { cell_.robot().on_disconnected(now); },
                       [this] { return cell_.robot().take_output(); }),
                   link::TcpServerOptions{.connections_max = 2, .newest_wins = true});
  });
}

/// A server of which one connection counts: a robot that lost power never closed its old one, so the new one replaces
/// it.
link::ServerPeer Links::one_robot(link::ConnectionId& counts, std::function<void(TimePoint)> on_connected,
                                  std::function<void(ByteView, TimePoint)> on_bytes,
                                  std::function<void(TimePoint)> on_disconnected, std::function<Bytes()> take_output) {
  return {
      .on_accept =
          [this, &counts, on_connected, on_disconnected](link::ConnectionId id, const std::string& address,
                                                         std::uint16_t, TimePoint now) {
            if (!may_connect(cell_.data().config.robot_allow, address)) {
              BINPICK_LOG(Warning, "robot", "%s refused: not in robot.allow", address.c_str());
              return false;
            }
            if (counts != 0) on_disconnected(now);
            counts = id;
            on_connected(now);
            return true;
          },
      .on_bytes =
          [&counts, on_bytes](link::ConnectionId id, ByteView bytes, TimePoint now) {
            if (id == counts) on_bytes(bytes, now);
          },
      .on_closed =
          [&counts, on_disconnected](link::ConnectionId id, TimePoint now) {
            if (id != counts) return;
            counts = 0;
            on_disconnected(now);
          },
      .take_output = [&counts, take_output](link::ConnectionId id) { return id == counts ? take_output() : Bytes{}; },
      .wants_close = [&counts](link::ConnectionId id) { return id != counts; },
  };
}

void Links::open_poses(link::Loop& loop) {
  if (cell_.poses() == nullptr) return;
  const auto& config = cell_.data().config;
  drivers::robot::PoseSource& poses = *cell_.poses();
  if (poses.cell_connects()) {
    open_for("robot.pose_address", [&] {
      pose_client_.emplace(loop, endpoint(config.pose_address),
                           link::StreamPeer{
                               .on_connected = [&poses](TimePoint now) { poses.on_connected(now); },
                               .on_bytes = [&poses](ByteView bytes, TimePoint now) { poses.on_bytes(bytes, now); },
                               .on_disconnected = [&poses](TimePoint now) { poses.on_disconnected(now); },
                               .take_output = [&poses] { return poses.take_output(); },
                           });
    });
    return;
  }
  open_for("robot.pose_listen", [&] {
    pose_server_.emplace(
        loop, endpoint(config.pose_listen),
        one_robot(
            pose_connection_, [&poses](TimePoint now) { poses.on_connected(now); },
            [&poses](ByteView bytes, TimePoint now) { poses.on_bytes(bytes, now); },
            [&poses](TimePoint now) { poses.on_disconnected(now); }, [&poses] { return poses.take_output(); }),
        link::TcpServerOptions{.connections_max = 2, .newest_wins = true});
  });
}

void Links::open_plc(link::Loop& loop) {
  const auto& config = cell_.data().config;
  if (config.plc.role == plc::LineRole::Client)
    open_for("plc.address", [&] { plc_client_.emplace(loop, endpoint(config.plc.address), plc_server_of(cell_)); });
  else
    open_for("plc.listen", [&] { plc_server_.emplace(loop, endpoint(config.plc_listen), plc_peer(cell_)); });
}

/// Attempts fail alike: told when the reason changes. What a session closed it has told itself.
void Links::tell(const char* device, const std::string& address, const std::string& error, std::string& told) {
  if (std::exchange(told, error) == error || error.empty() || error == drivers::link::kClosedByUs) return;
  const bool has_remedy = error.find(';') != std::string::npos;
  BINPICK_LOG(Warning, device, "no connection to %s: %s%s", address.c_str(), error.c_str(),
              has_remedy ? "" : "; check the address in the cell file, power and cable");
}

void Links::on_deadline(TimePoint now) {
  const auto due = [&](std::optional<TimePoint> at) { return at && *at <= now; };
  if (pivot_ && due(pivot_->deadline())) pivot_->on_deadline(now);
  if (pose_client_ && due(pose_client_->deadline())) pose_client_->on_deadline(now);
  if (due(scanner_->deadline())) scanner_->on_deadline(now);
  const auto& config = cell_.data().config;
  tell("scanner", config.scanner_address, scanner_->last_error(), scanner_trouble_);
  if (pose_client_) tell("robot", config.pose_address, pose_client_->last_error(), pose_trouble_);
  if (!plc_client_) return;
  if (due(plc_client_->deadline())) plc_client_->on_deadline(now);
  // Attempts fail alike: told when the reason changes. Why an open connection ended, the session tells.
  const bool connected = plc_client_->connected();
  const bool closed = std::exchange(plc_connected_, connected) && !connected;
  const std::string trouble = connected ? "" : plc_client_->last_error();
  if (std::exchange(plc_trouble_, trouble) == trouble || trouble.empty() || closed) return;
  BINPICK_LOG(Warning, "plc", "no connection to %s: %s", cell_.data().config.plc.address.c_str(), trouble.c_str());
}

std::optional<TimePoint> Links::deadline() const {
  const auto devices = earlier(pivot_ ? pivot_->deadline() : std::nullopt, scanner_->deadline());
  const auto robot = pose_client_ ? pose_client_->deadline() : std::nullopt;
  return earlier(earlier(devices, robot), plc_client_ ? plc_client_->deadline() : std::nullopt);
}

void Links::flush(TimePoint now) {
  if (cell_.scanner().take_reopen()) scanner_->reopen(now);
  if (robot_ && cell_.robot().take_reopen() && robot_connection_ != 0) robot_->close(robot_connection_, now);
  if (plc_client_ && cell_.plc().take_reopen()) plc_client_->reopen(now);
  if (pivot_) pivot_->flush(now);
  if (cell_.poses() != nullptr && cell_.poses()->take_reopen()) {
    if (pose_client_) pose_client_->reopen(now);
    if (pose_server_ && pose_connection_ != 0) pose_server_->close(pose_connection_, now);
  }
  if (pose_client_) pose_client_->flush(now);
  if (pose_server_) pose_server_->flush(now);
  scanner_->flush(now);
  if (plc_server_) plc_server_->flush(now);
  if (plc_client_) plc_client_->flush(now);
  if (robot_) robot_->flush(now);
}
}  // namespace binpick::daemon
