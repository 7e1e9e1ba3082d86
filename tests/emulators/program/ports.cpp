#include "tests/emulators/program/ports.hpp"

#include <stdexcept>
#include <string_view>

#include "drivers/link/cannelloni_link.hpp"
#include "tests/emulators/scanner/lps36_view.hpp"
#include "tests/emulators/scanner/scanner_view.hpp"

namespace binpick::emulators {
namespace link = drivers::link;
namespace {
constexpr std::string_view kUdpScheme = "cannelloni://";

link::Endpoint endpoint(const std::string& text, const char* what) {
  const auto parsed = link::parse_endpoint(text);
  if (!parsed) throw std::runtime_error(std::string(what) + ": " + parsed.error());
  return *parsed;
}
}  // namespace

PivotPort::PivotPort(const std::string& can, const PivotOptions& options) : pivot_{options} {
  const link::CanPeer peer{
      .on_up = [](TimePoint) {},
      .on_frame =
          [this](const link::CanFrame& frame, TimePoint at) {
            const std::lock_guard lock{mutex_};
            pivot_.on_frame(frame, at);
          },
      .on_down = [](const std::string&, TimePoint) {},
      .take_frames =
          [this] {
            const std::lock_guard lock{mutex_};
            return pivot_.take_frames();
          },
  };
  if (can.starts_with(kUdpScheme))
    link_ = std::make_unique<link::CannelloniLink>(loop_, endpoint(can.substr(kUdpScheme.size()), "pivot"), peer);
  else
    link_ = link::open_can(loop_, can, {}, peer);
  thread_ = std::thread{[this] { run(); }};
}

PivotPort::~PivotPort() {
  stop_ = true;
  loop_.wake();
  thread_.join();
}

Angle PivotPort::angle_at(TimePoint at) const {
  const std::lock_guard lock{mutex_};
  return pivot_.angle_at(at);
}

void PivotPort::run() {
  TimePoint now = SystemClock{}.now();
  while (!stop_) {
    std::optional<TimePoint> next;
    {
      const std::lock_guard lock{mutex_};
      if (pivot_.deadline() && *pivot_.deadline() <= now) pivot_.on_deadline(now);
    }
    if (link_->deadline() && *link_->deadline() <= now) link_->on_deadline(now);
    link_->flush(now);
    {
      const std::lock_guard lock{mutex_};
      next = earlier(pivot_.deadline(), link_->deadline());
    }
    now = loop_.wait(next);
  }
}

Lms400Port::Lms400Port(link::Loop& loop, const std::string& listen, Lms400::Measure measure, std::uint64_t seed)
    : scanner{std::move(measure), {.seed = seed}},
      server_{loop,
              endpoint(listen, "scanner"),
              serve_one(scanner, connection_),
              {.connections_max = 2, .newest_wins = true, .unsent_bytes_max = 4 << 20}} {}

void Lms400Port::turn(TimePoint now) {
  if (scanner.faults.unplugged && connection_ != 0) server_.close(connection_, now);
  if (scanner.deadline() && *scanner.deadline() <= now) scanner.on_deadline(now);
  server_.flush(now);
}

Lps36Port::Lps36Port(link::Loop& loop, const std::string& listen, Lps36::Measure measure, const Lps36::Options& options)
    : scanner{std::move(measure), options},
      link_{loop,
            endpoint(listen, "scanner"),
            {.on_connected = {},
             .on_frame = [this](ByteView bytes, TimePoint now) { scanner.on_frame(bytes, now); },
             .on_disconnected = {},
             .take_frames = [this] { return scanner.take_frames(); },
             .on_other_peer = {}},
            "scanner"} {}

void Lps36Port::turn(TimePoint now) {
  if (scanner.deadline() && *scanner.deadline() <= now) scanner.on_deadline(now);
  if (link_.deadline() && *link_.deadline() <= now) link_.on_deadline(now);
  link_.flush(now);
}

std::unique_ptr<ScannerPort> open_scanner(link::Loop& loop, const config::Config& config, const World& world,
                                          WhereScanner where, std::uint64_t seed) {
  using enum config::ScannerModel;
  if (config.scanner_model == Lms400)
    return std::make_unique<Lms400Port>(loop, config.scanner_address,
                                        ScannerView{world, std::move(where), {.seed = seed}}, seed);
  const bool is_hi = config.scanner_model == Lps36Hi;
  LightSection device = is_hi ? LightSection::hi() : LightSection{};
  device.seed = seed;
  return std::make_unique<Lps36Port>(loop, config.scanner_address, Lps36View{world, std::move(where), device},
                                     Lps36::Options{.hi = is_hi, .seed = seed});
}

PlcPort::PlcPort(link::Loop& loop, const link::Endpoint& endpoint, Plc plc)
    : ClientPort{loop, endpoint, std::move(plc)} {
  if (!device.is_server()) return;
  server_.emplace(loop, endpoint, serve_one(device, connection_),
                  link::TcpServerOptions{.connections_max = 2, .newest_wins = true});
}

void PlcPort::turn(TimePoint now) {
  if (!server_) return ClientPort::turn(now);
  if (device.deadline() && *device.deadline() <= now) device.on_deadline(now);
  server_->flush(now);
  if ((device.take_reopen() || device.faults.unplugged) && connection_ != 0) server_->close(connection_, now);
}
}  // namespace binpick::emulators
