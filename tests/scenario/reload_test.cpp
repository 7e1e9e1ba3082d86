#include <fstream>
#include <gtest/gtest.h>
#include <string>

#include "base/log.hpp"
#include "tests/support/cell_file.hpp"
#include "tests/support/emulated_cell.hpp"
#include "tests/support/scenes.hpp"

namespace binpick::support {
namespace {
using namespace std::chrono_literals;
}

TEST(Reload, AGoodEditIsInForceAtTheNextCycleAndNotInTheRunningOne) {
  EmulatedCell cell{test_folder().load({}), scene_of("track_link", 2, 3)};
  ASSERT_TRUE(cell.run_until_ready());
  cell.plc.raise_request(1, 1);
  ASSERT_TRUE(cell.run_until([&] { return cell.cell().sweep_state() == drivers::sweep::State::Sweeping; }));
  CellFile edited;
  edited.tilt_max_deg = 1;  // nothing lies so straight
  cell.cell().reload(test_folder().load(edited));
  std::optional<emulators::PlcResult> result;
  ASSERT_TRUE(cell.run_until([&] { return (result = cell.plc.take_result()).has_value(); }));
  EXPECT_EQ(result->code, plc::ResultCode::PickFound) << "the running cycle keeps what it began with";
  ASSERT_TRUE(cell.run_until([&] { return cell.robot.picks_done() == 1 && cell.plc.ready(); }));
  result = cell.pick();
  ASSERT_TRUE(result.has_value());
  EXPECT_EQ(result->code, plc::ResultCode::NotReachable);
  EXPECT_TRUE(cell.plc.alarms().empty());
}

TEST(Reload, ABadEditLeavesAnAlarmAndTheOldConfigurationInForce) {
  EmulatedCell cell{test_folder().load({}), scene_of("track_link", 2, 3)};
  ASSERT_TRUE(cell.run_until_ready());
  cell.plc.raise_request(1, 1);
  ASSERT_TRUE(cell.run_until([&] { return cell.cell().sweep_state() == drivers::sweep::State::Sweeping; }));
  const std::string path = test_folder().path() + "/bad.toml";
  std::ofstream(path) << to_toml({}) << "\n[reach]\ntilt_max_degree = 3\n";
  const auto edited = daemon::load_cell(path);
  ASSERT_FALSE(edited.has_value());
  cell.cell().reload_refused(edited.error(), cell.now());
  std::optional<emulators::PlcResult> result;
  ASSERT_TRUE(cell.run_until([&] { return (result = cell.plc.take_result()).has_value(); }));
  EXPECT_EQ(result->code, plc::ResultCode::PickFound);
  EXPECT_TRUE(cell.plc.alarms_seen().contains(plc::Alarm::ConfigurationRefused));
  // A good one takes the alarm back.
  ASSERT_TRUE(cell.run_until_ready());
  cell.cell().reload(test_folder().load({}));
  EXPECT_TRUE(cell.run_until([&] { return !cell.plc.alarm_active(); }, 2s));
}

TEST(Reload, WhatNeedsARestartIsSaidByName) {
  EmulatedCell cell{test_folder().load({}), empty_scene()};
  ASSERT_TRUE(cell.run_until_ready());
  CellFile edited;
  edited.plc_port = 1503;
  std::string log;
  log::set_sink([&](log::Level, std::string_view, std::string_view text) { log.append(text).append("\n"); });
  cell.cell().reload(test_folder().load(edited));
  cell.run_for(1ms);
  log::set_sink({});
  EXPECT_NE(log.find("plc.listen"), std::string::npos) << log;
  EXPECT_TRUE(
      cell.run_until([&] { return cell.plc.alarms_seen().contains(plc::Alarm::ConfigurationNeedsRestart); }, 2s));
  EXPECT_TRUE(cell.plc.ready());
  // A second reload of the same file changes nothing: the port is still the old one, so it still stands.
  cell.cell().reload(test_folder().load(edited));
  cell.run_for(1s);
  EXPECT_TRUE(cell.plc.alarm_active());
  EXPECT_EQ(cell.plc.alarms(), std::vector{plc::Alarm::ConfigurationNeedsRestart});
  // Back to what it was started with: nothing waits for a restart any more.
  cell.cell().reload(test_folder().load({}));
  EXPECT_TRUE(cell.run_until([&] { return !cell.plc.alarm_active(); }, 2s));
}

TEST(Reload, ARobotsSocketThatOnlyARestartOpensIsNotWaitedFor) {
  CellFile file = coarse_cell();
  file.robot_port = 0;  // none: the PLC forwards the movement
  EmulatedCell cell{test_folder().load(file), empty_scene()};
  cell.robot.faults.unplugged = true;
  ASSERT_TRUE(cell.run_until_ready());
  file.robot_port = 5002;
  cell.cell().reload(test_folder().load(file));
  cell.run_for(1s);
  EXPECT_TRUE(cell.plc.alarms_seen().contains(plc::Alarm::ConfigurationNeedsRestart));
  EXPECT_TRUE(cell.plc.ready()) << "not_ready " << cell.plc.not_ready();
}
}  // namespace binpick::support
