#pragma once

#include <optional>

#include "bench/production/fault_plan.hpp"
#include "bench/production/records.hpp"
#include "tests/support/device_faults.hpp"

namespace binpick::bench {
/// One request during which a device fails and comes back, and what the PLC's program makes of it without a person: it
/// waits for `ready` and for the robot, resets when there is a fault, and never aborts.
struct FaultedAnswer {
  std::optional<emulators::PlcResult> result;
  std::optional<plc::Alarm> alarm;  ///< That ended the request instead.
  FaultRecord fault;
};
/// The robot is away for `picking` with each pick.
FaultedAnswer ask_with_fault(support::EmulatedCell& cell, const PlannedFault& planned, Duration picking);
}  // namespace binpick::bench
