#include "vision/depth_image.hpp"

#include <cmath>
#include <gtest/gtest.h>
#include <limits>
#include <random>

namespace binpick::vision {
namespace {
using Points = std::vector<Eigen::Vector3f>;

DepthImageBuilder small_builder() { return DepthImageBuilder{2.0, {-10, -6}, {10, 6}}; }

TEST(DepthImageBuilder, PixelCentresCoverTheWindow) {
  const DepthImage image = small_builder().image();
  EXPECT_EQ(image.z_mm.cols(), 10);
  EXPECT_EQ(image.z_mm.rows(), 6);
  EXPECT_DOUBLE_EQ(image.origin_mm.x(), -9.0);
  EXPECT_DOUBLE_EQ(image.origin_mm.y(), -5.0);
  EXPECT_TRUE(image.z_mm.isNaN().all());
}

TEST(DepthImageBuilder, ColumnsAreXAndRowsAreY) {
  DepthImageBuilder builder = small_builder();
  builder.add(Points{{-9.0F, 5.0F, 7.0F}});
  const DepthImage image = builder.image();
  EXPECT_EQ(image.z_mm(5, 0), 7.0F);
  EXPECT_EQ(builder.points(), 1U);
}

TEST(DepthImageBuilder, TheHighestSurfaceWinsInAnyOrder) {
  DepthImageBuilder builder = small_builder();
  builder.add(Points{{1, 1, 40}, {1, 1, 2}, {1, 1, 41}, {1, 1, 1}, {1, 1, 39}});
  EXPECT_NEAR(builder.image().z_mm(3, 5), 40.0, 1e-4);
  DepthImageBuilder reversed = small_builder();
  reversed.add(Points{{1, 1, 1}, {1, 1, 2}, {1, 1, 39}, {1, 1, 40}, {1, 1, 41}});
  EXPECT_NEAR(reversed.image().z_mm(3, 5), 40.0, 1e-4);
}

TEST(DepthImageBuilder, OneStrayPointOverAWellMeasuredSurfaceIsIgnored) {
  DepthImageBuilder builder = small_builder();
  builder.add(Points{{1, 1, 10}, {1, 1, 11}, {1, 1, 10}, {1, 1, 9}, {1, 1, 33}});
  EXPECT_NEAR(builder.image().z_mm(3, 5), 10.0, 1e-4);
}

// The mean of the surface, not its highest sample: more points must not lift a plane.
TEST(DepthImageBuilder, NoiseDoesNotLiftAPlaneHoweverManyPointsFallIntoAPixel) {
  std::mt19937 random{7};
  std::normal_distribution<float> noise{0.0F, 3.0F};
  for (const int points_per_pixel : {1, 4, 30}) {
    DepthImageBuilder builder{4.0, {-100, -100}, {100, 100}};
    Points points;
    for (int r = 0; r < 50; ++r)
      for (int c = 0; c < 50; ++c)
        for (int k = 0; k < points_per_pixel; ++k)
          points.emplace_back(-98.0F + 4.0F * static_cast<float>(c), -98.0F + 4.0F * static_cast<float>(r),
                              100.0F + noise(random));
    builder.add(points);
    EXPECT_NEAR(builder.image().z_mm.mean(), 100.0, 0.5) << points_per_pixel << " points per pixel";
  }
}

TEST(DepthImageBuilder, PointsThatAreNotFiniteOrOutsideAreIgnored) {
  constexpr float kNan = std::numeric_limits<float>::quiet_NaN(), kInf = std::numeric_limits<float>::infinity();
  DepthImageBuilder builder = small_builder();
  builder.add(
      Points{{kNan, 0, 1}, {0, kInf, 1}, {0, 0, kNan}, {0, 0, -kInf}, {1e30F, 0, 1}, {0, -1e30F, 1}, {11, 0, 1}});
  EXPECT_EQ(builder.points(), 0U);
  EXPECT_TRUE(builder.image().z_mm.isNaN().all());
}

TEST(DepthImageBuilder, HolesOfTwoPixelsAreBridgedThreeAreNot) {
  DepthImageBuilder builder{1.0, {0, 0}, {12, 1}};
  builder.add(Points{{0.5F, 0.5F, 10}, {3.5F, 0.5F, 13}, {7.5F, 0.5F, 13}});
  const DepthImage image = builder.image();
  EXPECT_NEAR(image.z_mm(0, 1), 11.0, 1e-4);
  EXPECT_NEAR(image.z_mm(0, 2), 12.0, 1e-4);
  EXPECT_TRUE(std::isnan(image.z_mm(0, 4)) && std::isnan(image.z_mm(0, 5)) && std::isnan(image.z_mm(0, 6)));
  EXPECT_TRUE(std::isnan(image.z_mm(0, 8)));
}

TEST(DepthImageBuilder, AHoleAtADepthJumpStaysAHole) {
  DepthImageBuilder builder{1.0, {0, 0}, {3, 1}};
  builder.add(Points{{0.5F, 0.5F, 0}, {2.5F, 0.5F, 30}});
  EXPECT_TRUE(std::isnan(builder.image().z_mm(0, 1)));
}

TEST(DepthImageBuilder, AHugeWindowIsCroppedAroundItsMiddle) {
  const DepthImage image = DepthImageBuilder{1.0, {-1e6, -1}, {1e6, 1}}.image();
  EXPECT_EQ(image.z_mm.cols(), DepthImageBuilder::kPixelsMax);
  EXPECT_NEAR(image.origin_mm.x(), -0.5 * (DepthImageBuilder::kPixelsMax - 1), 1e-6);
}

TEST(WindowOf, WildPointsDoNotStretchIt) {
  Points points;
  for (int i = 0; i <= 1000; ++i)
    points.emplace_back(0.1F * static_cast<float>(i), 0.05F * static_cast<float>(i), 0.0F);
  points.emplace_back(1e6F, 0.0F, 0.0F);
  points.emplace_back(std::numeric_limits<float>::quiet_NaN(), 0.0F, 0.0F);
  const DepthWindow window = window_of(points);
  EXPECT_NEAR(window.min_mm.x(), 0, 1e-4);
  EXPECT_NEAR(window.max_mm.x(), 100, 1e-4);
  EXPECT_NEAR(window.max_mm.y(), 50, 1e-4);
}

TEST(WindowOf, NoPointsGiveAnEmptyWindow) {
  const DepthWindow window = window_of(std::span<const Eigen::Vector3f>{});
  EXPECT_TRUE(window.min_mm.isZero() && window.max_mm.isZero());
}
}  // namespace
}  // namespace binpick::vision
