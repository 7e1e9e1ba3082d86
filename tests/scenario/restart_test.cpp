#include <gtest/gtest.h>

#include "plc/registers.hpp"
#include "tests/support/cell_file.hpp"
#include "tests/support/emulated_cell.hpp"
#include "tests/support/scenes.hpp"

namespace binpick::support {
namespace {
using namespace std::chrono_literals;
}

TEST(Restart, ThePivotStopsByItselfWhenTheDaemonVanishesInASweep) {
  const auto data = test_folder().load({});
  EmulatedCell cell{data, scene_of("track_link", 2, 3)};
  ASSERT_TRUE(cell.run_until_ready());
  const auto first = cell.pick();
  ASSERT_TRUE(first && first->pick_id != 0);
  ASSERT_TRUE(cell.run_until_ready());
  const auto boot = cell.plc.boot_count();
  cell.plc.raise_request(1, 1);
  ASSERT_TRUE(cell.run_until([&] { return cell.cell().sweep_state() == drivers::sweep::State::Sweeping; }));
  cell.run_for(300ms);
  ASSERT_TRUE(cell.pivot.moving(cell.now()));
  cell.kill_daemon();
  cell.run_for(data->config.pivot.setpoint_horizon + 100ms);
  EXPECT_FALSE(cell.pivot.moving(cell.now()));

  cell.start_daemon();
  ASSERT_TRUE(cell.run_until([&] { return cell.plc.boot_count() != boot && cell.plc.boot_count() != 0; }));
  EXPECT_FALSE(cell.plc.result_valid());
  ASSERT_TRUE(cell.run_until_ready());
  const auto result = cell.pick();
  ASSERT_TRUE(result.has_value());
  EXPECT_EQ(result->code, plc::ResultCode::PickFound);
  EXPECT_NE(result->pick_id, first->pick_id) << "a report of the first one would count for this one";
}

TEST(Restart, APlcThatIsPolledMeetsTheNewDaemonAndABrokenLineLosesNoPick) {
  CellFile file;
  file.plc_role = "client";
  EmulatedCell cell{test_folder().load(file), scene_of("track_link", 2, 3)};
  ASSERT_TRUE(cell.run_until_ready());
  const auto boot = cell.plc.boot_count();
  cell.plc.raise_request(1, 1);
  ASSERT_TRUE(cell.run_until([&] { return cell.cell().sweep_state() == drivers::sweep::State::Sweeping; }));
  cell.kill_daemon();
  cell.run_for(1s);
  EXPECT_TRUE(cell.plc.busy()) << "the registers are the PLC's: they stay as they were";
  const auto sweeps = cell.sweeps();
  cell.start_daemon();
  ASSERT_TRUE(cell.run_until([&] { return cell.plc.boot_count() != boot; }));
  EXPECT_FALSE(cell.plc.result_valid() || cell.plc.busy());
  ASSERT_TRUE(cell.run_until_ready());
  EXPECT_EQ(cell.sweeps(), sweeps) << "what was asked of the old one is not carried out";

  cell.plc.raise_request(1, 1);
  ASSERT_TRUE(cell.run_until([&] { return cell.cell().sweep_state() == drivers::sweep::State::Sweeping; }));
  cell.plc.faults.unplugged = true;
  cell.run_for(1s);
  cell.plc.faults = {};
  std::optional<emulators::PlcResult> result;
  ASSERT_TRUE(cell.run_until([&] { return (result = cell.plc.take_result()).has_value(); }));
  EXPECT_EQ(result->code, plc::ResultCode::PickFound);
  EXPECT_EQ(cell.sweeps(), sweeps + 1);
  EXPECT_EQ(cell.plc.torn_reads(), 0U);
}

TEST(Restart, ARequestThatStandsAtTheStartIsNotExecuted) {
  EmulatedCell cell{test_folder().load({}), scene_of("track_link", 2, 3)};
  ASSERT_TRUE(cell.run_until_ready());
  cell.plc.hold_request = true;
  cell.plc.raise_request(1, 1);
  ASSERT_TRUE(cell.run_until([&] { return cell.cell().sweep_state() == drivers::sweep::State::Sweeping; }));
  cell.kill_daemon();
  cell.run_for(1s);
  const auto sweeps = cell.sweeps();
  cell.start_daemon();
  // What a PLC does that keeps the request standing is tested at its session; this one starts afresh with the cell.
  cell.run_for(10s);
  EXPECT_EQ(cell.sweeps(), sweeps);
  EXPECT_FALSE(cell.plc.result_valid());
  ASSERT_TRUE(cell.run_until_ready());
  const auto result = cell.pick();
  ASSERT_TRUE(result.has_value());
  EXPECT_EQ(result->code, plc::ResultCode::PickFound);
}

TEST(Restart, TermInEachStateIsSafeWithinTwoSeconds) {
  using daemon::CellState;
  for (const auto state : {CellState::Idle, CellState::AwaitingClear, CellState::Sweeping, CellState::Detecting}) {
    EmulatedCell cell{test_folder().load({}), scene_of("track_link", 2, 3)};
    ASSERT_TRUE(cell.run_until_ready());
    cell.robot_in_the_way = state == CellState::AwaitingClear;
    cell.run_for(200ms);
    if (state != CellState::Idle) cell.plc.raise_request(1, 1);
    ASSERT_TRUE(cell.run_until([&] { return cell.cell().state() == state; }));
    cell.cell().shut_down(cell.now());
    EXPECT_TRUE(cell.run_until([&] { return cell.cell().safe() && !cell.pivot.moving(cell.now()); }, 1s));
    cell.run_for(200ms);
    EXPECT_FALSE(cell.plc.result_valid());
    EXPECT_FALSE(cell.plc.ready());
  }
}

TEST(Restart, ARequestThatComesWithTheTermStartsNothing) {
  EmulatedCell cell{test_folder().load(coarse_cell()), empty_scene()};
  ASSERT_TRUE(cell.run_until_ready());
  cell.plc_writes(plc::at("sequence"), 99);
  cell.plc_writes(plc::at("part_id"), 1);
  cell.plc_writes(plc::at("supply_id"), 1);
  cell.plc_writes(plc::at("control"), plc::control::kRequest | plc::control::kRobotClear);
  cell.cell().shut_down(cell.now());
  cell.cell().run(cell.now());
  EXPECT_EQ(cell.cell().state(), daemon::CellState::Idle);
  EXPECT_EQ(cell.cell().sweep_state(), drivers::sweep::State::Idle);
  EXPECT_TRUE(cell.cell().safe());
}
}  // namespace binpick::support
