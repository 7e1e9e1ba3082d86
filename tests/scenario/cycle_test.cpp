#include <algorithm>
#include <filesystem>
#include <fstream>
#include <gtest/gtest.h>

#include "plc/registers.hpp"
#include "tests/support/cell_file.hpp"
#include "tests/support/emulated_cell.hpp"
#include "tests/support/scenes.hpp"
#include "vision/fill_level.hpp"

namespace binpick::support {
namespace {
using namespace std::chrono_literals;

/// A make of robot and of PLC, and what the pivot speaks.
struct Makes {
  const char* word_order;
  const char* robot;
  const char* plc_role = "server";  ///< What the daemon is.
  const char* pivot = "powercube";
};

CellFile with(const Makes& makes) {
  CellFile file;
  file.word_order = makes.word_order;
  file.robot = makes.robot;
  file.plc_role = makes.plc_role;
  file.pivot = makes.pivot;
  return file;
}

/// Between two poses that should be the same: mm, and degrees.
std::pair<double, double> apart(const Eigen::Isometry3d& a, const Eigen::Isometry3d& b) {
  const Eigen::AngleAxisd turn{a.linear().transpose() * b.linear()};
  return {(a.translation() - b.translation()).norm(), Angle::rad(turn.angle()).in_deg()};
}

constexpr std::uint16_t kClear = plc::control::kRobotClear;

struct WholePick : testing::TestWithParam<Makes> {};
}  // namespace

TEST_P(WholePick, FromThePlcsRequestToTheRobotsReport) {
  EmulatedCell cell{test_folder().load(with(GetParam())), scene_of("track_link", 4, 11), 11};
  std::optional<drivers::robot::Pick> grasped;
  cell.robot.on_grasp = [&](const drivers::robot::Pick& pick) {
    grasped = pick;
    return true;
  };
  ASSERT_TRUE(cell.run_until_ready());
  EXPECT_EQ(cell.plc.map_problem(), "");
  const auto result = cell.pick();
  ASSERT_TRUE(result.has_value());
  EXPECT_EQ(result->code, plc::ResultCode::PickFound);
  EXPECT_GT(result->figures.profiles, 200);
  EXPECT_GT(result->figures.points, 10'000U);
  EXPECT_GT(result->figures.hypotheses, 0U);
  EXPECT_GE(result->score, 0.5F);

  // The robot reads the same pick under the same id, and takes it.
  ASSERT_TRUE(cell.run_until([&] { return cell.robot.picks_done() == 1; }));
  ASSERT_TRUE(grasped.has_value());
  EXPECT_EQ(grasped->pick_id, result->pick_id);
  EXPECT_EQ(grasped->sequence, result->sequence);
  for (const auto& [at_robot, at_plc] : {std::pair{grasped->T_base_grasp.iso, result->T_base_grasp.iso},
                                         {grasped->T_base_approach.iso, result->T_base_approach.iso},
                                         {grasped->T_base_retreat.iso, result->T_base_retreat.iso}}) {
    const auto [mm, deg] = apart(at_robot, at_plc);
    EXPECT_LT(mm, 0.01);
    EXPECT_LT(deg, 0.001);
  }

  // And the pose is right: the detection that it came from lies on one of the objects.
  ASSERT_FALSE(cell.results().empty());
  const auto& seen = cell.results().back();
  const auto& chosen = seen.report.detections[seen.choice.reachable.front().detection];
  const auto error = error_to_nearest(cell.world, cell.cell().data().knowledge_bases.front(), chosen.T_supply_object);
  EXPECT_LT(error.centroid_mm, 5.0);
  EXPECT_LT(Angle::rad(error.angle_rad).in_deg(), 3.0);

  // The arm stands where that detection has the grasp, and so within the same tolerance of an object.
  const auto& data = cell.cell().data();
  const auto T_supply_grasp = data.config.supplies.front().T_base_supply.inverse() * grasped->T_base_grasp;
  const auto [mm, deg] = apart(T_supply_grasp.iso, seen.choice.reachable.front().T_supply_grasp.iso);
  EXPECT_LT(mm, 0.01);
  EXPECT_LT(deg, 0.001);
  const auto T_supply_retreat = data.config.supplies.front().T_base_supply.inverse() * grasped->T_base_retreat;
  const auto [off_mm, off_deg] = apart(T_supply_retreat.iso, seen.choice.reachable.front().T_supply_retreat.iso);
  EXPECT_LT(off_mm, 0.01);
  EXPECT_LT(off_deg, 0.001);
  EXPECT_GT(apart(grasped->T_base_retreat.iso, grasped->T_base_grasp.iso).first, 10) << "it is a way to go";
}
INSTANTIATE_TEST_SUITE_P(EachMake, WholePick,
                         testing::Values(Makes{"s7", "ur"}, Makes{"logix", "ur"}, Makes{"s7", "fanuc"},
                                         Makes{"logix", "kawasaki"}, Makes{"s7", "ur", "client"},
                                         Makes{"logix", "fanuc", "client"}, Makes{"s7", "ur", "server", "motion"}),
                         [](const auto& each) {
                           return std::string(each.param.word_order) + "_" + each.param.robot + "_" +
                                  each.param.plc_role + "_" + each.param.pivot;
                         });

TEST(Cycle, AScannerThatFallsSilentJustBeforeTheEndIsAFaultNotAnEmptySupply) {
  EmulatedCell cell{test_folder().load(coarse_cell()), empty_scene()};
  ASSERT_TRUE(cell.run_until_ready());
  const auto whole = cell.pick();
  ASSERT_TRUE(whole.has_value());
  ASSERT_EQ(whole->code, plc::ResultCode::SupplyEmpty);
  ASSERT_TRUE(cell.run_until_ready());

  // Too short a silence to be noticed while measuring (scanner.profile_timeout_ms), yet a strip that nobody looked at.
  cell.plc.forget_alarms_seen();
  cell.plc.raise_request(1, 1);
  ASSERT_TRUE(cell.run_until([&] { return cell.cell().sweep_state() == drivers::sweep::State::Sweeping; }));
  cell.run_for(std::chrono::milliseconds(whole->figures.sweep_ms) - 250ms);
  cell.scanner.faults.silent = true;
  ASSERT_TRUE(cell.run_until([&] { return cell.plc.fault() || cell.plc.result_valid(); }, 8s));
  EXPECT_TRUE(cell.plc.fault());
  EXPECT_FALSE(cell.plc.result_valid());
  EXPECT_NE(std::ranges::find(cell.plc.alarms_seen(), plc::Alarm::ScannerNoReply), cell.plc.alarms_seen().end());

  cell.run_for(2s);  // until the unanswered stop is given up
  cell.scanner.faults = {};
  cell.plc.raise_reset();
  ASSERT_TRUE(cell.run_until_ready());
  const auto again = cell.pick();
  ASSERT_TRUE(again.has_value());
  EXPECT_EQ(again->code, plc::ResultCode::SupplyEmpty);
}

TEST(Cycle, AnEmptySupplyIsEmptyAForeignPartIsNothingFoundASteepOneIsNotReachable) {
  {
    EmulatedCell cell{test_folder().load({}), empty_scene()};
    ASSERT_TRUE(cell.run_until_ready());
    const auto result = cell.pick();
    ASSERT_TRUE(result.has_value());
    EXPECT_EQ(result->code, plc::ResultCode::SupplyEmpty);
    EXPECT_EQ(result->pick_id, 0);
    ASSERT_TRUE(cell.run_until_ready());
  }
  {
    EmulatedCell cell{test_folder().load({}), scene_with_block()};
    ASSERT_TRUE(cell.run_until_ready());
    const auto result = cell.pick();
    ASSERT_TRUE(result.has_value());
    EXPECT_EQ(result->code, plc::ResultCode::NothingFound);
  }
  {
    CellFile file;
    file.tilt_max_deg = 1;  // nothing in a pile lies so straight
    EmulatedCell cell{test_folder().load(file), scene_of("track_link", 2, 3)};
    ASSERT_TRUE(cell.run_until_ready());
    const auto result = cell.pick();
    ASSERT_TRUE(result.has_value());
    EXPECT_EQ(result->code, plc::ResultCode::NotReachable);
    EXPECT_GE(result->objects_left, 1);
  }
}

TEST(Cycle, AScannerThatSeesHardlyAnythingIsAnAlarmUntilTheNextGoodScan) {
  emulators::World world = scene_of("track_link", 3, 2);
  Transform<frame::Supply, frame::Object> T_supply_lid;
  T_supply_lid.iso.translation() = Eigen::Vector3d{0, 0, 530};
  const auto lid = std::make_shared<const emulators::RayMesh>(emulators::box_mesh({1300, 1100, 2}));
  const int soot = world.add("lid", lid, T_supply_lid, 0.0005);  // gives no light back
  EmulatedCell cell{test_folder().load(coarse_cell()), std::move(world)};
  ASSERT_TRUE(cell.run_until_ready());
  auto result = cell.pick();
  ASSERT_TRUE(result.has_value());
  EXPECT_EQ(result->code, plc::ResultCode::NothingFound);
  EXPECT_LT(cell.results().back().fill.measured, vision::kMeasuredMin);
  EXPECT_EQ(cell.plc.alarms(), std::vector{plc::Alarm::ScannerBlind});
  EXPECT_TRUE(cell.plc.ready() || cell.run_until_ready()) << "the PLC may go on asking";

  ASSERT_TRUE(cell.world.remove(soot));
  result = cell.pick();
  ASSERT_TRUE(result.has_value());
  EXPECT_EQ(result->code, plc::ResultCode::PickFound);
  EXPECT_TRUE(cell.run_until([&] { return !cell.plc.alarm_active(); }, 1s));
}

TEST(Cycle, NoSweepWhileTheRobotIsInTheView) {
  EmulatedCell cell{test_folder().load({}), scene_of("track_link", 2, 3)};
  ASSERT_TRUE(cell.run_until_ready());
  cell.robot_in_the_way = true;
  cell.run_for(200ms);
  const Angle before = cell.pivot.angle_at(cell.now());
  cell.plc.raise_request(1, 1);
  cell.run_for(4s);
  EXPECT_EQ(cell.pivot.angle_at(cell.now()), before);
  EXPECT_TRUE(cell.plc.busy());
  cell.robot_in_the_way = false;
  EXPECT_TRUE(cell.run_until([&] { return cell.plc.last_result().has_value(); }));
  EXPECT_EQ(cell.plc.last_result()->code, plc::ResultCode::PickFound);
}

TEST(Cycle, ARobotThatEntersTheViewStopsTheSweep) {
  EmulatedCell cell{test_folder().load({}), scene_of("track_link", 2, 3)};
  ASSERT_TRUE(cell.run_until_ready());
  cell.plc.raise_request(1, 1);
  ASSERT_TRUE(cell.run_until([&] { return cell.cell().sweep_state() == drivers::sweep::State::Sweeping; }));
  cell.robot_in_the_way = true;
  ASSERT_TRUE(cell.run_until([&] { return cell.plc.fault(); }, 1s));
  cell.run_for(300ms);
  EXPECT_FALSE(cell.pivot.moving(cell.now()));
  EXPECT_TRUE(cell.plc.alarms_seen().contains(plc::Alarm::RobotNotClear));
}

TEST(Cycle, AbortInEachStateStopsThePivotAndLeavesNothingValid) {
  using daemon::CellState;
  for (const auto state : {CellState::AwaitingClear, CellState::Sweeping, CellState::Detecting}) {
    EmulatedCell cell{test_folder().load({}), scene_of("track_link", 2, 3)};
    ASSERT_TRUE(cell.run_until_ready());
    cell.robot_in_the_way = state == CellState::AwaitingClear;
    cell.run_for(200ms);
    cell.plc.raise_request(1, 1);
    ASSERT_TRUE(cell.run_until([&] { return cell.cell().state() == state; }));
    cell.robot_in_the_way = false;
    cell.plc.raise_abort();
    ASSERT_TRUE(cell.run_until([&] { return cell.cell().state() == CellState::Idle; }, 1s));
    cell.run_for(500ms);
    EXPECT_FALSE(cell.pivot.moving(cell.now()));
    EXPECT_FALSE(cell.plc.result_valid());
    ASSERT_TRUE(cell.run_until_ready(3s));
    const auto result = cell.pick();
    ASSERT_TRUE(result.has_value());
    EXPECT_EQ(result->code, plc::ResultCode::PickFound);
  }
}

TEST(Cycle, AnAbortThatComesWithTheDetectionsResultLeavesNoPickForTheRobot) {
  EmulatedCell cell{test_folder().load(coarse_cell()), scene_of("track_link", 2, 3)};
  ASSERT_TRUE(cell.run_until_ready());
  cell.plc.raise_request(1, 1);
  ASSERT_TRUE(cell.run_until([&] { return cell.cell().state() == daemon::CellState::Detecting; }));
  cell.plc_writes(plc::at("control"), plc::control::kAbort | kClear);
  cell.cell().on_detect_result(cell.results().back(), cell.now());
  cell.run_for(5s);
  EXPECT_EQ(cell.cell().state(), daemon::CellState::Idle);
  EXPECT_EQ(cell.robot.picks_done(), 0U);
}

TEST(Cycle, TheResultOfAnAbortedRequestIsNotTheAnswerToTheNextOne) {
  EmulatedCell cell{test_folder().load(coarse_cell()), scene_of("track_link", 2, 3)};
  ASSERT_TRUE(cell.run_until_ready());
  cell.plc.raise_request(1, 1);
  ASSERT_TRUE(cell.run_until([&] { return cell.cell().state() == daemon::CellState::Detecting; }));
  cell.plc_writes(plc::at("control"), plc::control::kAbort | kClear);
  cell.plc_writes(plc::at("control"), kClear);
  cell.plc_writes(plc::at("sequence"), 99);
  cell.plc_writes(plc::at("control"), plc::control::kRequest | kClear);
  cell.cell().on_detect_result(cell.results().back(), cell.now());
  cell.cell().run(cell.now());
  EXPECT_EQ(cell.cell().plc().state(), plc::State::Scanning);
  EXPECT_EQ(cell.cell().state(), daemon::CellState::Sweeping);
}

TEST(Cycle, AnAbortAfterTheResultTakesThePickFromTheRobotToo) {
  EmulatedCell cell{test_folder().load(coarse_cell()), scene_of("track_link", 2, 3)};
  ASSERT_TRUE(cell.run_until_ready());
  cell.plc.hold_ack = true;
  cell.plc.raise_request(1, 1);
  ASSERT_TRUE(cell.run_until([&] { return cell.cell().state() == daemon::CellState::Detecting; }));
  cell.robot.faults.unplugged = true;
  ASSERT_TRUE(cell.run_until([&] { return cell.plc.result_valid(); }));
  cell.plc.raise_abort();
  ASSERT_TRUE(cell.run_until([&] { return !cell.plc.result_valid(); }, 1s));
  cell.robot.faults.unplugged = false;
  cell.run_for(5s);
  EXPECT_EQ(cell.robot.picks_done(), 0U);
}

TEST(Cycle, AHungVisionWorkerIsATimeOutAndItsLateResultIsDropped) {
  EmulatedCell cell{test_folder().load({}), scene_of("track_link", 2, 3)};
  ASSERT_TRUE(cell.run_until_ready());
  cell.worker_hangs = true;
  cell.plc.raise_request(1, 1);
  ASSERT_TRUE(cell.run_until([&] { return cell.plc.fault(); }, 20s));
  EXPECT_TRUE(cell.plc.alarms_seen().contains(plc::Alarm::DetectTimeout));
  cell.worker_hangs = false;  // the late result comes now
  cell.run_for(1s);
  EXPECT_FALSE(cell.plc.result_valid());
  cell.plc.raise_reset();
  ASSERT_TRUE(cell.run_until_ready(3s));
  const auto result = cell.pick();
  ASSERT_TRUE(result.has_value());
  EXPECT_EQ(result->code, plc::ResultCode::PickFound);
}

TEST(Cycle, PickAfterPickUntilTheSupplyIsEmpty) {
  EmulatedCell cell{test_folder().load({}), scene_of("track_link", 3, 21), 21};
  cell.robot.on_grasp = [&](const drivers::robot::Pick& pick) {
    return take_nearest(cell.world, cell.cell().data(), pick);
  };
  ASSERT_TRUE(cell.run_until_ready());
  for (int n = 0; n < 3; ++n) {
    const auto result = cell.pick();
    ASSERT_TRUE(result.has_value());
    ASSERT_EQ(result->code, plc::ResultCode::PickFound) << "pick " << n;
    const auto done = static_cast<std::uint64_t>(n) + 1;
    ASSERT_TRUE(cell.run_until([&] { return cell.robot.picks_done() == done && cell.robot.clear_of_view(); }));
  }
  const auto last = cell.pick();
  ASSERT_TRUE(last.has_value());
  EXPECT_EQ(last->code, plc::ResultCode::SupplyEmpty);
  EXPECT_EQ(cell.robot.picks_failed(), 0U);
}
TEST(Cycle, ASweepBeyondTheModulesLimitsIsAnAlarmAndNoAnswerFromHalfAScan) {
  EmulatedCell cell{test_folder().load(coarse_cell()), scene_of("track_link", 3, 2)};
  cell.pivot.limit_to(Angle::deg(-8), Angle::deg(8));
  ASSERT_TRUE(cell.run_until_ready());
  cell.plc.raise_request(1, 1);
  ASSERT_TRUE(cell.run_until([&] { return cell.plc.fault(); }));
  EXPECT_TRUE(cell.plc.alarms_seen().contains(plc::Alarm::PivotModuleError));
  EXPECT_FALSE(cell.plc.result_valid());
  EXPECT_FALSE(cell.pivot.moving(cell.now()));
}
}  // namespace binpick::support
