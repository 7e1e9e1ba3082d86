#include "bench/production/bin_run.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <ctime>
#include <limits>
#include <numbers>
#include <set>
#include <stdexcept>

#include "bench/production/faulted_request.hpp"
#include "daemon/cycle/record_codec.hpp"
#include "daemon/record_ring.hpp"
#include "plc/alarms.hpp"
#include "tests/emulators/world/grip.hpp"
#include "tests/emulators/world/living_pile.hpp"
#include "tests/support/emulated_cell.hpp"

namespace binpick::bench {
namespace {
using namespace std::chrono_literals;
using emulators::GripResult;
using emulators::LivingPile;
using plc::ResultCode;
using ObjectPose = Transform<frame::Supply, frame::Object>;
using TcpPose = Transform<frame::Supply, frame::Tcp>;

constexpr int kControls = 8;  // scans with other noise that a wrong pose is looked for in

double cpu_s() {
  timespec now{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

std::string name_of(ResultCode code) {
  switch (code) {
    case ResultCode::PickFound:
      return "pick";
    case ResultCode::SupplyEmpty:
      return "empty";
    case ResultCode::NothingFound:
      return "nothing_found";
    case ResultCode::NotReachable:
      return "not_reachable";
    default:
      return "result " + std::to_string(static_cast<int>(code));
  }
}

Transform<frame::Supply, frame::Supply> as_transform(const Displacement& by) {
  return {Eigen::Translation3d{by.x_mm, by.y_mm, 0} *
          Eigen::AngleAxisd{by.turn_deg * std::numbers::pi / 180, Eigen::Vector3d::UnitZ()}};
}

std::uint64_t pile_seed(std::uint64_t bin, std::uint64_t seed) { return seed * 1'000'003 + bin; }

/// One bin, one cell.
class BinRun {
 public:
  BinRun(const ProductionPart& part, std::shared_ptr<const daemon::CellData> data, std::uint64_t seed,
         const BinTrials& trials)
      : part_{part},
        trials_{trials},
        seed_{seed},
        recipe_{data->config.recipes.front().part},
        supply_{data->config.supplies.front()},
        symmetry_{data->knowledge_bases.front().symmetry()},
        radius_mm_{data->knowledge_bases.front().diameter_mm() / 2},
        data_{data},
        pile_{emulators::example_part(part.name), part.objects, part.supply_mm, seed},
        rules_{emulators::GripRules::of(pile_.part())},
        T_said_stands_{as_transform(trials.displacement)},
        T_stands_base_{(supply_.T_base_supply * T_said_stands_).inverse()},
        cell_{data_, pile_.world(), seed} {
    cell_.T_said_stands = T_said_stands_;
    cell_.robot = emulators::Robot{robot_options(robot_model())};
    cell_.robot.on_grasp = [this](const drivers::robot::Pick& pick) { return close_gripper(pick); };
  }

  BinOutcome run(std::uint64_t number) {
    const double began_s = cpu_s();
    outcome_.bin.bin = number;
    daemon::RecordRing records{data_->config.record.dir + "/" + part_.name + "-" + std::to_string(number)};
    outcome_.bin.objects = part_.objects;
    cell_.run_until_ready();
    int without_pick = 0;
    for (int request = 0; outcome_.bin.end.empty(); ++request) {
      RequestRecord record;
      record.bin = number;
      record.request = request;
      ask(record);
      while (const auto left = cell_.cell().take_record()) keep(records, *left);
      outcome_.requests.push_back(record);
      if (!record.fault) {
        without_pick = record.answer == "pick" ? 0 : without_pick + 1;
        if (record.answer == "empty" || without_pick == 2) outcome_.bin.end = record.answer;
      }
      if (request > 2 * part_.objects) outcome_.bin.end = "given up";
    }
    outcome_.bin.left = static_cast<int>(pile_.world().objects().size());
    outcome_.bin.cpu_s = cpu_s() - began_s;
    outcome_.bin.takeable = with_free_grasp(pile_, known_cell(*data_, rules_));
    return std::move(outcome_);
  }

 private:
  /// The whole bin, whatever its size. Throws std::runtime_error.
  static void keep(daemon::RecordRing& records, const daemon::Record& record) {
    const auto kept = records.write(daemon::record_name(record.origin), daemon::encode(record),
                                    std::numeric_limits<std::uint64_t>::max());
    if (!kept) throw std::runtime_error(kept.error());
  }

  static std::string reasons(const daemon::DetectResult& seen) {
    std::string all;
    for (const auto& each : seen.choice.unreachable) all += (all.empty() ? "" : "; ") + each.reason;
    return all;
  }

  void ask(RequestRecord& record) {
    record.left_before = static_cast<int>(pile_.world().objects().size());
    record_ = &record;
    const TimePoint asked = cell_.now();
    const std::uint64_t sweeps = cell_.sweeps();
    asked_world_ = pile_.world();
    if (const auto planned = trials_.faults.at(trials_.requests_before + static_cast<std::uint64_t>(record.request)))
      ask_faulted(*planned, record);
    else
      ask_healthy(record);
    record.scanned = cell_.sweeps() != sweeps;
    if (record.scanned) scanned_world_ = asked_world_;
    record.scan_s = in_s(answered_ - asked);
    if (!cell_.results().empty()) {
      const auto& seen = cell_.results().back();
      record.found = static_cast<int>(seen.report.detections.size());
      record.hypotheses = seen.report.hypotheses;
      record.detection_ms = seen.report.time_ms;
      if (seen.report.first) {
        record.first_ms = seen.report.first->time_ms;
        record.first_hypotheses = seen.report.first->hypotheses;
      }
      if (supply_.locate && record.scanned) judge_place(seen, record);
      if (record.answer == "not_reachable") record.why = reasons(seen);
    }
    if (trials_.faults.every() > 0) find_cause(record);
    is_after_fault_ = record.fault && record.fault->reached;
    record_ = nullptr;
  }

  void ask_healthy(RequestRecord& record) {
    const auto result = cell_.pick();
    answered_ = cell_.now();
    take_answer(result, cell_.plc.fault() ? std::optional{cell_.plc.last_alarm()} : std::nullopt, record);
    if (!result) {
      cell_.plc.raise_reset();
      cell_.run_until_ready();
    } else if (result->code == ResultCode::PickFound) {
      const std::uint64_t reports = cell_.robot.picks_done() + cell_.robot.picks_failed();
      cell_.run_until([&] { return cell_.robot.picks_done() + cell_.robot.picks_failed() > reports; }, 60s);
      record.robot_s = in_s(cell_.now() - answered_);
    }
  }

  void ask_faulted(const PlannedFault& planned, RequestRecord& record) {
    const RobotModel robot = robot_model();
    const FaultedAnswer answer =
        ask_with_fault(cell_, planned, from_s(robot.approach_s + robot.grasp_s + robot.retreat_s));
    answered_ = cell_.now();
    record.fault = answer.fault;
    take_answer(answer.result, answer.alarm, record);
    if (!answer.fault.handshake_lost) return;
    cell_.plc.raise_abort();
    cell_.run_for(5s);
    cell_.plc.raise_reset();
    cell_.run_until_ready();
  }

  void take_answer(const std::optional<emulators::PlcResult>& result, std::optional<plc::Alarm> alarm,
                   RequestRecord& record) {
    record.answer = result  ? name_of(result->code)
                    : alarm ? "alarm " + std::to_string(static_cast<int>(*alarm))
                            : "no answer";
    if (!result || result->code != ResultCode::PickFound) return;
    record.score = result->score;
    const PoseError error = judge({T_stands_base_ * result->T_base_grasp}, asked_world_);
    record.error_mm = error.mm;
    record.error_deg = error.deg;
    record.wrong = error.is_wrong;
    if (error.is_wrong) wrong_poses_ = error.poses;
  }

  /// Where the object was taken to be, as the supply stands: what was detected; where the pose is none of the last
  /// detection's grasps, any that it may be a grasp of.
  std::vector<ObjectPose> poses_of(const TcpPose& T_supply_grasp) const {
    std::vector<ObjectPose> poses;
    if (!cell_.results().empty()) {
      const auto& seen = cell_.results().back();
      const Eigen::Isometry3d T_stands_found = T_said_stands_.iso.inverse() * seen.place.T_said_found;
      const auto is_sent = [&](const TcpPose& T_found_grasp) {
        return (T_stands_found.matrix() * T_found_grasp.iso.matrix() - T_supply_grasp.iso.matrix()).norm() < 0.1;
      };
      for (const auto& reachable : seen.choice.reachable)
        if (is_sent(reachable.T_supply_grasp) || (reachable.other && is_sent(reachable.other->T_supply_grasp)))
          poses.push_back({T_stands_found * seen.report.detections[reachable.detection].T_supply_object.iso});
    }
    if (poses.empty())
      for (const auto& grasp : recipe_.grasps) poses.push_back(T_supply_grasp * grasp.T_object_tcp.inverse());
    return poses;
  }

  struct PoseError {
    double mm = 0, deg = 0;
    bool is_wrong = true;
    std::vector<ObjectPose> poses;
  };
  PoseError judge(const TcpPose& T_supply_grasp, const emulators::World& world) const {
    PoseError error;
    error.poses = poses_of(T_supply_grasp);
    double least = std::numeric_limits<double>::infinity();
    for (const auto& object : world.objects())
      for (const ObjectPose& pose : error.poses) {
        const auto off = vision::pose_distance(pose.iso, object.T_supply_object.iso, symmetry_, radius_mm_);
        const double apart = off.centroid_mm + radius_mm_ * off.angle_rad;
        if (apart >= least) continue;
        least = apart;
        error.mm = off.centroid_mm;
        error.deg = off.angle_rad * 180 / std::numbers::pi;
      }
    error.is_wrong = !std::isfinite(least) || error.mm > part_.wrong_mm || error.deg > part_.wrong_deg;
    return error;
  }

  void judge_place(const daemon::DetectResult& seen, RequestRecord& record) const {
    if (!seen.not_located.empty()) return;
    const Eigen::Isometry3d off = T_said_stands_.iso.inverse() * seen.place.T_said_found;
    record.place_mm = off.translation().norm();
    record.place_deg = Eigen::AngleAxisd{off.linear()}.angle() * 180 / std::numbers::pi;
  }

  /// What is wrong at a fault or right after it is laid to the fault's account, unless scans of the same pile without
  /// any fault make the same mistake.
  void find_cause(RequestRecord& record) {
    const std::vector<ObjectPose> poses = std::exchange(wrong_poses_, {});
    const bool false_empty = record.answer == "empty" && record.left_before > 0;
    if (!is_after_fault_ && !(record.fault && record.fault->reached)) return;
    if (poses.empty() && !false_empty) return;
    record.cause = "fault";
    for (int control = 1; control <= kControls; ++control)
      if (is_mistaken_too(seed_ + 1000 + static_cast<std::uint64_t>(control), poses)) record.cause = "scene";
  }

  /// Without any fault, with another seed's noise: one of the poses is detected, or the supply is empty.
  bool is_mistaken_too(std::uint64_t seed, const std::vector<ObjectPose>& poses) const {
    support::EmulatedCell cell{data_, scanned_world_, seed};
    cell.T_said_stands = T_said_stands_;
    cell.run_until_ready();
    const auto answer = cell.pick();
    if (!answer || cell.results().empty()) return false;
    if (poses.empty()) return answer->code == ResultCode::SupplyEmpty;
    const auto& seen = cell.results().back();
    const Eigen::Isometry3d T_stands_found = T_said_stands_.iso.inverse() * seen.place.T_said_found;
    return std::ranges::any_of(seen.report.detections, [&](const vision::Detection& detection) {
      return std::ranges::any_of(poses, [&](const ObjectPose& pose) {
        const auto off =
            vision::pose_distance(pose.iso, T_stands_found * detection.T_supply_object.iso, symmetry_, radius_mm_);
        return off.centroid_mm <= part_.wrong_mm && off.angle_rad * 180 / std::numbers::pi <= part_.wrong_deg;
      });
    });
  }

  bool close_gripper(const drivers::robot::Pick& pick) {
    const TcpPose T_stands_grasp = T_stands_base_ * pick.T_base_grasp;
    if (trials_.faults.every() > 0 && record_ != nullptr) {
      // The robot may close at what the PLC never read, or at what it read long ago.
      const PoseError error = judge(T_stands_grasp, pile_.world());
      record_->closed_wrong = error.is_wrong;
      if (error.is_wrong) wrong_poses_ = error.poses;
    }
    const GripResult result = emulators::grip(
        pile_, *recipe_.gripper, recipe_.grasps, symmetry_,
        {T_stands_base_ * pick.T_base_approach, T_stands_grasp, T_stands_base_ * pick.T_base_retreat}, rules_);
    const bool is_taken = result.kind == GripResult::Kind::Taken;
    if (record_ != nullptr) {
      record_->grip = to_string(result.kind);
      record_->why = is_taken ? "" : to_string(result);
      record_->grasp = recipe_.grasps[result.grasp].name;
      record_->retry = failed_on_.contains(result.object);
    }
    if (!is_taken) {
      failed_on_.insert(result.object);
      return false;
    }
    pile_.take(result.object);
    cell_.world = pile_.world();
    return true;
  }

  const ProductionPart& part_;
  const BinTrials trials_;
  const std::uint64_t seed_;
  const config::Part recipe_;
  const config::Supply supply_;
  const vision::Symmetry symmetry_;
  const double radius_mm_;
  const std::shared_ptr<const daemon::CellData> data_;
  LivingPile pile_;
  const emulators::GripRules rules_;
  const Transform<frame::Supply, frame::Supply> T_said_stands_;
  const Transform<frame::Supply, frame::Base> T_stands_base_;
  support::EmulatedCell cell_;
  emulators::World asked_world_{pile_.world()};    // as it was when the request was raised
  emulators::World scanned_world_{pile_.world()};  // the same of the request that the last scan was made for
  TimePoint answered_{};
  bool is_after_fault_ = false;
  std::vector<ObjectPose> wrong_poses_;  // of the request that runs
  RequestRecord* record_ = nullptr;      // of the request that runs
  std::set<int> failed_on_;
  BinOutcome outcome_;
};
}  // namespace

KnownCell known_cell(const daemon::CellData& data, const emulators::GripRules& rules) {
  const config::Part& part = data.config.recipes.front().part;
  return {*part.gripper, part.grasps, data.knowledge_bases.front().symmetry(), data.config.reach.tilt_max_rad, rules};
}

int left_by_known_poses(const ProductionPart& part, const daemon::CellData& data, std::uint64_t bin, std::uint64_t seed,
                        std::vector<std::string>* reasons) {
  std::array<char, 120> text{};
  LivingPile pile{emulators::example_part(part.name), part.objects, part.supply_mm, pile_seed(bin, seed)};
  const KnownCell cell = known_cell(data, emulators::GripRules::of(pile.part()));
  const int left = empty_by_known_poses(pile, cell);
  for (const auto& object : pile.world().objects()) {
    const Eigen::Vector3d& t = object.T_supply_object.iso.translation();
    std::snprintf(text.data(), text.size(),
                  "bin %llu, object %d at (%.0f, %.0f, %.0f):", static_cast<unsigned long long>(bin), object.id, t.x(),
                  t.y(), t.z());
    if (reasons != nullptr) reasons->push_back(text.data());
    for (const std::string& reason : why_not(pile, object.id, cell))
      if (reasons != nullptr) reasons->push_back("  " + reason);
  }
  return left;
}

BinOutcome run_bin(const ProductionPart& part, const std::shared_ptr<const daemon::CellData>& data, std::uint64_t bin,
                   std::uint64_t seed, const BinTrials& trials) {
  const double before_s = cpu_s();
  BinRun run{part, data, pile_seed(bin, seed), trials};
  const double filled_s = cpu_s() - before_s;
  BinOutcome outcome = run.run(bin);
  outcome.bin.cpu_s += filled_s;
  return outcome;
}
}  // namespace binpick::bench
