#include "vision/footprint.hpp"

#include <array>
#include <cmath>
#include <gtest/gtest.h>
#include <limits>
#include <numbers>
#include <random>

namespace binpick::vision {
namespace {
using Eigen::Vector3f;

const std::array<Vector3f, 8> kBox{Vector3f{-30, -10, 0}, {30, -10, 0}, {30, 10, 0}, {-30, 10, 0},
                                   {-30, -10, 5},         {30, -10, 5}, {30, 10, 5}, {-30, 10, 5}};

Footprint box_at(double x, double y, double turn_rad) {
  Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  T.translate(Eigen::Vector3d{x, y, 7}).rotate(Eigen::AngleAxisd{turn_rad, Eigen::Vector3d::UnitZ()});
  return footprint_of(kBox, T);
}

TEST(Footprint, IsTheOutlineCounterClockwise) {
  const Footprint footprint = box_at(0, 0, 0);
  ASSERT_EQ(footprint.corners_mm.size(), 4);
  double area = 0;
  for (std::size_t i = 0; i < 4; ++i) {
    const auto& a = footprint.corners_mm[i];
    const auto& b = footprint.corners_mm[(i + 1) % 4];
    area += (a.x() * b.y() - b.x() * a.y()) / 2;
  }
  EXPECT_NEAR(area, 60 * 20, 1e-6);
}

TEST(Footprint, GapsOfBoxes) {
  EXPECT_NEAR(gap_mm(box_at(0, 0, 0), box_at(75, 0, 0)), 15, 1e-6);
  EXPECT_NEAR(gap_mm(box_at(0, 0, 0), box_at(63, 24, 0)), 5, 1e-6) << "corner to corner";
  EXPECT_NEAR(gap_mm(box_at(0, 0, 0), box_at(0, 50, std::numbers::pi / 2)), 10, 1e-6) << "end to side";
  EXPECT_EQ(gap_mm(box_at(0, 0, 0), box_at(5, 2, 0.3)), 0) << "one over the other";
  EXPECT_EQ(gap_mm(box_at(0, 0, 0), box_at(0, 0, std::numbers::pi / 2)), 0) << "a cross: no corner lies in the other";
}

TEST(Footprint, OfAPointALineAndNothing) {
  const std::array<Vector3f, 1> point{Vector3f{3, 4, 9}};
  const std::array<Vector3f, 3> line{Vector3f{0, 0, 0}, {10, 0, 0}, {5, 0, 3}};
  const auto none = Eigen::Isometry3d::Identity();
  EXPECT_NEAR(gap_mm(footprint_of(point, none), footprint_of(line, none)), 4, 1e-6);
  EXPECT_EQ(gap_mm(footprint_of({}, none), footprint_of(line, none)), std::numeric_limits<double>::infinity());
}

TEST(Footprint, GapsAreThoseOfTheirPointsPutFinely) {
  std::mt19937_64 random{7};
  const auto uniform = [&](double low, double high) { return std::uniform_real_distribution{low, high}(random); };
  for (int round = 0; round < 100; ++round) {
    const Footprint a = box_at(0, 0, uniform(0, 3));
    const Footprint b = box_at(uniform(-90, 90), uniform(-90, 90), uniform(0, 3));
    // Points all over both.
    const auto filled = [](const Footprint& f) {
      std::vector<Eigen::Vector2d> points;
      const Eigen::Vector2d o = f.corners_mm[0], u = f.corners_mm[1] - o, v = f.corners_mm[3] - o;
      constexpr int kSteps = 25;
      for (int i = 0; i <= kSteps; ++i)
        for (int k = 0; k <= kSteps; ++k) points.push_back(o + (i * u + k * v) / kSteps);
      return points;
    };
    double least = std::numeric_limits<double>::infinity();
    for (const auto& p : filled(a))
      for (const auto& q : filled(b)) least = std::min(least, (p - q).norm());
    EXPECT_NEAR(gap_mm(a, b), least, 2.5);  // between two points of the finer ones
    EXPECT_LE(gap_mm(a, b), least + 1e-6);
  }
}
}  // namespace
}  // namespace binpick::vision
