#include "tests/emulators/program/run.hpp"

#include <cmath>
#include <csignal>
#include <cstdarg>
#include <cstdio>
#include <stdexcept>
#include <sys/epoll.h>
#include <sys/signalfd.h>
#include <unistd.h>
#include <utility>

#include "tests/emulators/program/pick_line.hpp"
#include "tests/emulators/program/scan_paths.hpp"

namespace binpick::emulators {
namespace link = drivers::link;
using namespace std::chrono_literals;
using drivers::robot::Status;
using plc::ResultCode;

namespace {
constexpr Duration kAnswerMax = 40s;  ///< From a request to its answer; then the PLC aborts.
constexpr Duration kReportMax = 60s;  ///< From a pick to the robot's report.
constexpr Duration kSettle = 300ms;   ///< Before a refused request is raised again.
/// A bin with fewer objects is filled anew.
constexpr std::size_t kObjectsMin = 3;

[[gnu::format(printf, 1, 2)]] void say(const char* format, ...) {
  std::va_list arguments;
  va_start(arguments, format);
  std::vprintf(format, arguments);
  va_end(arguments);
  std::putchar('\n');
  std::fflush(stdout);
}

/// Where a client reaches the daemon that listens at `listen`.
link::Endpoint daemon_at(const std::string& listen, const std::string& host, const char* key) {
  auto endpoint = link::parse_endpoint(listen);
  if (!endpoint) throw std::runtime_error(std::string(key) + ": " + endpoint.error());
  if (!host.empty()) endpoint->host = host;
  if (endpoint->host.empty() || endpoint->host == "0.0.0.0" || endpoint->host == "::") endpoint->host = "127.0.0.1";
  return *endpoint;
}

/// The emulated robot was taught a path under whatever number the cell file gives it: over the supply in a line, or,
/// for kPanPath, turning.
RobotOptions robot_options(const config::Config& config, const config::Supply& supply, std::uint64_t seed) {
  RobotOptions options;
  options.dialect = config.robot.dialect;
  options.seed = seed;
  if (config.carrier != config::Carrier::Robot) return options;
  options.paths = scan_paths(config, supply);
  const ScanPath line = options.paths.at(kLinearPath);
  options.paths.emplace(supply.scan_path, line);
  return options;
}

int open_signals() {
  sigset_t set;
  sigemptyset(&set);
  for (const int number : {SIGTERM, SIGINT}) sigaddset(&set, number);
  pthread_sigmask(SIG_BLOCK, &set, nullptr);
  return signalfd(-1, &set, SFD_NONBLOCK | SFD_CLOEXEC);
}
}  // namespace

Run::Run(const config::Config& config, const RunOptions& options)
    : config_{config}, options_{options}, signals_{open_signals()}, bin_{config, options.bin} {
  const bool carried = config.carrier == config::Carrier::Robot;
  if (carried) options_.devices.erase(Device::Pivot);  // there is none
  if (options_.devices.contains(Device::Scanner) && !options_.devices.contains(carried ? Device::Robot : Device::Pivot))
    throw std::runtime_error(carried ? "the scanner's view moves with the robot: play both, \"scanner robot\""
                                     : "the scanner's view turns with the pivot: play both, \"pivot scanner\"");
  open_devices();
}

Run::~Run() {
  if (signals_ >= 0) ::close(signals_);
}

void Run::open_devices() {
  const config::Supply& supply = config_.supplies.at(options_.bin.supply);
  if (options_.devices.contains(Device::Pivot)) {
    PivotOptions pivot;
    pivot.protocol = options_.pivot.value_or(config_.pivot.protocol);
    pivot.module_id = config_.pivot.module_id;
    pivot.seed = options_.bin.seed;
    pivot_ = std::make_unique<PivotPort>(config_.pivot_can, pivot);
  }
  if (options_.devices.contains(Device::Scanner)) {
    scanner_ = open_scanner(loop_, config_, bin_.world(), where_scanner(supply), options_.bin.seed);
  }
  if (options_.devices.contains(Device::Robot)) {
    if (config_.robot_listen.empty())
      throw std::runtime_error("robot.listen is empty: this cell's PLC moves the robot");
    robot_ = std::make_unique<RobotPort>(loop_, daemon_at(config_.robot_listen, options_.daemon_host, "robot.listen"),
                                         Robot{robot_options(config_, supply, options_.bin.seed)});
    if (config_.carrier == config::Carrier::Robot)
      poses_ = std::make_unique<PosePort>(
          loop_, config_,
          config_.pose_listen.empty() ? link::Endpoint{}
                                      : daemon_at(config_.pose_listen, options_.daemon_host, "robot.pose_listen"),
          [this](TimePoint at) { return robot_->device.flange_at(at); }, options_.bin.seed);
    robot_->device.on_grasp = [this](const drivers::robot::Pick& pick) {
      return close_gripper(picks_[pick.pick_id], pick.T_base_approach, pick.T_base_grasp, pick.T_base_retreat);
    };
  }
  if (options_.devices.contains(Device::Plc)) {
    PlcOptions plc;
    plc.word_order = config_.plc.word_order;
    plc.pose_convention = config_.plc.pose_convention;
    plc.base_address = config_.plc.base_address;
    plc.cell_role = config_.plc.role;
    const bool server = plc.cell_role == plc::LineRole::Client;
    // A server listens where the cell file says that it is; a client looks for the daemon.
    const link::Endpoint at = server ? daemon_at(config_.plc.address, "", "plc.address")
                                     : daemon_at(config_.plc_listen, options_.daemon_host, "plc.listen");
    plc_ = std::make_unique<PlcPort>(loop_, at, Plc{plc});
  }
}

WhereScanner Run::where_scanner(const config::Supply& supply) {
  if (config_.carrier == config::Carrier::Robot)
    return on_flange(supply.T_base_supply, config_.T_flange_scanner,
                     [this](TimePoint at) { return robot_->device.flange_at(at); });
  const ScannerPlace place{config_.mount.T_base_pivot, config_.mount.T_pivot_scanner, supply.T_base_supply};
  return on_pivot(place, [this](TimePoint at) { return pivot_->angle_at(at); });
}

void Run::say_bin(const char* what) const {
  const std::string part = config_.recipes.at(options_.bin.recipe).part.options.name;
  const auto seed = static_cast<unsigned long long>(bin_.seed());
  if (bin_.is_belt())
    say("belt: %s%zu of %s, each by itself, seed %llu", what, bin_.objects_left(), part.c_str(), seed);
  else
    say("bin: %s%zu of %s, %zu of them over or under another, seed %llu", what, bin_.objects_left(), part.c_str(),
        bin_.overlapping(), seed);
}

void Run::print_addresses() const {
  if (pivot_)
    say("pivot:   %s, module %u, %s", config_.pivot_can.c_str(), unsigned{config_.pivot.module_id},
        to_string(options_.pivot.value_or(config_.pivot.protocol)));
  if (scanner_) say("scanner: listens at %s", config_.scanner_address.c_str());
  if (robot_) say("robot:   connects to the daemon's robot.listen, %s", config_.robot_listen.c_str());
  if (poses_)
    say("         it carries the scanner along path %u; its poses: %s",
        config_.supplies.at(options_.bin.supply).scan_path,
        config_.pose_listen.empty() ? ("RTDE at " + config_.pose_address).c_str()
                                    : ("as lines to the daemon's robot.pose_listen, " + config_.pose_listen).c_str());
  if (plc_)
    say(plc_->device.is_server() ? "PLC:     listens at %s" : "PLC:     connects to the daemon's plc.listen, %s",
        config_.plc_line().c_str());
}

int Run::run() {
  say_bin("");
  print_addresses();
  const SystemClock clock;
  TimePoint now = clock.now();
  const TimePoint until = options_.timeout == Duration::max() ? TimePoint::max() : now + options_.timeout;
  loop_.watch(signals_, EPOLLIN, [this](std::uint32_t, TimePoint) {
    finish(options_.cycles == 0 ? 0 : 1, options_.cycles == 0 ? "ended" : "ended before all picks were made");
  });
  try {
    loop_.watch(STDIN_FILENO, EPOLLIN, [this](std::uint32_t, TimePoint at) { read_commands(at); });
  } catch (const std::exception&) {
    // A file or /dev/null as standard input cannot be waited for: no commands then.
  }
  for (const auto& line : options_.commands) on_line(line, now);
  while (!status_) {
    turn_devices(now);
    if (bin_.poll_refill()) {
      ++refills_;
      say_bin(bin_.is_belt() ? "moved on, " : "filled anew, ");
      supply_changed_ = true;
    }
    if (plc_) turn_plc(now);
    if (robot_) turn_robot(now);
    turn_devices(now);  // what they have just decided goes out at once
    if (now >= until) finish(1, "not done within " + std::to_string(std::lround(in_s(options_.timeout))) + " s");
    if (!status_)
      now = loop_.wait(earlier(deadline(), until == TimePoint::max() ? std::nullopt : std::optional{until}));
  }
  return *status_;
}

std::optional<TimePoint> Run::deadline() const {
  std::optional<TimePoint> next;
  if (scanner_) next = earlier(next, scanner_->deadline());
  if (robot_) next = earlier(next, robot_->deadline());
  if (poses_) next = earlier(next, poses_->deadline());
  if (plc_) next = earlier(next, plc_->deadline());
  if (bin_.refilling() || plc_) next = earlier(next, SystemClock{}.now() + 50ms);  // the PLC's program scans
  return next;
}

void Run::turn_devices(TimePoint now) {
  if (scanner_) scanner_->turn(now);
  if (robot_) robot_->turn(now);
  if (poses_) poses_->turn(now);
  if (plc_) plc_->turn(now);
}

void Run::turn_plc(TimePoint now) {
  Plc& plc = plc_->device;
  if (robot_) plc.set_robot_clear(robot_->device.clear_of_view());
  if (!plc.map_problem().empty()) return finish(1, "the register map is not the expected one: " + plc.map_problem());
  tell_alarms();
  if (plc.fault() && now >= next_reset_) {
    plc.raise_reset();
    next_reset_ = now + 1s;
    if (step_ == Step::Asked) step_ = Step::Idle;  // a fault ends the cycle without an answer
  }
  while (const auto result = plc.take_result()) on_result(*result, now);
  switch (step_) {
    case Step::Idle:
      if ((!options_.requests && !pick_wanted_) || !plc.ready() || now < next_request_ || bin_.refilling()) return;
      if (robot_ && !robot_->device.clear_of_view()) return;
      plc.set_robot_clear(true);
      plc.set_new_scan(std::exchange(supply_changed_, false));
      plc.raise_request(config_.recipes[options_.bin.recipe].id, config_.supplies[options_.bin.supply].id);
      pick_wanted_ = false;
      step_ = Step::Asked;
      step_since_ = now;
      asked_boot_ = plc.boot_count();
      return;
    case Step::Asked:
      if (plc.boot_count() != 0 && plc.boot_count() != asked_boot_) {  // 0: this PLC was, and has not read yet
        say("PLC: the daemon was restarted, which voids request %u; it is asked again", plc.sequence());
        step_ = Step::Idle;
        pick_wanted_ = true;
        return;
      }
      if (now - step_since_ < kAnswerMax) return;
      say("PLC: no answer to request %u within %.0f s, abort", plc.sequence(), in_s(kAnswerMax));
      plc.raise_abort();
      step_ = Step::Idle;
      next_request_ = now + 1s;
      return;
    case Step::Robot:
      if (robot_) {
        if (now - step_since_ >= kReportMax) finish_pick(picking_, "the robot never reported", now);
      } else if (now - step_since_ >= options_.pick_time) {
        // A real robot took it meanwhile; the emulated bin follows.
        Pick& pick = picks_[picking_];
        close_gripper(pick, pick.result->T_base_approach, pick.result->T_base_grasp, pick.result->T_base_retreat);
        plc.set_robot_clear(true);
        finish_pick(picking_, "", now);
      }
      return;
  }
}

void Run::on_result(const PlcResult& result, TimePoint now) {
  if (result.code == ResultCode::PickFound) {
    picks_[result.pick_id].result = result;
    picking_ = result.pick_id;
    step_ = Step::Robot;
    step_since_ = now;
    without_pick_in_row_ = 0;
    if (!robot_) plc_->device.set_robot_clear(false);
    return;
  }
  step_ = Step::Idle;
  next_request_ = now + std::max(options_.pause, kSettle);
  say("%s", no_pick_line(result).c_str());
  if (result.code != ResultCode::SupplyEmpty && result.code != ResultCode::NothingFound &&
      result.code != ResultCode::NotReachable)
    return;
  // A PLC moves its belt on when it is told that nothing is left: no fault of anybody.
  if (bin_.objects_left() == 0 && options_.bin.objects > 0) return bin_.start_refill();
  ++without_pick_;
  // Once may be noise; twice in a row, this bin gives nothing any more.
  if (++without_pick_in_row_ >= 2 || bin_.objects_left() < kObjectsMin) bin_.start_refill();
  if (options_.cycles > 0 && without_pick_ > options_.cycles / 2 + 3) finish(1, "too many cycles without a pick");
}

void Run::turn_robot(TimePoint now) {
  while (const auto event = robot_->device.take_event()) {
    if (const auto* read = std::get_if<Robot::PickRead>(&*event)) {
      picks_[read->pick.pick_id].read = read->pick;
    } else if (const auto* answered = std::get_if<Robot::ReportAnswered>(&*event)) {
      std::string how = answered->done ? "done" : "FAILED";
      if (answered->status != Status::ReportTaken)
        how += ", report answered with status " + std::to_string(static_cast<int>(answered->status));
      finish_pick(answered->pick_id, how, now);
    } else if (const auto* scanned = std::get_if<Robot::ScanAnswered>(&*event); scanned && scanned->broken) {
      say("robot: told of scan %u that it is broken off, answered with status %d", scanned->scan,
          static_cast<int>(scanned->status));
    } else if (const auto* trouble = std::get_if<Robot::Trouble>(&*event)) {
      say("robot: %s", trouble->text.c_str());
    }
  }
}

bool Run::close_gripper(Pick& pick, const Transform<frame::Base, frame::Tcp>& T_base_approach,
                        const Transform<frame::Base, frame::Tcp>& T_base_grasp,
                        const Transform<frame::Base, frame::Tcp>& T_base_retreat) {
  pick.nearest = bin_.nearest(T_base_grasp);
  pick.grip = bin_.take(T_base_approach, T_base_grasp, T_base_retreat);
  return pick.grip->kind == GripResult::Kind::Taken;
}

void Run::finish_pick(std::uint16_t pick_id, const std::string& how, TimePoint now) {
  const Pick pick = picks_[pick_id];
  picks_.erase(pick_id);
  const bool ours = step_ == Step::Robot && picking_ == pick_id;
  if (ours) step_ = Step::Idle;
  next_request_ = now + options_.pause;
  ++done_;
  const PickVerdict verdict =
      judge({.result = pick.result, .read = pick.read, .nearest = pick.nearest, .grip = pick.grip, .how = how},
            options_.tolerance_mm, options_.tolerance_deg);
  if (verdict.right) ++right_;
  if (verdict.taken) ++taken_;
  if (pick.nearest) {
    worst_mm_ = std::max(worst_mm_, pick.nearest->error.centroid_mm);
    worst_deg_ = std::max(worst_deg_, Angle::rad(pick.nearest->error.angle_rad).in_deg());
  }
  say("pick %d: %s, %zu left %s", done_, verdict.line.c_str(), bin_.objects_left(),
      bin_.is_belt() ? "on the belt" : "in the bin");
  if (options_.cycles > 0 && done_ >= options_.cycles) return finish_as_counted();
  refill_when_low();
}

void Run::finish_as_counted() {
  const int failed = done_ - taken_, allowed = static_cast<int>(std::ceil(options_.failed_grips * done_));
  if (right_ < done_) return finish(1, "not all picks were good");
  if (failed == 0) return finish(0, "all picks good");
  finish(failed <= allowed ? 0 : 1, "all poses right, but the gripper failed at " + std::to_string(failed) + ", " +
                                        std::to_string(allowed) + " allowed");
}

void Run::refill_when_low() {
  if (bin_.is_belt()) return;  // it moves on after the answer "empty"
  if (options_.cycles > 0 && bin_.objects_left() < kObjectsMin) bin_.start_refill();
  if (options_.cycles == 0 && bin_.objects_left() == 0) bin_.start_refill();
}

void Run::tell_alarms() {
  const Plc& plc = plc_->device;
  const std::uint16_t total = plc.word(plc::at("alarms_total"));
  if (total == alarms_told_) return;
  alarms_told_ = total;
  for (const auto& text : plc::alarm_table())
    if (text.alarm == plc.last_alarm())
      say("PLC: alarm %u, %s: %s %s", static_cast<unsigned>(text.alarm), std::string(text.name).c_str(),
          std::string(text.cause).c_str(), std::string(text.cure).c_str());
}

void Run::read_commands(TimePoint now) {
  char chunk[512];
  const ssize_t n = ::read(STDIN_FILENO, chunk, sizeof chunk);
  if (n <= 0) return loop_.forget(STDIN_FILENO);
  typed_.append(chunk, static_cast<std::size_t>(n));
  for (std::size_t end = typed_.find('\n'); end != std::string::npos; end = typed_.find('\n')) {
    const std::string line = typed_.substr(0, end);
    typed_.erase(0, end + 1);
    if (line.find_first_not_of(" \t\r") != std::string::npos) on_line(line, now);
  }
  if (typed_.size() > 4096) typed_.clear();
}

void Run::on_line(const std::string& line, TimePoint now) {
  const auto command = parse_command(line);
  if (!command) return say("? %s", command.error().c_str());
  if (const auto* fault = std::get_if<FaultCommand>(&*command)) return obey(*fault);
  obey(std::get<Order>(*command).kind, now);
}

void Run::obey(const FaultCommand& command) {
  bool played = false;
  switch (command.device) {
    case Device::Pivot:
      played = pivot_ != nullptr;
      if (played) pivot_->with([&](Pivot& pivot) { command.apply(pivot.faults); }), pivot_->wake();
      break;
    case Device::Scanner:
      played = scanner_ != nullptr;
      if (played) command.apply(scanner_->faults());
      break;
    case Device::Robot:
      played = robot_ != nullptr;
      if (played) command.apply(robot_->device.faults);
      break;
    case Device::Poses:
      played = poses_ != nullptr;
      if (played) command.apply(poses_->faults());
      break;
    case Device::Plc:
      played = plc_ != nullptr;
      if (played) command.apply(plc_->device.faults);
      break;
  }
  if (played)
    say("now: %s", command.text.c_str());
  else
    say("? the %s is not played here", std::string(to_string(command.device)).c_str());
}

void Run::obey(Order::Kind order, TimePoint now) {
  const auto played = [&](bool here, Device device) {
    if (!here) say("? the %s is not played here", std::string(to_string(device)).c_str());
    return here;
  };
  switch (order) {
    case Order::Kind::Pick:
      if (!played(plc_ != nullptr, Device::Plc)) break;
      pick_wanted_ = true;
      if (step_ != Step::Idle)
        say("PLC: request %u is not done yet; a pick is asked for after it", plc_->device.sequence());
      else if (!plc_->device.ready())
        say("PLC: the cell is not ready (%04x); a pick is asked for as soon as it is", plc_->device.not_ready());
      break;
    case Order::Kind::Take:
      say(bin_.take_highest() ? "bin: the highest object is gone, %zu left" : "bin: nothing to take, %zu left",
          bin_.objects_left());
      break;
    case Order::Kind::Refill:
      bin_.start_refill();
      break;
    case Order::Kind::RobotRestart:
      if (played(robot_ != nullptr, Device::Robot)) robot_->device.restart_program(now);
      break;
    case Order::Kind::RobotStopOnPath:
      if (!played(poses_ != nullptr, Device::Poses)) break;
      robot_->device.stops_at = 0.5;
      robot_->device.tells_of_stop = false;
      break;
    case Order::Kind::PlcRestart:
      if (played(plc_ != nullptr, Device::Plc)) plc_->device.restart();
      break;
    case Order::Kind::PlcAbort:
      if (played(plc_ != nullptr, Device::Plc)) plc_->device.raise_abort();
      break;
    case Order::Kind::PlcReset:
      if (played(plc_ != nullptr, Device::Plc)) plc_->device.raise_reset();
      break;
    case Order::Kind::PivotPowerCycle:
      if (played(pivot_ != nullptr, Device::Pivot))
        pivot_->with([&](Pivot& pivot) { pivot.power_cycle(now); }), pivot_->wake();
      break;
    case Order::Kind::Status:
      say("%s", summary().c_str());
      if (plc_)
        say("PLC: %s, cell state %u, not ready because %04x",
            plc_->connected() ? "connected" : plc_->last_error().c_str(),
            static_cast<unsigned>(plc_->device.cell_state()), plc_->device.not_ready());
      if (robot_)
        say("robot: %s, %s", robot_->connected() ? "connected" : robot_->last_error().c_str(),
            robot_->device.clear_of_view() ? "clear of the view" : "in the view");
      if (pivot_) say("pivot: %.2f deg", pivot_->angle_at(now).in_deg());
      break;
    case Order::Kind::Help:
      say("%s", command_help().c_str());
      break;
    case Order::Kind::Quit:
      finish(options_.cycles == 0 ? 0 : 1, "ended by hand");
      break;
  }
}

std::string Run::summary() const {
  char text[256];
  std::snprintf(
      text, sizeof text,
      "%d picks, %d right (within %.1f mm and %.1f deg; worst %.1f mm, %.1f deg), %d taken, %d answers without a pick, "
      "%s %d times, %zu objects left",
      done_, right_, options_.tolerance_mm, options_.tolerance_deg, worst_mm_, worst_deg_, taken_, without_pick_,
      bin_.is_belt() ? "belt moved on" : "bin filled anew", refills_, bin_.objects_left());
  return text;
}

void Run::finish(int status, const std::string& why) {
  if (status_) return;
  status_ = status;
  say("%s: %s", why.c_str(), summary().c_str());
  if (status != 0 && plc_ && !plc_->connected())
    say("the PLC's connection to the daemon: %s", plc_->last_error().c_str());
}
}  // namespace binpick::emulators
