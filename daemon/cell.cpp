#include "daemon/cell.hpp"

#include <algorithm>
#include <cmath>

#include "base/check.hpp"
#include "base/log.hpp"

namespace binpick::daemon {
namespace {
/// Both name their values by the same numbers.
plc::Unreachable as_plc_reads(vision::Obstacle obstacle) {
  using vision::Obstacle;
  static_assert(static_cast<int>(plc::Unreachable::Tilt) == static_cast<int>(Obstacle::Tilt));
  static_assert(static_cast<int>(plc::Unreachable::GripperHitsPart) == static_cast<int>(Obstacle::Itself));
  static_assert(static_cast<int>(plc::Unreachable::Unmeasured) == static_cast<int>(Obstacle::Unmeasured));
  return static_cast<plc::Unreachable>(obstacle);
}
/// To the start of a sweep the pivot drives with this share of what the module can do.
constexpr double kPositioningShare = 0.4;
/// The alarm for lines that were not understood goes when there was none for so long.
constexpr Duration kBadLineStands = std::chrono::seconds(2);

plc::Options with_ids(const config::Config& config) {
  plc::Options options = config.plc;
  options.part_ids.clear();
  options.supply_ids.clear();
  options.awaits_robot_clear = config.carrier != config::Carrier::Robot;
  for (const auto& recipe : config.recipes) options.part_ids.push_back(recipe.id);
  for (const auto& supply : config.supplies) options.supply_ids.push_back(supply.id);
  return options;
}

std::optional<drivers::robot::PoseSource> poses_of(const config::Config& config) {
  if (config.carrier != config::Carrier::Robot) return std::nullopt;
  return drivers::robot::PoseSource{config.pose_options()};
}

/// Each start of the daemon has some thousand scan numbers and pick ids of its own before it meets those of the start
/// before: a report that a robot kept through our restart names no pick of today.
std::uint16_t numbers_before(std::uint16_t boot_count) { return static_cast<std::uint16_t>(boot_count * 4099U); }

std::uint16_t to_u16(double value) { return static_cast<std::uint16_t>(std::clamp(std::lround(value), 0L, 65535L)); }
}  // namespace

Cell::Cell(std::shared_ptr<const CellData> data, std::uint16_t boot_count)
    : started_with_{data->config},
      data_{std::move(data)},
      plc_{with_ids(data_->config), boot_count},
      pivot_{data_->config.pivot},
      scanner_{data_->config.scanner_options()},
      robot_{data_->config.robot},
      poses_{poses_of(data_->config)},
      pivot_carrier_{pivot_},
      robot_carrier_{poses_
                         ? std::make_optional<drivers::sweep::RobotCarrier>(robot_, *poses_, numbers_before(boot_count))
                         : std::nullopt},
      sweep_{carrier(), scanner_},
      boot_count_{boot_count},
      pick_id_{numbers_before(boot_count)} {
  robot_.withdraw(drivers::robot::NoPick::NotReady);
}

drivers::sweep::Carrier& Cell::carrier() {
  if (robot_carrier_) return *robot_carrier_;
  return pivot_carrier_;
}

void Cell::run(TimePoint now) {
  const auto due = [&](std::optional<TimePoint> at) { return at && *at <= now; };
  if (due(plc_.deadline())) plc_.on_deadline(now);
  if (due(pivot_.deadline())) pivot_.on_deadline(now);
  if (due(scanner_.deadline())) scanner_.on_deadline(now);
  if (due(robot_.deadline())) robot_.on_deadline(now);
  if (poses_ && due(poses_->deadline())) poses_->on_deadline(now);
  if (due(sweep_.deadline())) sweep_.on_deadline(now);
  // An event may cause others; a bound shows a ring of them as our error instead of a hang.
  int rounds = 0;
  while (drain(now)) BINPICK_CHECK(++rounds < 10'000);
  if (edited_ && state_ == CellState::Idle) put_in_force(now);
  watch_robot_lines(now);
  update_ready(now);
}

void Cell::watch_robot_lines(TimePoint now) {
  if (robot_.bad_lines() != robot_bad_lines_) {
    if (!robot_bad_since_)
      BINPICK_LOG(Warning, "robot",
                  "sends lines that are not understood; check its program against the one in the docs");
    robot_bad_lines_ = robot_.bad_lines();
    robot_bad_since_ = now;
    plc_.raise(plc::Alarm::RobotBadLine, now);
  } else if (robot_bad_since_ && now - *robot_bad_since_ > kBadLineStands) {
    robot_bad_since_.reset();
    plc_.clear(plc::Alarm::RobotBadLine, now);
  }
}

/// The PLC's handshake is ahead of us until its events are heard: what a device or the detection says for a cycle that
/// the PLC has aborted would count for its next one. So the PLC is always heard first.
bool Cell::hear_plc(TimePoint now) {
  bool any = false;
  while (auto event = plc_.take_event()) on(*event, now), any = true;
  return any;
}

bool Cell::drain(TimePoint now) {
  bool any = hear_plc(now);
  while (auto event = pivot_.take_event()) on(*event, now), any = true;
  while (auto event = scanner_.take_event()) on(*event, now), any = true;
  while (poses_) {
    const auto event = poses_->take_event();
    if (!event) break;
    on(*event, now);
    any = true;
  }
  while (auto event = sweep_.take_event()) on(*event, now), any = true;
  while (auto event = robot_.take_event()) on(*event, now), any = true;
  return any;
}

std::optional<TimePoint> Cell::deadline() const {
  return earlier(earlier(earlier(plc_.deadline(), pivot_.deadline()), earlier(scanner_.deadline(), robot_.deadline())),
                 earlier(sweep_.deadline(), poses_ ? poses_->deadline() : std::nullopt));
}

std::optional<DetectRequest> Cell::take_detect_request() { return std::exchange(detect_request_, std::nullopt); }

void Cell::on_detect_result(DetectResult result, TimePoint now) {
  hear_plc(now);
  if (result.cycle_id != cycle_id_ || state_ != CellState::Detecting) {
    BINPICK_LOG(Info, "cell", "late detection of cycle %llu dropped", static_cast<unsigned long long>(result.cycle_id));
    return;
  }
  if (!result.error.empty()) {
    cycle_alarm_ = plc::Alarm::VisionFailed;
    if (record_) record_->result = result;
    BINPICK_LOG(Error, "vision", "detection failed: %s; the scan is given up, ask again", result.error.c_str());
    apply(CellInput::DetectionFailed, now);
    return;
  }
  if (!result.not_located.empty()) {
    cycle_alarm_ = plc::Alarm::SupplyNotFound;
    if (record_) record_->result = result;
    BINPICK_LOG(Warning, "cell", "cycle %llu: %s", static_cast<unsigned long long>(cycle_id_),
                result.not_located.c_str());
    return apply(CellInput::DetectionFailed, now);
  }
  detect_result_ = std::move(result);
  apply(CellInput::DetectionDone, now);
}

void Cell::reload(std::shared_ptr<const CellData> data) { edited_ = std::move(data); }

void Cell::reload_refused(const std::vector<std::string>& findings, TimePoint now) {
  for (const auto& finding : findings) BINPICK_LOG(Error, "config", "%s", finding.c_str());
  BINPICK_LOG(Error, "config", "reload refused, %zu finding(s); the old configuration stays in force", findings.size());
  plc_.raise(plc::Alarm::ConfigurationRefused, now);
}

void Cell::put_in_force(TimePoint now) {
  const auto restart = config::needs_restart(started_with_, edited_->config);
  data_ = std::exchange(edited_, nullptr);
  plc_.reconfigure(with_ids(data_->config), now);
  plc_.clear(plc::Alarm::ConfigurationRefused, now);
  BINPICK_LOG(Notice, "config", "%s is in force", data_->config.path.c_str());
  if (restart.empty()) {
    plc_.clear(plc::Alarm::ConfigurationNeedsRestart, now);
    return;
  }
  std::string names;
  for (const auto& name : restart) names += (names.empty() ? "" : ", ") + name;
  BINPICK_LOG(Warning, "config", "changed, but in force only after a restart: %s", names.c_str());
  plc_.raise(plc::Alarm::ConfigurationNeedsRestart, now);
}

void Cell::shut_down(TimePoint now) {
  stopping_ = true;
  apply(CellInput::Cancelled, now);
  pivot_.stop(now);
  robot_.withdraw(drivers::robot::NoPick::NotReady);
  update_ready(now);
}

bool Cell::safe() const {
  return state_ == CellState::Idle && pivot_.state() != drivers::pivot::Session::State::Moving && plc_.told();
}

void Cell::update_ready(TimePoint now) {
  using plc::NotReady;
  unsigned reasons = 0;
  const auto pivot = pivot_.state();
  const auto scanner = scanner_.state();
  if (!robot_carrier_ && pivot != drivers::pivot::Session::State::Standing &&
      pivot != drivers::pivot::Session::State::Moving)
    reasons |= static_cast<unsigned>(NotReady::Pivot);
  if (scanner != drivers::scanner::State::Idle && scanner != drivers::scanner::State::Measuring)
    reasons |= static_cast<unsigned>(NotReady::Scanner);
  const bool poses_missing = poses_ && poses_->state() != drivers::robot::PoseState::Streaming;
  if ((!started_with_.robot_listen.empty() && !robot_.connected()) || poses_missing)
    reasons |= static_cast<unsigned>(NotReady::Robot);
  if (stopping_) reasons |= static_cast<unsigned>(NotReady::Stopping);
  plc_.set_not_ready(static_cast<std::uint16_t>(reasons), now);
}

void Cell::apply(CellInput input, TimePoint now) {
  const CellRow* row = find_row(kCellRows, state_, input);
  if (row == nullptr) return;
  state_ = row->to;
  switch (row->effect) {
    case CellEffect::None:
      break;
    case CellEffect::BeginSweep:
      begin_sweep(now);
      break;
    case CellEffect::StartDetection:
      start_detection(now);
      break;
    case CellEffect::Publish:
      publish(now);
      break;
    case CellEffect::FaultCycle:
      stop_cycle(now);
      plc_.fault(cycle_alarm_, now);
      end_record({.alarm = cycle_alarm_}, now);
      break;
    case CellEffect::StopQuietly:
      stop_cycle(now);
      end_record({}, now);
      break;
  }
}

void Cell::begin_sweep(TimePoint now) {
  const auto& supply = data_->config.supplies[supply_];
  picture_.emplace(data_, supply_, recipe_);
  if (record_) record_->scan.emplace();
  pivot_carrier_.set_latency(data_->config.pivot_latency);
  if (robot_carrier_) robot_carrier_->set_latency(data_->config.pose_latency);
  sweep_.begin({.motion = motion_over(supply), .scanner_latency = data_->config.scanner_latency}, now);
}

drivers::sweep::Motion Cell::motion_over(const config::Supply& supply) const {
  // The handshake's own deadline holds until the robot stands at the beginning.
  if (robot_carrier_)
    return drivers::sweep::RobotPath{supply.scan_path, data_->config.plc.scan_timeout, supply.path_timeout};
  const double positioning_speed_rad_s =
      std::max(supply.sweep_speed_rad_s, kPositioningShare * (module_ ? module_->velocity_max_rad_s : 0.0));
  return drivers::sweep::PivotSweep{supply.sweep_start, supply.sweep_end, supply.sweep_speed_rad_s,
                                    positioning_speed_rad_s};
}

void Cell::start_detection(TimePoint now) {
  last_profile_at_ = now;
  plc_.on_scan_done(now);
  BINPICK_LOG(Info, "cell", "cycle %llu: sweep of %.2f s, %zu profiles, %zu points; robot may enter",
              static_cast<unsigned long long>(cycle_id_), in_s(sweep_done_.duration), sweep_done_.profiles,
              picture_->points());
  detect_request_ = picture_->take_request(cycle_id_);
}

void Cell::publish(TimePoint now) {
  const auto& supply = data_->config.supplies[supply_];
  const bool new_scan = detect_result_.has_value();
  if (new_scan) memory_.keep(place(), *std::exchange(detect_result_, std::nullopt), last_profile_at_);
  const DetectResult& scan = memory_.scan(place());
  const auto pick = memory_.next(place(), data_->config.picks, now);
  if (!pick && scan.fill.measured < vision::kMeasuredMin)
    plc_.raise(plc::Alarm::ScannerBlind, now);
  else if (new_scan)
    plc_.clear(plc::Alarm::ScannerBlind, now);

  plc::PickResult answer;
  answer.part_id = request_.part_id;
  answer.fill_level_percent = to_u16(100 * scan.fill.share);
  if (new_scan) {
    answer.figures.sweep_ms = to_u16(in_ms(sweep_done_.duration));
    answer.figures.profiles = to_u16(static_cast<double>(sweep_done_.profiles));
    answer.figures.points = static_cast<std::uint32_t>(picture_->points());
    answer.figures.hypotheses = static_cast<std::uint32_t>(scan.report.hypotheses);
    answer.figures.detection_ms = to_u16(scan.report.time_ms);
  }
  const std::size_t found = scan.report.detections.size();
  if (new_scan && supply.locate) {
    const Eigen::Vector3d offset_mm = scan.place.T_said_found.translation();
    BINPICK_LOG(Info, "cell",
                "cycle %llu: the supply stands %.0f mm in x and %.0f mm in y beside its place, turned by %.1f deg",
                static_cast<unsigned long long>(cycle_id_), offset_mm.x(), offset_mm.y(),
                Angle::rad(scan.place.turn_rad).in_deg());
  }
  if (pick) {
    const auto& grasp = scan.choice.reachable[pick->reachable];
    pick_id_ = pick_id_ == 65535 ? 1 : static_cast<std::uint16_t>(pick_id_ + 1);
    answer.code = plc::ResultCode::PickFound;
    answer.pick_id = pick_id_;
    answer.objects_left = to_u16(static_cast<double>(pick->left));
    answer.score = scan.report.detections[grasp.detection].score;
    const Transform<frame::Base, frame::Supply> T_base_supply{supply.T_base_supply.iso * scan.place.T_said_found};
    answer.T_base_approach = T_base_supply * (pick->other ? grasp.other->T_supply_approach : grasp.T_supply_approach);
    answer.T_base_grasp = T_base_supply * (pick->other ? grasp.other->T_supply_grasp : grasp.T_supply_grasp);
    answer.T_base_retreat = T_base_supply * (pick->other ? grasp.other->T_supply_retreat : grasp.T_supply_retreat);
    memory_.answered(place(), *pick, pick_id_, data_->config.picks);
    unfetched_since_ = new_scan ? std::optional{last_profile_at_} : std::nullopt;
    if (pick->again)
      BINPICK_LOG(Info, "cell", "pick %u is a second try: a pick of object %zu failed before%s", pick_id_,
                  grasp.detection, pick->other ? "; by another grasp now" : "");
    if (grasp.is_aslant)
      BINPICK_LOG(Info, "cell", "pick %u is drawn out aslant: object %zu hangs in others", pick_id_, grasp.detection);
    robot_.offer({answer.pick_id, request_.sequence, request_.part_id, answer.objects_left, answer.T_base_approach,
                  answer.T_base_grasp, answer.T_base_retreat});
  } else {
    answer.objects_left = to_u16(static_cast<double>(found));
    answer.code = found > 0           ? plc::ResultCode::NotReachable
                  : scan.supply_empty ? plc::ResultCode::SupplyEmpty
                                      : plc::ResultCode::NothingFound;
    if (answer.code == plc::ResultCode::NotReachable)
      answer.unreachable = as_plc_reads(vision::main_obstacle(scan.choice));
    // The robot's codes for "no pick" are the PLC's result codes.
    robot_.withdraw(static_cast<drivers::robot::NoPick>(answer.code));
    tell_why_none(scan);
  }
  plc_.publish(answer, now);
  if (record_ && new_scan) record_->result = scan;
  if (record_ && !new_scan) record_->scan_of_cycle = scan.cycle_id;
  end_record({.code = answer.code,
              .pick_id = answer.pick_id,
              .reachable = pick ? std::optional{static_cast<std::uint32_t>(pick->reachable)} : std::nullopt},
             now);
  if (!new_scan) {
    BINPICK_LOG(Info, "cell", "cycle %llu: pick %u from the scan before, score %.2f",
                static_cast<unsigned long long>(cycle_id_), answer.pick_id, answer.score);
    return;
  }
  BINPICK_LOG(
      Info, "cell",
      "cycle %llu: result %u, pick %u, %zu found, score %.2f, %zu hypotheses, detection %.0f ms, last profile to "
      "answer %.0f ms",
      static_cast<unsigned long long>(cycle_id_), static_cast<unsigned>(answer.code), answer.pick_id, found,
      answer.score, scan.report.hypotheses, scan.report.time_ms, in_ms(now - last_profile_at_));
}

void Cell::tell_why_none(const DetectResult& scan) const {
  if (scan.fill.measured < vision::kMeasuredMin)
    BINPICK_LOG(Warning, "cell", "cycle %llu: only %.0f %% of the supply was measured; %s",
                static_cast<unsigned long long>(cycle_id_), 100 * scan.fill.measured,
                robot_carrier_
                    ? "let the robot say begin and end where its path does, and move slower"
                    : "clean the scanner's window, look at the sweep's angles and at what is dark or mirrors");
  for (const auto& unreachable : scan.choice.unreachable)
    BINPICK_LOG(Info, "cell", "object %zu is not reachable: %s", unreachable.detection, unreachable.reason.c_str());
  for (const std::string& line : memory_.passed_over(place())) BINPICK_LOG(Info, "cell", "%s", line.c_str());
}

void Cell::stop_cycle(TimePoint now) {
  sweep_.abort(now);
  memory_.forget_scans();
  // Only a move: a reference run would be broken off and put off for seconds, a faulted module would need one more
  // reset. A sweep has stopped its pivot by itself, in whatever state.
  if (pivot_.state() == drivers::pivot::Session::State::Moving) pivot_.stop(now);
  detect_request_.reset();
  detect_result_.reset();
  robot_.withdraw(drivers::robot::NoPick::Fault);
}

void Cell::device_failed(std::optional<Trouble>& standing, Trouble trouble, TimePoint now) {
  // A device that refuses is asked again every second, for days perhaps: the log has it once.
  if (!standing || standing->text != trouble.text) BINPICK_LOG(Warning, "cell", "%s", trouble.text.c_str());
  if (standing && standing->alarm != trouble.alarm) alarm_off(standing, now);
  standing = std::move(trouble);
  cycle_alarm_ = standing->alarm;
  plc_.raise(standing->alarm, now);
  apply(CellInput::DeviceLost, now);
}

void Cell::alarm_off(std::optional<Trouble>& standing, TimePoint now) {
  if (standing) plc_.clear(standing->alarm, now);
  standing.reset();
}

}  // namespace binpick::daemon
