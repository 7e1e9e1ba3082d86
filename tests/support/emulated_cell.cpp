#include "tests/support/emulated_cell.hpp"

#include "base/check.hpp"
#include "tests/emulators/program/scan_paths.hpp"

namespace binpick::support {
namespace {
emulators::PlcOptions plc_options(const config::Config& config) {
  emulators::PlcOptions options;
  options.word_order = config.plc.word_order;
  options.pose_convention = config.plc.pose_convention;
  options.base_address = config.plc.base_address;
  options.cell_role = config.plc.role;
  return options;
}

emulators::PivotOptions pivot_options(const config::Config& config, std::uint64_t seed) {
  emulators::PivotOptions options;
  options.protocol = config.pivot.protocol;
  options.module_id = config.pivot.module_id;
  options.seed = seed;
  return options;
}

emulators::RobotOptions robot_options(const config::Config& config) {
  emulators::RobotOptions options;
  options.dialect = config.robot.dialect;
  if (config.carrier == config::Carrier::Robot) options.paths = emulators::scan_paths(config, config.supplies.front());
  return options;
}

emulators::RtdeDevice::Options rtde_options(std::uint64_t seed, const emulators::PoseClock& clock) {
  emulators::RtdeDevice::Options options;
  options.clock = clock;
  options.T_flange_tcp.iso.translation() = Eigen::Vector3d{0, 0, 180};
  options.seed = seed;
  return options;
}

emulators::PoseSender::Options pose_options(const config::Config& config, std::uint64_t seed,
                                            const emulators::PoseClock& clock) {
  emulators::PoseSender::Options options;
  options.clock = clock;
  options.dialect = config.robot.dialect;
  options.seed = seed;
  return options;
}

emulators::ScannerPlace scanner_place(const config::Config& config) {
  return {config.mount.T_base_pivot, config.mount.T_pivot_scanner, config.supplies.front().T_base_supply};
}

emulators::RangeNoise noise(std::uint64_t seed) {
  emulators::RangeNoise noise;
  noise.seed = seed;
  return noise;
}

emulators::LightSection light_section(const config::Config& config, std::uint64_t seed) {
  using emulators::LightSection;
  LightSection device = config.scanner_model == config::ScannerModel::Lps36Hi ? LightSection::hi() : LightSection{};
  device.seed = seed;
  return device;
}
}  // namespace

EmulatedCell::EmulatedCell(std::shared_ptr<const daemon::CellData> data, emulators::World scene, std::uint64_t seed,
                           const emulators::PoseClock& robot_clock)
    : world{std::move(scene)},
      pivot{pivot_options(data->config, seed)},
      scanner{emulators::ScannerView{world, where_scanner(data->config), noise(seed)}},
      lps36{emulators::Lps36View{world, where_scanner(data->config), light_section(data->config, seed)},
            {.hi = data->config.scanner_model == config::ScannerModel::Lps36Hi, .seed = seed}},
      plc{plc_options(data->config)},
      robot{robot_options(data->config)},
      rtde{[this](TimePoint at) { return robot.flange_at(at); }, rtde_options(seed, robot_clock)},
      pose_sender{[this](TimePoint at) { return robot.flange_at(at); }, pose_options(data->config, seed, robot_clock)},
      data_{std::move(data)},
      plc_wire_{plc_wire()},
      scanner_wire_{scanner_wire()},
      robot_wire_{robot_wire()},
      rtde_wire_{rtde_wire()},
      pose_wire_{pose_wire()} {
  start_daemon();
}

emulators::WhereScanner EmulatedCell::where_scanner(const config::Config& config) {
  const auto in_said =
      config.carrier == config::Carrier::Robot
          ? emulators::on_flange(config.supplies.front().T_base_supply, config.T_flange_scanner,
                                 [this](TimePoint at) { return robot.flange_at(at); })
          : emulators::on_pivot(scanner_place(config), [this](TimePoint at) { return pivot.angle_at(at); });
  return [this, in_said](TimePoint at) { return T_said_stands.inverse() * in_said(at); };
}

void EmulatedCell::start_daemon() {
  cell_ = std::make_unique<daemon::Cell>(data_, ++boot_count_);
  can_up_ = false;
  if (cell_->scanner().by_datagrams()) udp_up_at_ = now_;
}

void EmulatedCell::kill_daemon() {
  data_ = std::make_shared<daemon::CellData>(cell_->data());
  cell_.reset();
  looking_.reset();
  pump();  // the devices see their connections close
}

Wire EmulatedCell::plc_wire() {
  const Wire::End as_server{
      .there = [this] { return cell_ != nullptr; },
      .on_connected = [this](TimePoint t) { cell_->plc().on_accept(++plc_connection_, "127.0.0.1", 50000, t); },
      .on_bytes = [this](ByteView b, TimePoint t) { cell_->plc().on_bytes(plc_connection_, b, t); },
      .on_disconnected = [this](TimePoint t) { cell_->plc().on_closed(plc_connection_, t); },
      .take_output = [this] { return cell_->plc().take_output(plc_connection_); },
      .wants_close = [this] { return cell_->plc().wants_close(plc_connection_); },
  };
  const Wire::End as_client{
      .there = [this] { return cell_ != nullptr; },
      .on_connected = [this](TimePoint t) { cell_->plc().on_connected(t); },
      .on_bytes = [this](ByteView b, TimePoint t) { cell_->plc().on_bytes(b, t); },
      .on_disconnected = [this](TimePoint t) { cell_->plc().on_disconnected(t); },
      .take_output = [this] { return cell_->plc().take_output(); },
      .wants_close = [this] { return cell_->plc().take_reopen(); },
  };
  return {plc.is_server() ? as_client : as_server,
          {
              .there = [this] { return !plc.faults.unplugged; },
              .on_connected = [this](TimePoint t) { plc.on_connected(t); },
              .on_bytes = [this](ByteView b, TimePoint t) { plc.on_bytes(b, t); },
              .on_disconnected = [this](TimePoint t) { plc.on_disconnected(t); },
              .take_output = [this] { return plc.take_output(); },
              .wants_close = [this] { return plc.take_reopen(); },
          }};
}

Wire EmulatedCell::scanner_wire() {
  return {{
              .there = [this] { return cell_ != nullptr && !cell_->scanner().by_datagrams(); },
              .on_connected = [this](TimePoint t) { cell_->scanner().on_connected(t); },
              .on_bytes = [this](ByteView b, TimePoint t) { cell_->scanner().on_bytes(b, t); },
              .on_disconnected = [this](TimePoint t) { cell_->scanner().on_disconnected(t); },
              .take_output = [this] { return cell_->scanner().take_output(); },
              .wants_close = [this] { return cell_->scanner().take_reopen(); },
          },
          {
              .there = [this] { return !scanner.faults.unplugged; },
              .on_connected = [this](TimePoint t) { scanner.on_connected(t); },
              .on_bytes = [this](ByteView b, TimePoint t) { scanner.on_bytes(b, t); },
              .on_disconnected = [this](TimePoint t) { scanner.on_disconnected(t); },
              .take_output = [this] { return scanner.take_output(); },
              .wants_close = [this] { return scanner.wants_close(); },
          }};
}

Wire EmulatedCell::robot_wire() {
  return {{
              .there = [this] { return cell_ != nullptr; },
              .on_connected = [this](TimePoint t) { cell_->robot().on_connected(t); },
              .on_bytes = [this](ByteView b, TimePoint t) { cell_->robot().on_bytes(b, t); },
              .on_disconnected = [this](TimePoint t) { cell_->robot().on_disconnected(t); },
              .take_output = [this] { return cell_->robot().take_output(); },
              .wants_close = [this] { return cell_->robot().take_reopen(); },
          },
          {
              .there = [this] { return robot.wants_link(); },
              .on_connected = [this](TimePoint t) { robot.on_connected(t); },
              .on_bytes = [this](ByteView b, TimePoint t) { robot.on_bytes(b, t); },
              .on_disconnected = [this](TimePoint t) { robot.on_disconnected(t); },
              .take_output = [this] { return robot.take_output(); },
              .wants_close = [this] { return robot.take_reopen(); },
          }};
}

namespace {
Wire::End pose_end(std::unique_ptr<daemon::Cell>& cell, bool cell_connects) {
  return {
      .there =
          [&cell, cell_connects] {
            return cell && cell->poses() != nullptr && cell->poses()->cell_connects() == cell_connects;
          },
      .on_connected = [&cell](TimePoint t) { cell->poses()->on_connected(t); },
      .on_bytes = [&cell](ByteView b, TimePoint t) { cell->poses()->on_bytes(b, t); },
      .on_disconnected = [&cell](TimePoint t) { cell->poses()->on_disconnected(t); },
      .take_output = [&cell] { return cell->poses()->take_output(); },
      .wants_close = [&cell] { return cell->poses()->take_reopen(); },
  };
}

template <class Sender>
Wire::End sender_end(Sender& sender) {
  return {
      .there = [&sender] { return sender.wants_link(); },
      .on_connected = [&sender](TimePoint t) { sender.on_connected(t); },
      .on_bytes = [&sender](ByteView b, TimePoint t) { sender.on_bytes(b, t); },
      .on_disconnected = [&sender](TimePoint t) { sender.on_disconnected(t); },
      .take_output = [&sender] { return sender.take_output(); },
      .wants_close = [&sender] { return sender.wants_close(); },
  };
}
}  // namespace

Wire EmulatedCell::rtde_wire() { return {pose_end(cell_, true), sender_end(rtde)}; }
Wire EmulatedCell::pose_wire() { return {pose_end(cell_, false), sender_end(pose_sender)}; }

bool EmulatedCell::pump_frames() {
  if (cell_ && cell_->poses() != nullptr) return false;  // no pivot
  if (cell_ && !can_up_) {
    can_up_ = true;
    cell_->pivot().on_link_up(now_);
  }
  bool moved = false;
  if (cell_)
    for (const auto& frame : cell_->pivot().take_frames()) pivot.on_frame(frame, now_), moved = true;
  for (const auto& frame : pivot.take_frames()) {
    if (cell_) cell_->pivot().on_frame(frame, now_);
    moved = true;
  }
  return moved;
}

bool EmulatedCell::pump_datagrams() {
  if (!cell_ || !cell_->scanner().by_datagrams()) return false;
  auto& session = cell_->scanner();
  if (session.take_reopen()) {
    session.on_disconnected(now_);
    session.take_frames();
    udp_up_at_ = now_ + std::chrono::seconds(1);
  }
  bool moved = false;
  if (udp_up_at_ && *udp_up_at_ <= now_) {
    udp_up_at_.reset();
    session.on_connected(now_);
    moved = true;
  }
  for (const Bytes& datagram : session.take_frames()) lps36.on_frame(datagram, now_), moved = true;
  for (const Bytes& datagram : lps36.take_frames()) session.on_bytes(datagram, now_), moved = true;
  return moved;
}

void EmulatedCell::pump() {
  for (int rounds = 0;; ++rounds) {
    BINPICK_CHECK(rounds < 100'000);
    plc.set_robot_clear(robot.clear_of_view() && !robot_in_the_way);
    bool moved = pump_frames();
    moved |= pump_datagrams();
    moved |= plc_wire_.pump(now_);
    moved |= scanner_wire_.pump(now_);
    moved |= robot_wire_.pump(now_);
    moved |= rtde_wire_.pump(now_);
    moved |= pose_wire_.pump(now_);
    if (cell_) {
      const bool idle = cell_->state() == daemon::CellState::Idle;
      const TimePoint before = std::chrono::steady_clock::now();
      cell_->run(now_);
      if (idle && cell_->state() == daemon::CellState::Sweeping)
        took_up_.push_back(std::chrono::steady_clock::now() - before);
      if (auto request = cell_->take_detect_request()) {
        ++sweeps_;
        last_image_ = request->image;
        // Detection reads the wall clock, of which there is none here: under a sanitizer it would end without a result.
        auto unhurried = std::make_shared<daemon::CellData>(*request->cell);
        unhurried->config.detection.deadline = std::chrono::hours(1);
        request->cell = std::move(unhurried);
        looking_ = daemon::run_detection(*request);
        looked_at_ = now_ + detection_time;
        results_.push_back(*looking_);
        moved = true;
      }
      if (looking_ && looked_at_ <= now_ && !worker_hangs) {
        cell_->on_detect_result(std::move(*std::exchange(looking_, std::nullopt)), now_);
        moved = true;
      }
    }
    if (!moved) return;
  }
}

void EmulatedCell::serve_deadlines() {
  const auto due = [&](std::optional<TimePoint> at) { return at && *at <= now_; };
  if (due(pivot.deadline())) pivot.on_deadline(now_);
  if (due(scanner.deadline())) scanner.on_deadline(now_);
  if (due(lps36.deadline())) lps36.on_deadline(now_);
  if (due(plc.deadline())) plc.on_deadline(now_);
  if (due(robot.deadline())) robot.on_deadline(now_);
  if (due(rtde.deadline())) rtde.on_deadline(now_);
  if (due(pose_sender.deadline())) pose_sender.on_deadline(now_);
}

std::optional<TimePoint> EmulatedCell::next_deadline() const {
  auto next = earlier(earlier(pivot.deadline(), scanner.deadline()), earlier(plc.deadline(), robot.deadline()));
  next = earlier(next, earlier(plc_wire_.deadline(), earlier(scanner_wire_.deadline(), robot_wire_.deadline())));
  next = earlier(next, earlier(rtde_wire_.deadline(), pose_wire_.deadline()));
  next = earlier(next, earlier(lps36.deadline(), udp_up_at_));
  next = earlier(next, earlier(rtde.deadline(), pose_sender.deadline()));
  if (cell_) next = earlier(next, cell_->deadline());
  if (looking_ && !worker_hangs) next = earlier(next, looked_at_);
  return next;
}

bool EmulatedCell::run_until(const std::function<bool()>& done, Duration limit) {
  const TimePoint until = now_ + limit;
  pump();
  while (!done()) {
    if (now_ >= until) return false;
    const TimePoint next = std::min(until, next_deadline().value_or(until));
    // A deadline that stays in the past is served in the next microsecond, so that time goes on.
    now_ = std::max(next, now_ + std::chrono::microseconds(1));
    serve_deadlines();
    pump();
  }
  return true;
}

void EmulatedCell::run_for(Duration time) {
  run_until([] { return false; }, time);
}

bool EmulatedCell::run_until_ready(Duration limit) {
  return run_until([this] { return plc.ready(); }, limit);
}

std::optional<emulators::PlcResult> EmulatedCell::pick(std::uint16_t part_id, std::uint16_t supply_id) {
  while (plc.take_result()) {
  }
  plc.raise_request(part_id, supply_id);
  std::optional<emulators::PlcResult> result;
  run_until([&] { return (result = plc.take_result()).has_value(); });
  return result;
}

void EmulatedCell::plc_writes(std::uint16_t offset, std::uint16_t value) {
  Bytes frame;
  for (const int word : {0x0009, 0x0000, 0x0006, 0xFF06}) append_be(frame, static_cast<std::uint16_t>(word));
  append_be(frame, offset);
  append_be(frame, value);
  cell_->plc().on_bytes(plc_connection_, frame, now_);
  cell_->plc().take_output(plc_connection_);
}
}  // namespace binpick::support
