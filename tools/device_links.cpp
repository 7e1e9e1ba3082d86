#include "tools/device_links.hpp"

#include <chrono>
#include <stdexcept>

namespace binpick::tools {
namespace link = drivers::link;
namespace {
drivers::pivot::Options pivot_options(const config::Config& config, bool may_move) {
  auto options = config.pivot;
  options.identify_only = !may_move;
  return options;
}

link::Endpoint scanner_endpoint(const config::Config& config) {
  auto endpoint = link::parse_endpoint(config.scanner_address);
  if (!endpoint) throw std::runtime_error("scanner.address: " + endpoint.error());
  return *endpoint;
}
}  // namespace

bool daemon_runs(const config::Config& config) {
  auto endpoint = link::parse_endpoint(config.plc_listen);
  if (!endpoint) return false;
  if (endpoint->host.empty() || endpoint->host == "0.0.0.0") endpoint->host = "127.0.0.1";
  link::Loop loop;
  bool connected = false;
  link::TcpClient client{loop,
                         *endpoint,
                         {.on_connected = [&](TimePoint) { connected = true; },
                          .on_bytes = [](ByteView, TimePoint) {},
                          .on_disconnected = [](TimePoint) {},
                          .take_output = [] { return Bytes{}; }}};
  const SystemClock clock;
  TimePoint now = clock.now();
  const TimePoint until = now + std::chrono::milliseconds(300);
  while (!connected && now < until) {
    client.on_deadline(now);
    now = loop.wait(earlier(client.deadline(), until));
  }
  return connected;
}

DeviceLinks::DeviceLinks(const config::Config& config, bool may_move)
    : pivot_{pivot_options(config, may_move)},
      scanner_{config.scanner},
      pivot_link_{link::open_can(
          loop_, config.pivot_can, {{0x0A0U + config.pivot.module_id, 0x7FF}, {0x060U + config.pivot.module_id, 0x7FF}},
          {
              .on_up = [this](TimePoint now) { pivot_.on_link_up(now); },
              .on_frame = [this](const link::CanFrame& frame, TimePoint at) { pivot_.on_frame(frame, at); },
              .on_down = [this](const std::string& why, TimePoint now) { pivot_.on_link_down(why, now); },
              .take_frames = [this] { return pivot_.take_frames(); },
          },
          config.pivot_can_listen_port)},
      scanner_link_{loop_,
                    scanner_endpoint(config),
                    {
                        .on_connected = [this](TimePoint now) { scanner_.on_connected(now); },
                        .on_bytes = [this](ByteView bytes, TimePoint now) { scanner_.on_bytes(bytes, now); },
                        .on_disconnected = [this](TimePoint now) { scanner_.on_disconnected(now); },
                        .take_output = [this] { return scanner_.take_output(); },
                    }} {}

TimePoint DeviceLinks::turn(TimePoint now, TimePoint until) {
  const auto due = [&](std::optional<TimePoint> at) { return at && *at <= now; };
  if (due(pivot_.deadline())) pivot_.on_deadline(now);
  if (due(scanner_.deadline())) scanner_.on_deadline(now);
  if (due(pivot_link_->deadline())) pivot_link_->on_deadline(now);
  if (due(scanner_link_.deadline())) scanner_link_.on_deadline(now);
  if (scanner_.take_reopen()) scanner_link_.reopen(now);
  pivot_link_->flush(now);
  scanner_link_.flush(now);
  const auto sessions = earlier(pivot_.deadline(), scanner_.deadline());
  const auto links = earlier(pivot_link_->deadline(), scanner_link_.deadline());
  return loop_.wait(earlier(earlier(sessions, links), until));
}
}  // namespace binpick::tools
