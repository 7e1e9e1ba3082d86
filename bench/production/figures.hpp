#pragma once

#include <optional>
#include <string>
#include <vector>

#include "bench/production/records.hpp"

/// What the records of a production run come to.
namespace binpick::bench {
struct RobotModel {
  double approach_s = 0, grasp_s = 0, retreat_s = 0;  ///< From beside the supply to the grasp, and out of the view.
  double place_s = 0;                                 ///< To the place, let go, and back beside the supply.
};

struct Spread {
  double p50 = 0, p95 = 0;
};
Spread spread(std::vector<double> values);

struct ProductionFigures {
  std::string name;
  int requests = 0, picks = 0, bins = 0, objects = 0;
  int taken = 0, missed = 0, collisions = 0, wrong = 0, retries = 0;
  int failed_twice = 0;  ///< Objects that were failed on more than once.
  int left = 0, takeable = 0;
  int scans = 0;
  int available = 0;          ///< Requests that ended in a pick, or in "empty" where nothing was left.
  int truly_unreachable = 0;  ///< Beside them: "not reachable" where no grasp of any object left was free.
  double cpu_s = 0;
  Spread cycle_s, cycle_without_overlap_s;  ///< Of picks: from one to the next.
  Spread error_mm, error_deg;
  int not_located = 0;         ///< Scans in which the supply was not found.
  Spread place_mm, place_deg;  ///< Of a supply that was located.
  std::vector<double> detection_ms, hypotheses, first_ms, first_hypotheses;  ///< Of scans.

  double share(int count) const { return picks > 0 ? 100.0 * count / picks : 0; }
  double left_percent() const { return objects > 0 ? 100.0 * left / objects : 0; }
  double availability_percent() const { return requests > 0 ? 100.0 * available / requests : 0; }
  double picks_per_scan() const { return scans > 0 ? static_cast<double>(picks) / scans : 0; }
  double cpu_s_per_pick() const { return picks > 0 ? cpu_s / picks : 0; }
};

/// Overlap: the next sweep runs while the robot brings the part away. Without: after it has come back.
ProductionFigures figures_of(const std::string& name, const std::vector<PartRun>& runs, const RobotModel& robot);

struct ProductionDemand {
  std::string what;
  double here = 0, must = 0, aim = 0;
  bool at_least = true;
  bool meets_must() const { return at_least ? here >= must : here <= must; }
  bool meets_aim() const { return at_least ? here >= aim : here <= aim; }
};
std::vector<ProductionDemand> demands(const ProductionFigures& all);

/// Markdown: one column per part and one for all, then what is asked for. Figure 7's numbers beside the published.
std::string to_table(const std::vector<ProductionFigures>& parts, const ProductionFigures& all);
}  // namespace binpick::bench
