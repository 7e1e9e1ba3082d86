#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <optional>
#include <stdexcept>
#include <string>

#include "base/clock.hpp"
#include "base/overloaded.hpp"
#include "base/peer_address.hpp"
#include "config/config.hpp"
#include "tools/commands.hpp"
#include "tools/device_links.hpp"
#include "tools/plc_probe.hpp"
#include "tools/pose_probe.hpp"

/// binpick probe CELL.toml: reaches each configured device and says what it is, without moving anything.
namespace binpick::tools {
namespace {
constexpr Duration kAnswerMax = std::chrono::seconds(4);
constexpr Duration kSpinUpMax = std::chrono::seconds(15);  // the scanner, once it has answered at all
constexpr Duration kRobotMax = std::chrono::seconds(3);

/// Waits a while for the robot's program to connect.
Answer ask_robot(drivers::link::Loop& loop, const config::Config& config) {
  const auto endpoint = drivers::link::parse_endpoint(config.robot_listen);
  if (!endpoint) return {false, endpoint.error()};
  std::optional<std::string> robot;
  std::optional<drivers::link::TcpServer> server;
  try {
    server.emplace(loop, *endpoint,
                   drivers::link::ServerPeer{
                       .on_accept =
                           [&](drivers::link::ConnectionId, const std::string& address, std::uint16_t, TimePoint) {
                             robot = address;
                             return false;  // its program tries again, with the daemon
                           },
                       .on_bytes = [](drivers::link::ConnectionId, ByteView, TimePoint) {},
                       .on_closed = [](drivers::link::ConnectionId, TimePoint) {},
                       .take_output = [](drivers::link::ConnectionId) { return Bytes{}; },
                       .wants_close = {}});
  } catch (const std::runtime_error& failure) {
    return {false, failure.what()};
  }
  const SystemClock clock;
  TimePoint now = clock.now();
  const TimePoint until = now + kRobotMax;
  while (!robot && now < until) now = loop.wait(until);
  if (!robot) return {false, "no robot connects; start its program"};
  if (!may_connect(config.robot_allow, *robot))
    return {false, *robot + " connects, but is not in robot.allow; add it there"};
  return {true, "connects from " + *robot};
}

std::string pivot_text(const drivers::pivot::Options& options, const drivers::pivot::ModuleInfo& module) {
  char text[240];
  std::snprintf(text, sizeof text,
                "%s module %u%s%s, firmware %04x, serial %u, range %.1f … %.1f deg, at most %.1f deg/s and %.0f deg/s²",
                to_string(options.protocol), unsigned{options.module_id}, module.type.empty() ? "" : ", ",
                module.type.c_str(), unsigned{module.firmware}, module.serial, module.position_min.in_deg(),
                module.position_max.in_deg(), Angle::rad(module.velocity_max_rad_s).in_deg(),
                Angle::rad(module.acceleration_max_rad_s2).in_deg());
  return text;
}

std::string other_protocol_text(drivers::pivot::Protocol protocol, const std::string& cell_path) {
  const bool motion = protocol == drivers::pivot::Protocol::Motion;
  return std::string("the module speaks ") + (motion ? "the " : "") + to_string(protocol) + "; write protocol = \"" +
         (motion ? "motion" : "powercube") + "\" under [pivot] in " + cell_path;
}

int probe(const std::string& cell_path) {
  const auto config = config::load(cell_path);
  if (!config) {
    std::fprintf(stderr, "binpick: %s is not a good cell file; see all findings with: binpick check %s\n",
                 cell_path.c_str(), cell_path.c_str());
    return 2;
  }
  if (daemon_runs(*config)) {
    std::fprintf(stderr, "binpick: binpickd is at work on %s and holds the devices; stop it before probing\n",
                 config->plc_line().c_str());
    return 1;
  }
  DeviceLinks devices{*config, false};

  std::string pivot = "no answer", scanner;
  const bool has_pivot = config->carrier == config::Carrier::Pivot;
  bool pivot_good = !has_pivot, pivot_known = false, scanner_good = false;
  const SystemClock clock;
  TimePoint now = clock.now();
  const TimePoint began = now;
  const auto patience = [&] {
    return began + (devices.scanner().state() == drivers::scanner::State::Starting ? kSpinUpMax : kAnswerMax);
  };
  while ((!(pivot_good || pivot_known) || !scanner_good) && now < patience()) {
    now = devices.turn(now, std::min(patience(), now + std::chrono::milliseconds(200)));
    while (auto event = devices.pivot().take_event()) {
      if (const auto* ready = std::get_if<drivers::pivot::Ready>(&*event)) {
        pivot = pivot_text(config->pivot, ready->module) + "; " + devices.pivot().state_in_words();
        pivot_good = true;
      } else if (const auto* failed = std::get_if<drivers::pivot::Failed>(&*event)) {
        if (!pivot_good && !pivot_known) pivot = failed->text;
      }
    }
    if (const auto protocol = devices.pivot_answers_in_other(); protocol && !pivot_good) {
      pivot = other_protocol_text(*protocol, cell_path);
      pivot_known = true;
    }
    while (auto event = devices.scanner().take_event()) {
      if (const auto* ready = std::get_if<drivers::scanner::Ready>(&*event)) {
        scanner = drivers::scanner::model_name(config->scanner_options()) + ", set to " + in_words(*ready);
        scanner_good = true;
      } else if (const auto* failed = std::get_if<drivers::scanner::Failed>(&*event)) {
        scanner = failed->text;
      }
    }
  }
  if (scanner.empty()) scanner = "no connection: " + devices.scanner_trouble();

  if (has_pivot)
    std::printf("pivot    %s: %s\n", config->pivot_can.c_str(), pivot.c_str());
  else
    std::printf("pivot    none: the robot carries the scanner\n");
  std::printf("scanner  %s: %s\n", config->scanner_address.c_str(), scanner.c_str());
  Answer robot{true, ""}, poses{true, ""};
  if (config->robot_listen.empty()) {
    std::printf("robot    none configured: the PLC forwards the movement\n");
  } else {
    robot = ask_robot(devices.loop(), *config);
    std::printf("robot    %s: %s\n", config->robot_listen.c_str(), robot.text.c_str());
  }
  if (!has_pivot) {
    poses = ask_poses(devices.loop(), *config);
    std::printf("poses    %s: %s\n", (config->pose_listen.empty() ? config->pose_address : config->pose_listen).c_str(),
                poses.text.c_str());
  }
  Answer plc{true, "free; the PLC is the client and connects when the daemon runs"};
  if (config->plc.role == plc::LineRole::Client) plc = ask_plc(devices.loop(), *config);
  std::printf("plc      %s: %s\n", config->plc_line().c_str(), plc.text.c_str());
  return pivot_good && scanner_good && robot.good && poses.good && plc.good ? 0 : 1;
}
}  // namespace

void add_probe(CLI::App& app, int& exit_status) {
  auto cell = std::make_shared<std::string>();
  auto* command = app.add_subcommand("probe", "Reaches each configured device and says what it is; nothing moves.");
  command->add_option("CELL.toml", *cell, "the cell file")->required();
  command->callback([cell, &exit_status] { exit_status = probe(*cell); });
}
}  // namespace binpick::tools
