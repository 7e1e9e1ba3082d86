#include "tools/device_links.hpp"

#include <chrono>
#include <stdexcept>

#include "base/lock_file.hpp"
#include "drivers/scanner/any/scanner_link.hpp"

namespace binpick::tools {
namespace link = drivers::link;
namespace {
drivers::pivot::Options pivot_options(const config::Config& config, bool may_move) {
  auto options = config.pivot;
  options.identify_only = !may_move;
  return options;
}
}  // namespace

bool daemon_runs(const config::Config& config) {
  // A daemon that asks the PLC listens nowhere.
  if (config.plc.role == plc::LineRole::Client) return LockFile::is_held(config.lock_path());
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

std::unique_ptr<link::CanLink> DeviceLinks::open_pivot(const config::Config& config) {
  if (config.carrier != config::Carrier::Pivot) return nullptr;
  return link::open_can(
      loop_, config.pivot_can, pivot_.filters(),
      {
          .on_up = [this](TimePoint now) { pivot_.on_link_up(now); },
          .on_frame = [this](const link::CanFrame& frame, TimePoint at) { pivot_.on_frame(frame, at); },
          .on_down = [this](const std::string& why, TimePoint now) { pivot_.on_link_down(why, now); },
          .take_frames = [this] { return pivot_.take_frames(); },
      },
      config.pivot_can_listen_port);
}

DeviceLinks::DeviceLinks(const config::Config& config, bool may_move)
    : pivot_{pivot_options(config, may_move)},
      scanner_{config.scanner_options()},
      pivot_link_{open_pivot(config)},
      scanner_link_{drivers::scanner::open_link(loop_, config.scanner_address, config.scanner_listen_port, scanner_)} {}

TimePoint DeviceLinks::turn(TimePoint now, TimePoint until) {
  const auto due = [&](std::optional<TimePoint> at) { return at && *at <= now; };
  if (due(pivot_.deadline())) pivot_.on_deadline(now);
  if (due(scanner_.deadline())) scanner_.on_deadline(now);
  if (pivot_link_ && due(pivot_link_->deadline())) pivot_link_->on_deadline(now);
  if (due(scanner_link_->deadline())) scanner_link_->on_deadline(now);
  if (scanner_.take_reopen()) scanner_link_->reopen(now);
  if (pivot_link_) pivot_link_->flush(now);
  scanner_link_->flush(now);
  const auto sessions = earlier(pivot_.deadline(), scanner_.deadline());
  const auto links = earlier(pivot_link_ ? pivot_link_->deadline() : std::nullopt, scanner_link_->deadline());
  return loop_.wait(earlier(earlier(sessions, links), until));
}
}  // namespace binpick::tools
