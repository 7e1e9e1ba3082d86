#include <algorithm>
#include <cstdio>
#include <gtest/gtest.h>
#include <string>
#include <string_view>
#include <vector>

#include "base/log.hpp"
#include "tests/emulators/program/scan_paths.hpp"
#include "tests/support/cell_file.hpp"
#include "tests/support/emulated_cell.hpp"
#include "tests/support/known_block.hpp"
#include "tests/support/scenes.hpp"

/// The robot carries the scanner: what it measures lies where it is, and what goes wrong on the way is an alarm with
/// its cure, after which the cell picks again.
namespace binpick::support {
namespace {
using emulators::kLinearPath;
using emulators::kPanPath;
using namespace std::chrono_literals;

CellFile carried(const std::string& robot, std::uint16_t path) {
  CellFile file;
  file.robot = robot;
  file.scan_path = path;
  file.scanner_latency_ms = 0.5e3 / 360;  // the emulated device sends a line when its mirror's turn is over
  return file;
}

/// The clock of a robot that was switched on eight hours ago, 37 ms apart from ours, and 50 ppm too fast since.
emulators::PoseClock worn_clock() {
  const TimePoint now{1h};  // of the emulated cell's start
  return {.drift_ppm = 50, .first_s = 0.037, .started = now - 8h};
}

BlockErrors scan_block(const CellFile& file) {
  EmulatedCell cell{test_folder().load(file), scene_with_block(), 9, worn_clock()};
  EXPECT_TRUE(cell.run_until_ready());
  EXPECT_TRUE(cell.pick().has_value());
  return errors_of_block(cell.last_image());
}

void print(const std::string& what, const BlockErrors& errors) {
  std::printf("%-44s floor %.2f mm, block's top %.2f mm, its middle %.2f mm\n", what.c_str(), errors.floor_mm,
              errors.top_mm, errors.centre_mm);
}

struct Carrying {
  const char* robot;
  std::uint16_t path;
};
struct TimeSync : testing::TestWithParam<Carrying> {};

/// In a scan, `share` of the path is run.
bool runs_on_path(EmulatedCell& cell) {
  cell.plc.raise_request(1, 1);
  const auto home = cell.robot.flange_at(cell.now()).iso;
  return cell.run_until(
      [&] { return (cell.robot.flange_at(cell.now()).iso.translation() - home.translation()).norm() > 200; });
}

struct Carried : testing::TestWithParam<const char*> {
  EmulatedCell cell{test_folder().load(coarse(GetParam())), scene_of("track_link", 4, 11), 11};

  static CellFile coarse(const std::string& robot) {
    CellFile file = coarse_cell();
    file.robot = robot;
    file.scan_path = kLinearPath;
    return file;
  }
  void SetUp() override { ASSERT_TRUE(cell.run_until_ready()); }

