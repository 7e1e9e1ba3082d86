#pragma once

#include <functional>
#include <string>
#include <vector>

#include "tests/support/cycle_phase.hpp"
#include "tests/support/emulated_cell.hpp"

/// What goes wrong with the emulated devices, by name: for the fault matrix and for production runs.
namespace binpick::support {
struct DeviceFault {
  std::string device;  ///< "plc", "pivot", "scanner", "robot".
  std::string name;
  /// Off heals the device. What happens in a moment (a power cycle) happens at on.
  std::function<void(EmulatedCell&, bool on)> set;
  Duration lasts_max = std::chrono::seconds(8);  ///< Longer would be another fault.
};

/// Those that a cell has to tell its PLC of by an alarm when they stand for seconds, whatever it is doing.
std::vector<DeviceFault> standing_faults();
/// Those that come and go, or that are no business of the cell's: a line that is cut once, a power cycle, profiles that
/// are lost, a gripper that holds nothing, a PLC that drops its request.
std::vector<DeviceFault> passing_faults();

/// Runs until the raised request has come so far. False: it has not; an answer from the scan before has no sweep.
bool reach(EmulatedCell& cell, CyclePhase phase, Duration limit = std::chrono::seconds(30));
}  // namespace binpick::support
