#include "bench/scenes/matching.hpp"

#include <gtest/gtest.h>

namespace binpick::bench {
namespace {
/// Truths A and B are to find, C is hidden.
JudgedScene scene(std::vector<double> scores, std::initializer_list<std::initializer_list<double>> distance_mm) {
  JudgedScene judged;
  judged.scores = std::move(scores);
  judged.to_find = {true, true, false};
  judged.threshold_mm = 10;
  judged.distance_mm.resize(static_cast<Eigen::Index>(distance_mm.size()), 3);
  Eigen::Index row = 0;
  for (const auto& of_detection : distance_mm) {
    Eigen::Index column = 0;
    for (const double d : of_detection) judged.distance_mm(row, column++) = d;
    ++row;
  }
  return judged;
}

TEST(Matching, RightWrongAndNeutral) {
  const Match m = match(scene({0.9, 0.8, 0.7}, {{1, 50, 50}, {50, 12, 60}, {50, 60, 2}}), 0);
  EXPECT_EQ(m.verdict, (std::vector{Verdict::Right, Verdict::Wrong, Verdict::Neutral}));
  EXPECT_EQ(m.truth, (std::vector{0, -1, 2}));
  EXPECT_EQ(m.right, 1);
  EXPECT_EQ(m.wrong, 1);
  EXPECT_EQ(m.to_find, 2);
}

TEST(Matching, OfTwoOfOneTruthTheNearestCountsTheOtherIsWrong) {
  const Match m = match(scene({0.9, 0.8}, {{5, 50, 50}, {2, 50, 50}}), 0);
  EXPECT_EQ(m.verdict, (std::vector{Verdict::Wrong, Verdict::Right}));
  // Above the nearer one's score there is only the other, and it is right.
  EXPECT_EQ(match(scene({0.9, 0.8}, {{5, 50, 50}, {2, 50, 50}}), 0.85).verdict,
            (std::vector{Verdict::Right, Verdict::Neutral}));
}

TEST(Matching, ASecondOneOfAHiddenTruthIsWrong) {
  const Match m = match(scene({0.9, 0.8}, {{50, 50, 3}, {50, 50, 4}}), 0);
  EXPECT_EQ(m.verdict, (std::vector{Verdict::Neutral, Verdict::Wrong}));
}

TEST(Matching, NearestIsMutual) {
  // The second is within A's threshold, but nearer to B, which has a nearer one.
  const Match m = match(scene({0.9, 0.8}, {{50, 1, 50}, {8, 6, 50}}), 0);
  EXPECT_EQ(m.verdict, (std::vector{Verdict::Right, Verdict::Wrong}));
}

TEST(Matching, ExactlyTheThresholdIsWrong) {
  EXPECT_EQ(match(scene({0.9}, {{10, 50, 50}}), 0).verdict.front(), Verdict::Wrong);
}

TEST(Matching, ACurveHasOnePointForEachScore) {
  const Curve curve = curve_of(scene({0.9, 0.9, 0.5}, {{1, 50, 50}, {50, 40, 60}, {50, 2, 50}}));
  ASSERT_EQ(curve.points.size(), 2U);
  EXPECT_FALSE(curve.nothing_to_find);
  EXPECT_DOUBLE_EQ(curve.points[0].precision, 0.5);
  EXPECT_DOUBLE_EQ(curve.points[0].recall, 0.5);
  EXPECT_DOUBLE_EQ(curve.points[1].precision, 2.0 / 3);
  EXPECT_DOUBLE_EQ(curve.points[1].recall, 1);
}

TEST(Matching, WithoutTruthsEverythingIsWrong) {
  JudgedScene empty;
  empty.scores = {0.4};
  empty.distance_mm.resize(1, 0);
  const Curve curve = curve_of(empty);
  EXPECT_TRUE(curve.nothing_to_find);
  ASSERT_EQ(curve.points.size(), 1U);
  EXPECT_DOUBLE_EQ(curve.points[0].precision, 0);
  EXPECT_DOUBLE_EQ(curve.points[0].recall, 1);
}
}  // namespace
}  // namespace binpick::bench
