#include "tests/support/device_faults.hpp"

namespace binpick::support {
namespace {
using namespace std::chrono_literals;
using emulators::Faults;

/// A change of the device's faults; the scanner is the one of the two that is wired.
template <class Change>
DeviceFault fault(const std::string& device, const std::string& name, Change change, Duration lasts_max = 8s) {
  const auto set = [device, change](EmulatedCell& cell, bool on) {
    Faults faults;
    if (on) change(faults);
    if (device == "plc") cell.plc.faults = faults;
    if (device == "pivot") cell.pivot.faults = faults;
    if (device == "scanner") cell.scanner.faults = cell.lps36.faults = faults;
    if (device == "robot") cell.robot.faults = faults;
  };
  return {device, name, set, lasts_max};
}

template <class Act>
DeviceFault moment(const std::string& device, const std::string& name, Act act) {
  return {device, name,
          [act](EmulatedCell& cell, bool on) {
            if (on) act(cell);
          },
          100ms};
}

constexpr auto kPulled = [](Faults& f) { f.unplugged = true; };
constexpr auto kSilent = [](Faults& f) { f.silent = true; };
constexpr auto kGarbled = [](Faults& f) { f.garbage = true; };
constexpr auto kStopped = [](Faults& f) { f.emergency_stop = true; };
constexpr auto kBusOff = [](Faults& f) { f.bus_off = true; };
constexpr auto kWrongId = [](Faults& f) { f.wrong_id = true; };
auto error(std::uint32_t code) {
  return [code](Faults& f) { f.error_code = code; };
}
auto cut_after(std::size_t bytes) {
  return [bytes](Faults& f) { f.disconnect_after_bytes = bytes; };
}
}  // namespace

std::vector<DeviceFault> standing_faults() {
  return {
      fault("pivot", "pulled", kPulled),
      fault("pivot", "silent", kSilent),
      fault("pivot", "garbled", kGarbled),
      fault("pivot", "wrong id", kWrongId),
      fault("pivot", "tow error", error(0x11)),
      fault("pivot", "emergency stop", kStopped),
      fault("pivot", "bus-off", kBusOff),
      fault("scanner", "pulled", kPulled),
      fault("scanner", "silent", kSilent),
      fault("scanner", "garbled", kGarbled),
      fault("scanner", "sFA 6", error(6)),
      fault("robot", "pulled", kPulled),
      fault("robot", "silent", kSilent),
      fault("robot", "garbled", kGarbled),
      fault("robot", "emergency stop", kStopped),
      fault("plc", "pulled", kPulled),
      fault("plc", "silent", kSilent),
      fault("plc", "garbled", kGarbled),
      fault("plc", "in STOP", error(1)),
  };
}

std::vector<DeviceFault> passing_faults() {
  return {
      moment("pivot", "24 V off and on", [](EmulatedCell& cell) { cell.pivot.power_cycle(cell.now()); }),
      fault("pivot", "loose plug", cut_after(40)),
      moment("scanner", "counter jumps",
             [](EmulatedCell& cell) { cell.scanner.skip_counter(40), cell.lps36.skip_scans(40); }),
      // Longer, and over the start of a sweep, a network that holds telegrams back is a latency that nobody can see.
      fault(
          "scanner", "line stalls", [](Faults& f) { f.delay = 250ms; }, 300ms),
      {"scanner", "line cut or restart",
       [](EmulatedCell& cell, bool on) {
         cell.scanner.faults = {};
         if (!on) return;
         cell.scanner.faults.disconnect_after_bytes = 5000;
         cell.lps36.power_cycle(cell.now());
       }},
      fault("robot", "line cut", cut_after(5)),
      fault("robot", "grips nothing", error(1)),
      fault("robot", "wrong pick id", kWrongId),
      moment("robot", "program restarted", [](EmulatedCell& cell) { cell.robot.restart_program(cell.now()); }),
      fault("plc", "line cut in a telegram", cut_after(9)),
      fault("plc", "foreign protocol", kWrongId),
      moment("plc", "power cycle", [](EmulatedCell& cell) { cell.plc.restart(); }),
      moment("plc", "drops its request", [](EmulatedCell& cell) { cell.plc.drop_request(); }),
      moment("plc", "aborts", [](EmulatedCell& cell) { cell.plc.raise_abort(); }),
  };
}

bool reach(EmulatedCell& cell, CyclePhase phase, Duration limit) {
  using drivers::sweep::State;
  switch (phase) {
    case CyclePhase::Ready:
      return true;
    case CyclePhase::Positioning:
      return cell.run_until(
          [&] { return cell.cell().state() == daemon::CellState::Sweeping && cell.pivot.moving(cell.now()); }, limit);
    case CyclePhase::Sweeping:
      return cell.run_until([&] { return cell.cell().sweep_state() == State::Sweeping; }, limit);
    case CyclePhase::Detecting:
      return cell.run_until([&] { return cell.cell().state() == daemon::CellState::Detecting; }, limit);
    case CyclePhase::ResultPending:
      return cell.run_until([&] { return cell.cell().plc().state() == plc::State::ResultValid; }, limit);
    case CyclePhase::Picking:
      return cell.run_until([&] { return !cell.robot.clear_of_view(); }, limit);
  }
  return false;
}
}  // namespace binpick::support
