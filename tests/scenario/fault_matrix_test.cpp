#include <algorithm>
#include <cstdio>
#include <gtest/gtest.h>
#include <string>

#include "plc/alarms.hpp"
#include "tests/support/cell_file.hpp"
#include "tests/support/device_faults.hpp"
#include "tests/support/emulated_cell.hpp"
#include "tests/support/scenes.hpp"

/// Every device, every fault, every phase of a cycle: the PLC gets an alarm with cause and cure, the pivot stands,
/// nothing wrong is valid, the cell is ready again within 3 s after the device is, and the next pick succeeds.
namespace binpick::support {
namespace {
using namespace std::chrono_literals;

constexpr CyclePhase kPhases[] = {CyclePhase::Ready, CyclePhase::Positioning, CyclePhase::Sweeping,
                                  CyclePhase::Detecting, CyclePhase::ResultPending};

bool comes_to(EmulatedCell& cell, CyclePhase phase) {
  if (phase == CyclePhase::Ready) return true;
  cell.plc.hold_ack = phase == CyclePhase::ResultPending;
  cell.plc.raise_request(1, 1);
  if (!reach(cell, phase)) return false;
  if (phase == CyclePhase::Sweeping) cell.run_for(400ms);
  return phase != CyclePhase::ResultPending || cell.run_until([&] { return cell.plc.result_valid(); });
}

struct Outcome {
  std::string alarm = "–", valid = "nothing";
  bool pivot_stands = false, alarm_has_cure = true, ready_again = false, next_pick = false;
  double ready_after_s = 0;
};

Outcome play(const DeviceFault& c, CyclePhase phase) {
  Outcome outcome;
  EmulatedCell cell{test_folder().load(coarse_cell()), scene_of("track_link", 2, 5), 5};
  cell.detection_time = 1500ms;  // long enough for a fault in it to be noticed
  if (!cell.run_until_ready() || !comes_to(cell, phase)) {
    ADD_FAILURE() << "the cell did not come to " << to_text(phase);
    return outcome;
  }
  cell.plc.forget_alarms_seen();
  c.set(cell, true);
  cell.run_for(8s);
  outcome.pivot_stands = !cell.pivot.moving(cell.now());
  if (cell.plc.result_valid()) outcome.valid = "the result of before";

  c.set(cell, false);
  const TimePoint healed = cell.now();
  cell.plc.hold_ack = false;
  cell.run_until([&] { return cell.plc.fault() || cell.plc.ready(); }, 3s);
  if (cell.plc.fault()) cell.plc.raise_reset();
  outcome.ready_again = cell.run_until(
      [&] { return cell.cell().plc().state() == plc::State::Ready && cell.plc.ready() && cell.plc.idle(); }, 10s);
  outcome.ready_after_s = in_s(cell.now() - healed);
  cell.detection_time = 150ms;
  cell.run_for(4s);  // a robot that had a pick to fetch comes, takes it and leaves the view
  const auto result = cell.pick();
  outcome.next_pick = result && result->code == plc::ResultCode::PickFound;
  for (const auto alarm : cell.plc.alarms_seen()) {
    if (outcome.alarm == "–") outcome.alarm.clear();
    outcome.alarm += (outcome.alarm.empty() ? "" : " ") + std::to_string(static_cast<int>(alarm));
    const auto text = std::ranges::find(plc::alarm_table(), alarm, &plc::AlarmText::alarm);
    outcome.alarm_has_cure &= text != plc::alarm_table().end() && !text->cause.empty() && !text->cure.empty();
  }
  return outcome;
}
}  // namespace

TEST(FaultMatrix, EveryDeviceEveryFaultEveryPhase) {
  std::printf("%-8s %-15s %-15s %-12s %-6s %-21s %-10s %s\n", "device", "fault", "phase", "alarms", "pivot",
              "valid meanwhile", "ready in s", "next pick");
  for (const DeviceFault& c : standing_faults())
    for (const CyclePhase phase : kPhases) {
      SCOPED_TRACE(c.device + ", " + c.name + ", " + to_text(phase));
      const Outcome o = play(c, phase);
      std::printf("%-8s %-15s %-15s %-12s %-6s %-21s %-10.2f %s\n", c.device.c_str(), c.name.c_str(), to_text(phase),
                  o.alarm.c_str(), o.pivot_stands ? "stands" : "MOVES", o.valid.c_str(), o.ready_after_s,
                  o.next_pick ? "found" : "NONE");
      EXPECT_TRUE(o.pivot_stands);
      EXPECT_TRUE(o.alarm_has_cure);
      EXPECT_TRUE(o.ready_again);
      EXPECT_LE(o.ready_after_s, 3.0);
      EXPECT_TRUE(o.next_pick);
      EXPECT_NE(o.alarm, "–");
      // A result that was complete before the fault stays until it is acknowledged.
      if (phase != CyclePhase::ResultPending && c.device != "robot" && c.device != "plc") {
        EXPECT_EQ(o.valid, "nothing");
      }
    }
}
}  // namespace binpick::support
