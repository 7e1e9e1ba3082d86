#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "bench/production/displacement.hpp"
#include "bench/production/fault_plan.hpp"
#include "bench/production/known_poses.hpp"
#include "bench/production/records.hpp"
#include "bench/production/setup.hpp"
#include "daemon/cycle/cell_data.hpp"

namespace binpick::bench {
/// Fills a bin, and lets the cell empty it: the daemon's own Cell in virtual time, the emulated devices, the robot's
/// gripper on exact geometry (grip.hpp). The same number and seed give the same records, but for the times that
/// detection took.
///
/// The bin ends with the answer "empty", or with the second answer in a row without a pick; the first one is asked
/// again. A request during which a device failed ends none. A bin in which more than twice as many requests as objects
/// were made is given up.
struct BinOutcome {
  std::vector<RequestRecord> requests;
  BinRecord bin;
};
/// What is made hard on purpose.
struct BinTrials {
  FaultPlan faults;
  std::uint64_t requests_before = 0;  ///< In the part's run: the plan counts on.
  Displacement displacement;          ///< Of the bin.
};
BinOutcome run_bin(const ProductionPart& part, const std::shared_ptr<const daemon::CellData>& data, std::uint64_t bin,
                   std::uint64_t seed, const BinTrials& trials = {});

KnownCell known_cell(const daemon::CellData& data, const emulators::GripRules& rules);
/// The same bin, but the poses are known and only the gripper decides: objects that are left over, and why.
int left_by_known_poses(const ProductionPart& part, const daemon::CellData& data, std::uint64_t bin, std::uint64_t seed,
                        std::vector<std::string>* reasons);
}  // namespace binpick::bench
