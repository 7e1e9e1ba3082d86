#pragma once

#include <array>
#include <map>
#include <string>
#include <vector>

#include "bench/production/fault_plan.hpp"
#include "bench/production/figures.hpp"

/// What the records of a run with faults come to.
namespace binpick::bench {
/// A wrong pose, or a bin that was said to be empty and was not, at a faulted request or the one after it.
struct WrongAtFault {
  std::string part, what, fault;
  std::uint64_t bin = 0;
  int request = 0;
  double error_mm = 0, error_deg = 0;
  bool is_from_fault = false;  ///< Scans of the same pile without a fault do not make the same mistake.
};

struct FaultFigures {
  int requests = 0;
  int faults = 0, not_reached = 0;
  std::map<std::string, std::array<int, support::kCyclePhases.size()>> injected;  ///< By device; phases in order.
  std::map<std::string, int> answers;                                             ///< Of requests with a fault.
  std::vector<std::string> lost_handshakes;
  std::vector<WrongAtFault> wrong;
  int looked_at = 0;                 ///< Poses sent at faulted requests and those after them.
  int others = 0, others_wrong = 0;  ///< Poses sent at all other requests.
  int available = 0;                 ///< As in ProductionFigures: each request by its own answer.
  int asked_again = 0;               ///< Beside them: ended by the fault, and the next one ended well.
  Spread recovered_s;
  double recovered_max_s = 0;

  int wrong_from_fault() const;
  double availability_percent() const { return requests > 0 ? 100.0 * available / requests : 0; }
  double with_asking_again_percent() const { return requests > 0 ? 100.0 * (available + asked_again) / requests : 0; }
  bool meets_must() const { return wrong_from_fault() == 0 && lost_handshakes.empty(); }
};
/// `names` of the parts, one for each run.
FaultFigures fault_figures_of(const std::vector<std::string>& names, const std::vector<PartRun>& runs);
/// Markdown.
std::string to_table(const FaultFigures& figures);
}  // namespace binpick::bench
