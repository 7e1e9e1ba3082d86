#include "bench/production/bin_run.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <ctime>
#include <limits>
#include <numbers>
#include <set>

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

std::uint64_t pile_seed(std::uint64_t bin, std::uint64_t seed) { return seed * 1'000'003 + bin; }

/// One bin, one cell.
class BinRun {
 public:
  BinRun(const ProductionPart& part, std::shared_ptr<const daemon::CellData> data, std::uint64_t seed)
      : part_{part},
        recipe_{data->config.recipes.front().part},
        supply_{data->config.supplies.front()},
        symmetry_{data->knowledge_bases.front().symmetry()},
        radius_mm_{data->knowledge_bases.front().diameter_mm() / 2},
        data_{data},
        pile_{emulators::example_part(part.name), part.objects, part.supply_mm, seed},
        rules_{emulators::GripRules::of(pile_.part())},
        cell_{data_, pile_.world(), seed} {
    cell_.robot = emulators::Robot{robot_options(robot_model())};
    cell_.robot.on_grasp = [this](const drivers::robot::Pick& pick) { return close_gripper(pick); };
  }

  BinOutcome run(std::uint64_t number) {
    const double began_s = cpu_s();
    outcome_.bin.bin = number;
    outcome_.bin.objects = part_.objects;
    cell_.run_until_ready();
    int without_pick = 0;
    for (int request = 0; outcome_.bin.end.empty(); ++request) {
      RequestRecord record;
      record.bin = number;
      record.request = request;
      ask(record);
      outcome_.requests.push_back(record);
      without_pick = record.answer == "pick" ? 0 : without_pick + 1;
      if (record.answer == "empty" || without_pick == 2) outcome_.bin.end = record.answer;
      if (request > 2 * part_.objects) outcome_.bin.end = "given up";
    }
    outcome_.bin.left = static_cast<int>(pile_.world().objects().size());
    outcome_.bin.cpu_s = cpu_s() - began_s;
    outcome_.bin.takeable = with_free_grasp(pile_, known_cell(*data_, rules_));
    return std::move(outcome_);
  }

 private:
  void ask(RequestRecord& record) {
    record.left_before = static_cast<int>(pile_.world().objects().size());
    record_ = &record;
    const TimePoint asked = cell_.now();
    const std::uint64_t sweeps = cell_.sweeps();
    const auto result = cell_.pick();
    record.scan_s = in_s(cell_.now() - asked);
    record.scanned = cell_.sweeps() != sweeps;
    if (!cell_.results().empty()) {
      const auto& report = cell_.results().back().report;
      record.found = static_cast<int>(report.detections.size());
      record.hypotheses = report.hypotheses;
      record.detection_ms = report.time_ms;
      if (report.first) {
        record.first_ms = report.first->time_ms;
        record.first_hypotheses = report.first->hypotheses;
      }
    }
    record.answer = result              ? name_of(result->code)
                    : cell_.plc.fault() ? "alarm " + std::to_string(static_cast<int>(cell_.plc.last_alarm()))
                                        : "no answer";
    if (!result) {
      cell_.plc.raise_reset();
      cell_.run_until_ready();
    } else if (result->code == ResultCode::PickFound) {
      record.score = result->score;
      judge_pose({supply_.T_base_supply.inverse() * result->T_base_grasp}, record);
      const TimePoint answered = cell_.now();
      const std::uint64_t reports = cell_.robot.picks_done() + cell_.robot.picks_failed();
      cell_.run_until([&] { return cell_.robot.picks_done() + cell_.robot.picks_failed() > reports; }, 60s);
      record.robot_s = in_s(cell_.now() - answered);
    }
    record_ = nullptr;
  }

  /// The pose that was detected; where the answer is none of the last detection's grasps, the one that its nearest
  /// grasp stands for.
  void judge_pose(const TcpPose& T_supply_grasp, RequestRecord& record) const {
    std::vector<ObjectPose> poses;
    if (!cell_.results().empty()) {
      const auto& seen = cell_.results().back();
      for (const auto& reachable : seen.choice.reachable)
        if ((reachable.T_supply_grasp.iso.matrix() - T_supply_grasp.iso.matrix()).norm() < 0.1)
          poses.push_back(seen.report.detections[reachable.detection].T_supply_object);
    }
    if (poses.empty())
      for (const auto& grasp : recipe_.grasps) poses.push_back(T_supply_grasp * grasp.T_object_tcp.inverse());
    double least = std::numeric_limits<double>::infinity();
    for (const auto& object : pile_.world().objects())
      for (const ObjectPose& pose : poses) {
        const auto error = vision::pose_distance(pose.iso, object.T_supply_object.iso, symmetry_, radius_mm_);
        const double apart = error.centroid_mm + radius_mm_ * error.angle_rad;
        if (apart >= least) continue;
        least = apart;
        record.error_mm = error.centroid_mm;
        record.error_deg = error.angle_rad * 180 / std::numbers::pi;
      }
    record.wrong = !std::isfinite(least) || record.error_mm > part_.wrong_mm || record.error_deg > part_.wrong_deg;
  }

  bool close_gripper(const drivers::robot::Pick& pick) {
    const auto T_supply_base = supply_.T_base_supply.inverse();
    const GripResult result =
        emulators::grip(pile_, *recipe_.gripper, recipe_.grasps, symmetry_,
                        {T_supply_base * pick.T_base_approach, T_supply_base * pick.T_base_grasp}, rules_);
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
  const config::Part recipe_;
  const config::Supply supply_;
  const vision::Symmetry symmetry_;
  const double radius_mm_;
  const std::shared_ptr<const daemon::CellData> data_;
  LivingPile pile_;
  const emulators::GripRules rules_;
  support::EmulatedCell cell_;
  RequestRecord* record_ = nullptr;  // of the request that runs
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
                   std::uint64_t seed) {
  const double before_s = cpu_s();
  BinRun run{part, data, pile_seed(bin, seed)};
  const double filled_s = cpu_s() - before_s;
  BinOutcome outcome = run.run(bin);
  outcome.bin.cpu_s += filled_s;
  return outcome;
}
}  // namespace binpick::bench
