#include "vision/feature.hpp"

#include <cmath>
#include <gtest/gtest.h>
#include <random>

namespace binpick::vision {
namespace {
constexpr float kNan = std::numeric_limits<float>::quiet_NaN();

DepthImage image_from(int rows, int cols, const std::function<float(int, int)>& z) {
  DepthImage image;
  image.z_mm.resize(rows, cols);
  for (int r = 0; r < rows; ++r)
    for (int c = 0; c < cols; ++c) image.z_mm(r, c) = z(r, c);
  return image;
}
std::uint32_t feature_at(const DepthImage& image, const FeatureRule& rule, int row, int col) {
  return features_of(image, rule)[static_cast<std::size_t>(row * image.z_mm.cols() + col)];
}

TEST(Feature, RingIsTheTwelveNeighboursAndClosedUnderQuarterTurns) {
  int axes = 0, diagonals = 0;
  for (const PixelOffset& o : kRing) {
    const int longer = std::max(std::abs(o.dx), std::abs(o.dy)), shorter = std::min(std::abs(o.dx), std::abs(o.dy));
    axes += shorter == 0 && (longer == 1 || longer == 3);
    diagonals += shorter == 2 && longer == 2;
    EXPECT_TRUE(std::ranges::any_of(kRing, [&](const PixelOffset& p) { return p.dx == -o.dy && p.dy == o.dx; }));
  }
  EXPECT_EQ(axes, 8);
  EXPECT_EQ(diagonals, 4);
}

TEST(Feature, EachNeighbourHasItsOwnDigit) {
  for (const int stride : {1, 2})
    for (std::size_t i = 0; i < kRing.size(); ++i)
      for (const float step : {-5.0F, 5.0F, 0.9F, -0.9F}) {
        DepthImage image = image_from(15, 15, [](int, int) { return 100.0F; });
        image.z_mm(7 + kRing[i].dy * stride, 7 + kRing[i].dx * stride) += step;
        const std::uint32_t digit = step > 1 ? kHigher : step < -1 ? kLower : kEqual;
        EXPECT_EQ(feature_at(image, {1.0F, stride}, 7, 7), digit * kDigit[i]);
      }
}

TEST(Feature, HeightAloneChangesNothing) {
  const auto hill = [](float base) {
    return image_from(9, 9, [base](int r, int c) { return base + 0.4F * static_cast<float>(r * c % 7); });
  };
  EXPECT_EQ(features_of(hill(0), {1.0F, 1}), features_of(hill(250), {1.0F, 1}));
}

TEST(Feature, MissingNeighboursCountAsLowerUpToALimit) {
  DepthImage image = image_from(7, 7, [](int, int) { return 10.0F; });
  std::uint32_t expected = 0;
  for (std::size_t i = 0; i < kRing.size(); ++i) {
    image.z_mm(3 + kRing[i].dy, 3 + kRing[i].dx) = kNan;
    expected += kLower * kDigit[i];
    EXPECT_EQ(feature_at(image, {1.0F, 1}, 3, 3), static_cast<int>(i) < kMissingMax ? expected : kNoFeature);
  }
  image.z_mm(3, 3) = kNan;
  EXPECT_EQ(feature_at(image, {1.0F, 1}, 3, 3), kNoFeature);
}

TEST(Feature, TheBorderIsSeenLikeMissingPixels) {
  std::mt19937 random(1);
  std::uniform_real_distribution<float> height(0, 4);
  const DepthImage image = image_from(12, 17, [&](int, int) { return height(random); });
  const int margin = 2 * kRingReach;
  const DepthImage framed = image_from(12 + 2 * margin, 17 + 2 * margin, [&](int r, int c) {
    const bool inside = r >= margin && c >= margin && r < 12 + margin && c < 17 + margin;
    return inside ? image.z_mm(r - margin, c - margin) : kNan;
  });
  for (int r = 0; r < 12; ++r)
    for (int c = 0; c < 17; ++c)
      EXPECT_EQ(feature_at(image, {1.0F, 2}, r, c), feature_at(framed, {1.0F, 2}, r + margin, c + margin));
}

TEST(Feature, SmoothingTakesNoiseAndLeavesEdges) {
  std::mt19937 random(1);
  std::normal_distribution<float> noise(0, 1);
  const DepthImage image = image_from(60, 60, [&](int, int c) { return (c < 30 ? 0.0F : 50.0F) + noise(random); });
  const DepthImage smooth = smoothed(image, smoothing_jump_mm(1, 1));
  double sum = 0;
  for (int r = 1; r < 59; ++r)
    for (int c = 1; c < 59; ++c) {
      const double d = double{smooth.z_mm(r, c)} - (c < 30 ? 0 : 50);
      EXPECT_LT(std::abs(d), 3);
      sum += d * d;
    }
  EXPECT_LT(std::sqrt(sum / (58 * 58)), 0.45);
  DepthImage holed = image;
  holed.z_mm(5, 5) = kNan;
  EXPECT_TRUE(std::isnan(smoothed(holed, 4).z_mm(5, 5)));
}
}  // namespace
}  // namespace binpick::vision