  void expect_fault(plc::Alarm alarm) {
    ASSERT_TRUE(cell.run_until([&] { return cell.plc.fault(); }));
    EXPECT_EQ(static_cast<plc::Alarm>(cell.plc.first_alarm()), alarm);
    EXPECT_FALSE(cell.plc.take_result().has_value());
  }
  void expect_next_pick() {
    cell.plc.raise_reset();
    ASSERT_TRUE(cell.run_until_ready());
    const auto result = cell.pick();
    ASSERT_TRUE(result.has_value());
    EXPECT_EQ(result->code, plc::ResultCode::PickFound);
  }
};
}  // namespace

TEST_P(TimeSync, PlanesOfAKnownBlockAreRightWithTheEstimateAndNotWithoutIt) {
  const auto [robot, path] = GetParam();
  const char* motion = path == kLinearPath ? "linearly at 250 mm/s" : "panning at 20 deg/s";
  CellFile file = carried(robot, path);
  const BlockErrors good = scan_block(file);
  print(std::string{robot} + ", " + motion, good);
  EXPECT_LT(good.floor_mm, 1.0);
  EXPECT_LT(good.top_mm, 1.0);
  // Panning, the point where the line meets the block's top runs at 0.6 m/s: 2 mm lie between two profiles.
  EXPECT_LT(good.centre_mm, path == kLinearPath ? 1.0 : 1.5);
  // As if the clocks' offset were not known. (Their drift of eight hours, 1.44 s, would leave the path altogether.)
  file.pose_latency_ms = 37;
  const BlockErrors without = scan_block(file);
  print("  without the estimate of the 37 ms", without);
  EXPECT_GT(without.centre_mm, 5.0);
  EXPECT_TRUE(path == kLinearPath || without.floor_mm > 3.0) << "moved straight, a plane is only shifted in itself";
}

INSTANTIATE_TEST_SUITE_P(Robots, TimeSync,
                         testing::Values(Carrying{"ur", kLinearPath}, Carrying{"ur", kPanPath},
                                         Carrying{"fanuc", kLinearPath}, Carrying{"kawasaki", kPanPath}),
                         [](const auto& one) {
                           return std::string{one.param.robot} + (one.param.path == kLinearPath ? "_linear" : "_pan");
                         });

TEST_P(Carried, APathThatIsTooFastToMeasureOnIsNoEmptySupply) {
  const auto& config = cell.cell().data().config;
  emulators::RobotOptions hasty{.dialect = config.robot.dialect,
                                .paths = emulators::scan_paths(config, config.supplies[0])};
  for (auto& [number, path] : hasty.paths) path.duration = 40ms;
  const auto on_grasp = cell.robot.on_grasp;
  cell.robot.faults.unplugged = true;
  cell.run_for(1s);
  cell.robot = emulators::Robot{hasty};
  cell.robot.on_grasp = on_grasp;
  ASSERT_TRUE(cell.run_until_ready());
  std::string log;
  log::set_sink([&](log::Level, std::string_view, std::string_view text) { log += text; });
  const auto result = cell.pick();
  log::set_sink({});
  ASSERT_TRUE(result.has_value());
  EXPECT_EQ(result->code, plc::ResultCode::NothingFound);
  EXPECT_NE(log.find("% of the supply was measured"), std::string::npos);
}

TEST_P(Carried, WhatIsWrongWithThePosesStandsInTheLogOnce) {
  std::vector<std::string> lines;
  cell.rtde.faults.silent = cell.pose_sender.faults.silent = true;
  log::set_sink([&](log::Level, std::string_view, std::string_view text) { lines.emplace_back(text); });
  cell.run_for(60s);
  log::set_sink({});
  // Once for the poses that cease; where we ask for them (RTDE), once more as nobody answers that.
  EXPECT_EQ(std::ranges::count_if(lines, [](const auto& line) { return line.starts_with("robot: pose"); }),
            GetParam() == std::string_view{"ur"} ? 2 : 1);
  EXPECT_FALSE(cell.plc.ready());
}

TEST_P(Carried, APathThatTheRobotBreaksOffIsAnAlarmAndTheNextOneAPick) {
  cell.robot.stops_at = 0.5;
  ASSERT_TRUE(runs_on_path(cell));
  expect_fault(plc::Alarm::RobotPathBroken);
  expect_next_pick();
}

TEST_P(Carried, APathThatStopsWithoutAWordIsAnAlarmAndNoHang) {
  cell.robot.stops_at = 0.5;
  cell.robot.tells_of_stop = false;
  ASSERT_TRUE(runs_on_path(cell));
  expect_fault(plc::Alarm::RobotPathBroken);
  cell.robot.restart_program(cell.now());
  expect_next_pick();
}

TEST_P(Carried, ARobotThatIsLostOnThePathIsAnAlarm) {
  ASSERT_TRUE(runs_on_path(cell));
  cell.robot.faults.unplugged = true;
  expect_fault(plc::Alarm::RobotLost);
  cell.robot.faults = {};
  expect_next_pick();
}

TEST_P(Carried, PosesThatAreLostInAScanAndComeBack) {
  ASSERT_TRUE(runs_on_path(cell));
  cell.rtde.cut();
  cell.pose_sender.cut();
  expect_fault(plc::Alarm::RobotPosesLost);
  expect_next_pick();
}

TEST_P(Carried, AScanWithHolesInItsPosesIsNoEmptySupply) {
  ASSERT_TRUE(runs_on_path(cell));
  // Each hole is too short for a lost source and too long to guess across.
  for (int i = 0; i < 5; ++i) {
    cell.rtde.faults.silent = cell.pose_sender.faults.silent = true;
    cell.run_for(200ms);
    cell.rtde.faults.silent = cell.pose_sender.faults.silent = false;
    cell.run_for(60ms);
  }
  expect_fault(plc::Alarm::RobotPosesLost);
  expect_next_pick();
}

TEST_P(Carried, WithoutPosesTheCellIsNotReadyAndSaysWho) {
  cell.rtde.faults.unplugged = cell.pose_sender.faults.unplugged = true;
  ASSERT_TRUE(cell.run_until([&] { return !cell.plc.ready(); }));
  EXPECT_NE(cell.plc.not_ready() & static_cast<unsigned>(plc::NotReady::Robot), 0U);
  cell.rtde.faults = cell.pose_sender.faults = {};
  EXPECT_TRUE(cell.run_until_ready());
}

INSTANTIATE_TEST_SUITE_P(Robots, Carried, testing::Values("ur", "fanuc", "kawasaki"),
                         [](const auto& one) { return std::string{one.param}; });
}  // namespace binpick::support
