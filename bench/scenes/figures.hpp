#pragma once

#include <array>
#include <map>
#include <string>
#include <vector>

#include "bench/scenes/judge.hpp"
#include "bench/scenes/lines.hpp"
#include "bench/scenes/precision.hpp"

namespace binpick::bench {
/// A figure with what 1000 draws of its piles make of it.
struct Estimate {
  double value = 0;
  std::vector<double> draws;
  Interval interval() const { return interval_95(draws); }
};
/// Of several parts: each has the same number of draws.
Estimate mean_of(const std::vector<const Estimate*>& parts);

struct Believed {
  double score = 0;
  bool right = false;
};
struct ScoreBin {
  double score = 0, right = 0, count = 0;  ///< Sums.
};
/// Ten bins of equal width.
std::array<ScoreBin, 10> score_bins(const std::vector<Believed>& believed);
/// Mean of |share of right ones − mean score| over ten bins of the score, by how many fall into each.
double calibration_error(const std::vector<Believed>& believed);

struct StageCount {
  std::string stage;
  int alive = 0;
};

/// What one part's scenes say.
struct PartFigures {
  std::string name;
  std::size_t scenes = 0;
  std::vector<Curve> curves;
  PrecisionSummary summary;
  Estimate ap, first_right, t_mm, r_deg;
  double first_within_3 = 0;    ///< First answers within 3 mm and 3 degrees.
  double ap_05 = 0, ap_02 = 0;  ///< At a twentieth and a fiftieth of the diameter.
  double t_p95_mm = 0, r_p95_deg = 0;
  double recall_easy = 0, recall_hard = 0;  ///< Of what is visible from .85 on, and from .25 to .5.
  int right = 0, wrong = 0, to_find = 0;    ///< Whole list.
  int right_half = 0, wrong_half = 0;       ///< From score .5 on.
  std::vector<Believed> believed;
  std::vector<double> normalised_errors;  ///< Squared, over the degrees of freedom.
  std::vector<double> time_ms, image_ms, first_ms, first_hypotheses;
  std::map<std::string, double> stages_ms;  ///< Means.
  std::vector<StageCount> stages;           ///< True poses to find that are alive, in the order of detection.
};
/// Scenes of one part, class, split and detector.
PartFigures figures_of_part(const ScenePart& part, const std::vector<const SceneLine*>& scenes, std::uint64_t stream);
}  // namespace binpick::bench
