#include "bench/production/displacement.hpp"

#include <algorithm>
#include <cmath>
#include <gtest/gtest.h>

namespace binpick::bench {
namespace {
TEST(Displacement, FillsItsRangeAndStaysInIt) {
  double x = 0, y = 0, turn = 0, x_sum = 0;
  for (std::uint64_t bin = 1; bin <= 400; ++bin) {
    const Displacement by = displacement_of(bin, 1, 80);
    x = std::max(x, std::abs(by.x_mm));
    y = std::max(y, std::abs(by.y_mm));
    turn = std::max(turn, std::abs(by.turn_deg));
    x_sum += by.x_mm;
  }
  EXPECT_LE(std::max(x, y), 80);
  EXPECT_GT(std::min(x, y), 75);
  EXPECT_LE(turn, 10);
  EXPECT_GT(turn, 9.3);
  EXPECT_NEAR(x_sum / 400, 0, 8);
}

TEST(Displacement, IsOfBinAndSeed) {
  EXPECT_EQ(displacement_of(3, 1, 80).x_mm, displacement_of(3, 1, 80).x_mm);
  EXPECT_NE(displacement_of(3, 1, 80).x_mm, displacement_of(4, 1, 80).x_mm);
  EXPECT_NE(displacement_of(3, 1, 80).x_mm, displacement_of(3, 2, 80).x_mm);
  EXPECT_EQ(displacement_of(3, 1, 0).turn_deg, 0);
}

TEST(Displacement, RightPicksWithinAPointOfThoseInPlace) {
  LocatedComparison comparison;
  comparison.displaced.picks = comparison.centred.picks = 1000;
  comparison.centred.taken = 970;
  comparison.displaced.taken = 960;
  EXPECT_TRUE(comparison.meets_must());
  EXPECT_NEAR(comparison.by_chance(), std::sqrt(97 * 3 / 1000.0 + 96 * 4 / 1000.0), 1e-9);
  comparison.displaced.taken = 959;
  EXPECT_FALSE(comparison.meets_must());
  EXPECT_NE(to_table(comparison).find("-1.10 points"), std::string::npos) << to_table(comparison);
  comparison.displaced.taken = 1000;
  EXPECT_TRUE(comparison.meets_must()) << "better is no miss";
}
}  // namespace
}  // namespace binpick::bench
