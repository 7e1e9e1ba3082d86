#include "bench/scenes/precision.hpp"

#include <cmath>
#include <gtest/gtest.h>
#include <numeric>

#include "bench/scenes/figures.hpp"

namespace binpick::bench {
namespace {
Curve curve(std::uint64_t pile, std::vector<CurvePoint> points, bool nothing_to_find = false) {
  return {pile, nothing_to_find, std::move(points)};
}

// Two scenes, one common list of thresholds: inf, .9, .8, .6. By hand:
//   threshold  first scene (p, r)  second (p, r)  mean p   mean r
//   inf        1    0              1    0         1        0
//   .9         1    .5             1    0         1        .25
//   .8         1    .5             .5   .5        .75      .5
//   .6         .75  1              .5   .5        .625     .75
TEST(Precision, TheMeanCurveAndItsStepSumByHand) {
  const std::vector curves{curve(1, {{0.9, 1, 0.5}, {0.6, 0.75, 1}}), curve(2, {{0.8, 0.5, 0.5}})};
  const std::vector<MeanPoint> mean = mean_curve(curves);
  ASSERT_EQ(mean.size(), 4U);
  EXPECT_TRUE(std::isinf(mean[0].score));
  EXPECT_DOUBLE_EQ(mean[1].precision, 1);
  EXPECT_DOUBLE_EQ(mean[1].recall, 0.25);
  EXPECT_DOUBLE_EQ(mean[2].precision, 0.75);
  EXPECT_DOUBLE_EQ(mean[2].recall, 0.5);
  EXPECT_DOUBLE_EQ(mean[3].precision, 0.625);
  EXPECT_DOUBLE_EQ(mean[3].recall, 0.75);
  const PrecisionSummary summary = summarise(curves);
  EXPECT_DOUBLE_EQ(summary.ap, 0.25 * 1 + 0.25 * 0.75 + 0.25 * 0.625);
  EXPECT_DOUBLE_EQ(summary.map, 0.5 * ((0.5 * 1 + 0.5 * 0.75) + 0.5 * 0.5));
  EXPECT_DOUBLE_EQ(summary.recall_99, 0.25);
  EXPECT_DOUBLE_EQ(summary.score_99, 0.9);
  EXPECT_DOUBLE_EQ(summary.best_f1, 2 * 0.625 * 0.75 / (0.625 + 0.75));
}

TEST(Precision, AnEmptySceneMeasuresFalseAlarmsOnly) {
  // Nothing to find: recall is 1 throughout. A false alarm at .7 halves the mean precision.
  const std::vector curves{curve(1, {}, true), curve(2, {{0.7, 0, 1}}, true)};
  EXPECT_DOUBLE_EQ(step_sum(mean_curve(curves)), 1);
  EXPECT_DOUBLE_EQ(mean_curve(curves).back().precision, 0.5);
  EXPECT_DOUBLE_EQ(mean_curve(curves).back().recall, 1);
}

TEST(Precision, EqualScoresOfTwoScenesAreOneThreshold) {
  const std::vector curves{curve(1, {{0.5, 1, 1}}), curve(2, {{0.5, 0, 0}})};
  const auto mean = mean_curve(curves);
  ASSERT_EQ(mean.size(), 2U);
  EXPECT_DOUBLE_EQ(step_sum(mean), 0.5 * 0.5);
}

TEST(Precision, WeightsCountScenesSeveralTimes) {
  const std::vector curves{curve(1, {{0.5, 1, 1}}), curve(2, {{0.4, 0, 0}})};
  const std::vector<double> weights{3, 1};
  const std::vector repeated{curves[0], curves[0], curves[0], curves[1]};
  EXPECT_DOUBLE_EQ(step_sum(mean_curve(curves, weights)), step_sum(mean_curve(repeated)));
}

TEST(Precision, DrawsTakeWholePilesAndAsManyAsThereAre) {
  const std::vector<std::uint64_t> piles{7, 7, 8, 9, 8};
  const auto draws = pile_draws(piles);
  ASSERT_EQ(draws.size(), 1000U);
  double sum = 0;
  for (const auto& weights : draws) {
    EXPECT_EQ(weights[0], weights[1]);
    EXPECT_EQ(weights[2], weights[4]);
    EXPECT_EQ(weights[0] + weights[2] + weights[3], 3);
    sum += weights[0];
  }
  EXPECT_NEAR(sum / 1000, 1, 0.1);
  EXPECT_EQ(draws, pile_draws(piles)) << "the same again";
  EXPECT_NE(draws, pile_draws(piles, 1)) << "another stream";
}

TEST(Precision, QuantilesInterpolate) {
  EXPECT_DOUBLE_EQ(quantile({3, 1, 2}, 0.5), 2);
  EXPECT_DOUBLE_EQ(quantile({0, 10}, 0.25), 2.5);
  EXPECT_TRUE(std::isnan(quantile({}, 0.5)));
  std::vector<double> values(1001);
  std::iota(values.begin(), values.end(), 0);
  EXPECT_DOUBLE_EQ(interval_95(values).low, 25);
  EXPECT_DOUBLE_EQ(interval_95(values).high, 975);
}

TEST(Calibration, ErrorIsTheWeightedGapOfTheBins) {
  // Bin .9: four of mean score .95, three right: gap .2 of 4. Bin .1: two of .15, none right: gap .15 of 2.
  const std::vector<Believed> believed{{0.95, true},  {0.95, true},  {0.95, true},
                                       {0.95, false}, {0.15, false}, {0.15, false}};
  EXPECT_NEAR(calibration_error(believed), (4 * 0.2 + 2 * 0.15) / 6, 1e-12);
  EXPECT_DOUBLE_EQ(calibration_error({}), 0);
  EXPECT_DOUBLE_EQ(calibration_error({{1.0, true}}), 0) << "a score of one falls into the last bin";
}
}  // namespace
}  // namespace binpick::bench
