#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

namespace binpick::bench {
/// All that the judge needs of one scene. Detections in any order.
struct JudgedScene {
  std::uint64_t pile = 0;
  std::vector<double> scores;
  std::vector<bool> to_find;    ///< Of each truth: enough of it is visible.
  Eigen::MatrixXd distance_mm;  ///< Detections × truths.
  double threshold_mm = 0;      ///< Nearer is right.
};

enum class Verdict : std::uint8_t { Right, Wrong, Neutral };

/// Of all detections with at least this score (others: Neutral, with no truth). Right: detection and truth are each
/// other's nearest, nearer than the threshold, and the truth is to find. A truth that is not to find makes its nearest
/// detection neutral. All others are wrong, a second detection of one truth too.
struct Match {
  std::vector<Verdict> verdict;  ///< Of each detection.
  std::vector<int> truth;        ///< Nearest truth of a right or neutral detection; -1: none.
  int right = 0, wrong = 0, to_find = 0;
};
Match match(const JudgedScene& scene, double score_min);

/// What a scene's counts become as the threshold of the score falls.
struct CurvePoint {
  double score = 0;
  double precision = 1;  ///< 1 when nothing is said.
  double recall = 0;     ///< 1 when there is nothing to find.
};
/// One point for each distinct score, highest first; before the first: precision 1, recall 0 (1 if nothing is to find).
struct Curve {
  std::uint64_t pile = 0;
  bool nothing_to_find = false;
  std::vector<CurvePoint> points;
};
Curve curve_of(const JudgedScene& scene);
}  // namespace binpick::bench
