#include <algorithm>
#include <cstdio>
#include <functional>
#include <gtest/gtest.h>
#include <string>
#include <vector>

#include "plc/alarms.hpp"
#include "tests/support/cell_file.hpp"
#include "tests/support/emulated_cell.hpp"
#include "tests/support/scenes.hpp"

/// Every device, every fault, every phase of a cycle: the PLC gets an alarm with cause and cure, the pivot stands,
/// nothing wrong is valid, the cell is ready again within 3 s after the device is, and the next pick succeeds.
namespace binpick::support {
namespace {
using namespace std::chrono_literals;

enum class Phase { Ready, Positioning, Sweeping, Detecting, ResultPending };
constexpr Phase kPhases[] = {Phase::Ready, Phase::Positioning, Phase::Sweeping, Phase::Detecting, Phase::ResultPending};

const char* to_text(Phase phase) {
  switch (phase) {
    case Phase::Ready:
      return "ready";
    case Phase::Positioning:
      return "positioning";
    case Phase::Sweeping:
      return "sweeping";
    case Phase::Detecting:
      return "detecting";
    case Phase::ResultPending:
      return "result pending";
  }
  return "?";
}

struct Case {
  std::string device, fault;
  std::function<void(EmulatedCell&, bool on)> set;
};

std::vector<Case> cases() {
  using emulators::Faults;
  const auto of = [](auto member, auto change) {
    return [member, change](EmulatedCell& cell, bool on) {
      Faults healthy;
      if (on) change(healthy);
      (cell.*member).faults = healthy;
    };
  };
  const auto unplugged = [](Faults& f) { f.unplugged = true; };
  const auto silent = [](Faults& f) { f.silent = true; };
  const auto garbage = [](Faults& f) { f.garbage = true; };
  const auto emergency_stop = [](Faults& f) { f.emergency_stop = true; };
  const auto bus_off = [](Faults& f) { f.bus_off = true; };
  const auto error = [](std::uint32_t code) { return [code](Faults& f) { f.error_code = code; }; };
  const auto wrong_id = [](Faults& f) { f.wrong_id = true; };
  return {
      {"pivot", "pulled", of(&EmulatedCell::pivot, unplugged)},
      {"pivot", "silent", of(&EmulatedCell::pivot, silent)},
      {"pivot", "garbled", of(&EmulatedCell::pivot, garbage)},
      {"pivot", "wrong id", of(&EmulatedCell::pivot, wrong_id)},
      {"pivot", "tow error", of(&EmulatedCell::pivot, error(0x11))},
      {"pivot", "emergency stop", of(&EmulatedCell::pivot, emergency_stop)},
      {"pivot", "bus-off", of(&EmulatedCell::pivot, bus_off)},
      {"scanner", "pulled", of(&EmulatedCell::scanner, unplugged)},
      {"scanner", "silent", of(&EmulatedCell::scanner, silent)},
      {"scanner", "garbled", of(&EmulatedCell::scanner, garbage)},
      {"scanner", "sFA 6", of(&EmulatedCell::scanner, error(6))},
      {"robot", "pulled", of(&EmulatedCell::robot, unplugged)},
      {"robot", "silent", of(&EmulatedCell::robot, silent)},
      {"robot", "garbled", of(&EmulatedCell::robot, garbage)},
      {"robot", "emergency stop", of(&EmulatedCell::robot, emergency_stop)},
      {"plc", "pulled", of(&EmulatedCell::plc, unplugged)},
      {"plc", "silent", of(&EmulatedCell::plc, silent)},
      {"plc", "garbled", of(&EmulatedCell::plc, garbage)},
      {"plc", "in STOP", of(&EmulatedCell::plc, error(1))},
  };
}

bool reach(EmulatedCell& cell, Phase phase) {
  if (phase == Phase::Ready) return true;
  cell.plc.hold_ack = phase == Phase::ResultPending;
  cell.plc.raise_request(1, 1);
  switch (phase) {
    case Phase::Ready:
      return true;
    case Phase::Positioning:
      return cell.run_until(
          [&] { return cell.cell().state() == daemon::CellState::Sweeping && cell.pivot.moving(cell.now()); });
    case Phase::Sweeping:
      return cell.run_until([&] { return cell.cell().sweep_state() == drivers::sweep::State::Sweeping; }) &&
             (cell.run_for(400ms), true);
    case Phase::Detecting:
      return cell.run_until([&] { return cell.cell().state() == daemon::CellState::Detecting; });
    case Phase::ResultPending:
      return cell.run_until([&] { return cell.plc.result_valid(); });
  }
  return false;
}

struct Outcome {
  std::string alarm = "–", valid = "nothing";
  bool pivot_stands = false, alarm_has_cure = true, ready_again = false, next_pick = false;
  double ready_after_s = 0;
};

Outcome play(const Case& c, Phase phase) {
  Outcome outcome;
  EmulatedCell cell{test_folder().load(coarse_cell()), scene_of("track_link", 2, 5), 5};
  cell.detection_time = 1500ms;  // long enough for a fault in it to be noticed
  if (!cell.run_until_ready() || !reach(cell, phase)) {
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
  for (const auto& c : cases())
    for (const Phase phase : kPhases) {
      SCOPED_TRACE(c.device + ", " + c.fault + ", " + to_text(phase));
      const Outcome o = play(c, phase);
      std::printf("%-8s %-15s %-15s %-12s %-6s %-21s %-10.2f %s\n", c.device.c_str(), c.fault.c_str(), to_text(phase),
                  o.alarm.c_str(), o.pivot_stands ? "stands" : "MOVES", o.valid.c_str(), o.ready_after_s,
                  o.next_pick ? "found" : "NONE");
      EXPECT_TRUE(o.pivot_stands);
      EXPECT_TRUE(o.alarm_has_cure);
      EXPECT_TRUE(o.ready_again);
      EXPECT_LE(o.ready_after_s, 3.0);
      EXPECT_TRUE(o.next_pick);
      EXPECT_NE(o.alarm, "–");
      // A result that was complete before the fault stays until it is acknowledged.
      if (phase != Phase::ResultPending && c.device != "robot" && c.device != "plc") {
        EXPECT_EQ(o.valid, "nothing");
      }
    }
}
}  // namespace binpick::support
