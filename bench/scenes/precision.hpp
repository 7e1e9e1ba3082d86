#pragma once

#include <functional>
#include <span>
#include <vector>

#include "bench/scenes/matching.hpp"

namespace binpick::bench {
/// Precision and recall at one common threshold, each the mean over the scenes.
struct MeanPoint {
  double score, precision, recall;
};
/// From the threshold +infinity down over the scores of all scenes. `weights`: how often each scene counts; empty:
/// once.
std::vector<MeanPoint> mean_curve(std::span<const Curve> curves, std::span<const double> weights = {});

struct PrecisionSummary {
  double ap = 0;   ///< Step sum of the mean curve, without envelope.
  double map = 0;  ///< Mean of the scenes' own.
  double best_f1 = 0;
  double recall_99 = 0;  ///< Largest recall where the mean precision is at least .99.
  double recall_999 = 0;
  double score_99 = 0;  ///< Lowest score where the mean precision is at least .99.
};
double step_sum(std::span<const MeanPoint> points);
PrecisionSummary summarise(std::span<const Curve> curves);

struct Interval {
  double low = 0, high = 0;
};
/// Each draw takes as many piles as there are, with replacement: how often each pile (by its place in `piles`, which
/// lists the pile of each scene) was drawn, as weights of the scenes. The same for the same scenes and stream; parts
/// that are drawn together have streams of their own.
std::vector<std::vector<double>> pile_draws(std::span<const std::uint64_t> piles, std::uint64_t stream = 0,
                                            std::size_t draws = 1000);
/// 95 % of the values, between their 2.5 and 97.5 percentiles.
Interval interval_95(std::vector<double> values);
/// By linear interpolation; NaN of nothing.
double quantile(std::vector<double> values, double q);
}  // namespace binpick::bench
