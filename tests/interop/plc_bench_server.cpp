#include <cstdio>
#include <cstdlib>
#include <exception>
#include <optional>
#include <string>
#include <string_view>

#include "drivers/link/tcp.hpp"
#include "plc/session.hpp"

/// The PLC's side of the cell on a real socket, without devices: any request for part 1 or 2 in supply 1 is answered
/// after 0.4 s with a pick whose numbers stand below.
/// Usage: plc_bench_server PORT s7|logix [client]. PORT 0: any; the first line of output is "port N". client: it polls
/// a PLC's own server at that port of this machine.
namespace {
using namespace binpick;
using namespace std::chrono_literals;
namespace link = binpick::drivers::link;

plc::PickResult pick(std::uint16_t pick_id, std::uint16_t part_id) {
  plc::PickResult r;
  r.code = plc::ResultCode::PickFound;
  r.pick_id = pick_id;
  r.part_id = part_id;
  r.objects_left = 11;
  r.fill_level_percent = 42;
  r.score = 0.96875;
  r.T_base_approach.iso.translation() = Eigen::Vector3d{1250, -125.5, 562.5};
  r.T_base_grasp.iso.translation() = Eigen::Vector3d{1250, -125.5, 462.5};
  r.T_base_retreat.iso.translation() = Eigen::Vector3d{1275, -93.75, 562.5};
  // Pointing straight down: half a turn about x.
  const Eigen::Matrix3d down = Eigen::Vector3d{1, -1, -1}.asDiagonal();
  r.T_base_approach.iso.linear() = r.T_base_grasp.iso.linear() = r.T_base_retreat.iso.linear() = down;
  r.figures = {300, 345, 123456, 789, 100};
  return r;
}

link::ServerPeer as_server(plc::Session& session) {
  return {.on_accept = [&](auto id, const std::string& address, std::uint16_t from,
                           TimePoint now) { return session.on_accept(id, address, from, now); },
          .on_bytes = [&](auto id, ByteView bytes, TimePoint now) { session.on_bytes(id, bytes, now); },
          .on_closed = [&](auto id, TimePoint now) { session.on_closed(id, now); },
          .take_output = [&](auto id) { return session.take_output(id); },
          .wants_close = [&](auto id) { return session.wants_close(id); }};
}

link::StreamPeer as_client(plc::Session& session) {
  return {.on_connected = [&](TimePoint now) { session.on_connected(now); },
          .on_bytes = [&](ByteView bytes, TimePoint now) { session.on_bytes(bytes, now); },
          .on_disconnected = [&](TimePoint now) { session.on_disconnected(now); },
          .take_output = [&] { return session.take_output(); }};
}

int serve(std::uint16_t port, plc::WordOrder order, plc::LineRole role) {
  plc::Options options;
  options.role = role;
  options.address = "127.0.0.1:" + std::to_string(port);
  options.word_order = order;
  options.part_ids = {1, 2};
  options.supply_ids = {1};
  plc::Session session{options, 1};
  link::Loop loop;
  std::optional<link::TcpServer> server;
  std::optional<link::TcpClient> client;
  const link::Endpoint endpoint{"127.0.0.1", port};
  if (role == plc::LineRole::Server)
    server.emplace(loop, endpoint, as_server(session));
  else
    client.emplace(loop, endpoint, as_client(session));
  std::printf("port %u\n", server ? server->port() : port);
  std::fflush(stdout);

  std::uint16_t pick_id = 0;
  plc::PickRequest request;
  std::optional<TimePoint> scan_done_at, result_at;
  const auto due = [](std::optional<TimePoint>& at, TimePoint now) {
    if (!at || *at > now) return false;
    at.reset();
    return true;
  };
  TimePoint now = loop.wait(TimePoint{});
  session.set_not_ready(0, now);
  while (true) {
    now = loop.wait(earlier(earlier(session.deadline(), client ? client->deadline() : std::nullopt),
                            earlier(scan_done_at, result_at)));
    if (client) client->on_deadline(now);
    if (client && session.take_reopen()) client->reopen(now);
    session.on_deadline(now);
    while (const auto event = session.take_event()) {
      if (const auto* accepted = std::get_if<plc::RequestAccepted>(&*event)) {
        request = accepted->request;
        scan_done_at = now + 300ms;
      }
      if (std::holds_alternative<plc::CycleAborted>(*event) || std::holds_alternative<plc::CycleTimedOut>(*event)) {
        scan_done_at.reset();
        result_at.reset();
      }
    }
    if (due(scan_done_at, now)) {
      session.on_scan_done(now);
      result_at = now + 100ms;
    }
    if (due(result_at, now)) session.publish(pick(++pick_id, request.part_id), now);
    if (server) server->flush(now);
    if (client) client->flush(now);
  }
}
}  // namespace

int main(int argc, char** argv) {
  const bool client = argc == 4 && std::string_view{argv[3]} == "client";
  const bool enough = argc == 3 || client;
  const std::string_view order = enough ? argv[2] : "";
  char* end = nullptr;
  const long port = enough ? std::strtol(argv[1], &end, 10) : -1;
  if (port < 0 || port > 65535 || *end != '\0' || (order != "s7" && order != "logix")) {
    std::fprintf(stderr, "usage: plc_bench_server PORT s7|logix [client]\n");
    return 2;
  }
  try {
    return serve(static_cast<std::uint16_t>(port),
                 order == "s7" ? plc::WordOrder::HighWordFirst : plc::WordOrder::LowWordFirst,
                 client ? plc::LineRole::Client : plc::LineRole::Server);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "plc_bench_server: %s\n", error.what());
    return 1;
  }
}
