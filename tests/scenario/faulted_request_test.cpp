#include "bench/production/faulted_request.hpp"

#include <gtest/gtest.h>
#include <string>

#include "tests/support/cell_file.hpp"
#include "tests/support/scenes.hpp"

/// The request with a fault in it, as production runs make it: the fault is there and goes, and the PLC's program gets
/// the cell going again.
namespace binpick::support {
namespace {
using namespace std::chrono_literals;
using bench::ask_with_fault;
using bench::FaultedAnswer;
using bench::PlannedFault;

constexpr Duration kPicking = 1400ms;  // of the emulated robot, by default

struct FaultedRequest : testing::Test {
  EmulatedCell cell{test_folder().load(coarse_cell()), scene_of("track_link", 3, 5), 5};
  void SetUp() override { ASSERT_TRUE(cell.run_until_ready()); }

  /// The first of the device's faults: pulled.
  FaultedAnswer pull(const std::string& device, CyclePhase phase, double lasts_s) {
    return ask_with_fault(cell, {device, phase, 0, 0.5, lasts_s}, kPicking);
  }
  bool next_is_picked() {
    const auto result = cell.pick();
    return result && result->code == plc::ResultCode::PickFound;
  }
};
}  // namespace

TEST_F(FaultedRequest, EndsWithItsAlarmAndIsReset) {
  const FaultedAnswer answer = pull("pivot", CyclePhase::Sweeping, 2);
  EXPECT_EQ(answer.fault.name, "pulled");
  EXPECT_FALSE(answer.result);
  ASSERT_TRUE(answer.alarm);
  EXPECT_EQ(*answer.alarm, plc::Alarm::PivotNoReply);
  EXPECT_EQ(answer.fault.alarms, "100");
  EXPECT_FALSE(answer.fault.handshake_lost);
  EXPECT_LE(answer.fault.recovered_s, 3);
  EXPECT_TRUE(cell.plc.ready());
  EXPECT_FALSE(cell.pivot.faults.unplugged) << "healed";
  EXPECT_TRUE(next_is_picked());
}

TEST_F(FaultedRequest, APickThatIsUnderWayIsBroughtToItsEnd) {
  const FaultedAnswer answer = pull("robot", CyclePhase::Picking, 1);
  ASSERT_TRUE(answer.result);
  EXPECT_EQ(answer.result->code, plc::ResultCode::PickFound);
  EXPECT_EQ(cell.robot.picks_done(), 1);
  EXPECT_EQ(answer.fault.alarms, std::to_string(static_cast<int>(plc::Alarm::RobotLost)));
  EXPECT_FALSE(answer.fault.handshake_lost);
}

TEST_F(FaultedRequest, IsMadeWithASweepThoughTheLastScanHoldsAnotherPick) {
  ASSERT_TRUE(next_is_picked());
  ASSERT_TRUE(cell.run_until([&] { return cell.robot.picks_done() == 1; }));
  const auto sweeps = cell.sweeps();
  const FaultedAnswer answer = pull("robot", CyclePhase::Detecting, 0.2);
  EXPECT_TRUE(answer.fault.reached);
  EXPECT_EQ(cell.sweeps(), sweeps + 1);
}

TEST_F(FaultedRequest, NothingFailsWhereItsPhaseNeverComes) {
  cell.world = empty_scene();
  const FaultedAnswer answer = pull("scanner", CyclePhase::Picking, 1);
  EXPECT_FALSE(answer.fault.reached);
  ASSERT_TRUE(answer.result);
  EXPECT_EQ(answer.result->code, plc::ResultCode::SupplyEmpty);
  EXPECT_FALSE(answer.fault.handshake_lost);
}

TEST_F(FaultedRequest, AHandshakeThatStaysWhereItIsIsLost) {
  cell.plc.hold_ack = true;  // a PLC that never takes its answer
  const FaultedAnswer answer = pull("robot", CyclePhase::Detecting, 0.2);
  EXPECT_TRUE(answer.result);
  EXPECT_TRUE(answer.fault.handshake_lost);
}
}  // namespace binpick::support
