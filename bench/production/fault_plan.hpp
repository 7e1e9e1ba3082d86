#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>

#include "tests/support/cycle_phase.hpp"

/// Which requests of a part's run are made with a fault, and with which.
namespace binpick::bench {
inline constexpr std::array kFaultDevices{"plc", "pivot", "scanner", "robot"};

struct PlannedFault {
  std::string device;
  support::CyclePhase phase = support::CyclePhase::Ready;
  double which = 0;  ///< 0 … 1: of the device's faults.
  double where = 0;  ///< 0 … 1: how far into the phase.
  double lasts_s = 0;
};

/// Every so many-th request, from the start of a part's run. Devices and phases come up in turn, in an order drawn from
/// the seed: 24 faults of one part have each of them once, and so have six of each of four parts.
class FaultPlan {
 public:
  FaultPlan() = default;  ///< Nothing goes wrong.
  FaultPlan(std::uint64_t every, std::uint64_t seed, std::size_t part) : every_{every}, seed_{seed}, part_{part} {}

  std::uint64_t every() const { return every_; }
  /// `request` is counted over all bins of the part, from 0 on.
  std::optional<PlannedFault> at(std::uint64_t request) const;

 private:
  std::uint64_t every_ = 0, seed_ = 1;
  std::size_t part_ = 0;
};
}  // namespace binpick::bench
