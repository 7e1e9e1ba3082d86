#include "bench/scenes/noise_truth.hpp"

#include <gtest/gtest.h>

#include "bench/scenes/precision.hpp"

namespace binpick::bench {
namespace {
using Eigen::Vector3d;

std::vector<Vector3d> chequered(double height_mm) {
  std::vector<Vector3d> points;
  for (int x = 0; x < 40; ++x)
    for (int y = 0; y < 40; ++y)
      points.push_back({5.0 + 10 * x, 5.0 + 10 * y, (x + y) % 2 == 0 ? height_mm : -height_mm});
  return points;
}

TEST(NoiseTruth, ResidualsAreTheRmsDistanceFromThePlane) {
  const auto residuals = plane_residuals(chequered(1), 30);
  ASSERT_FALSE(residuals.empty());
  EXPECT_NEAR(quantile(residuals, 0.5), 1, 0.01);
  EXPECT_NEAR(plane_residuals(chequered(0), 30).back(), 0, 1e-6);
}

TEST(NoiseTruth, CubesCutAPlaneThatLiesOnTheirFacesColumnsDoNot) {
  std::vector<Vector3d> points = chequered(1);
  for (const Vector3d& p : chequered(-1)) points.push_back(p + Vector3d{1, 0, 0});
  const Plane floor{Vector3d::UnitZ(), 0};
  EXPECT_EQ(cube_means(points, 10).size(), 3200U);
  const auto columns = column_means(points, floor, 10);
  EXPECT_EQ(columns.size(), 1600U);
  EXPECT_NEAR(plane_residuals(columns, 30).back(), 0, 1e-6);
}

TEST(NoiseTruth, TheLargestPlaneIsFoundAmongClutter) {
  std::vector<Vector3d> points = chequered(1);
  for (Vector3d& p : points) p.z() -= 800;
  for (int i = 0; i < 300; ++i) points.push_back({1.0 * i, 0.5 * i, -700.0 + i % 90});
  const Plane plane = largest_plane(points, 5);
  EXPECT_NEAR(plane.normal.z(), 1, 0.01);
  EXPECT_NEAR(plane.distance_mm, 800, 5);
  EXPECT_EQ(points_of(points, plane, 15).size(), 1600U);
}

TEST(NoiseTruth, ATableScanLiesOnTheTable) {
  TableScan scan;
  scan.table = {Vector3d{0, 0.6, 0.8}, 1000};
  scan.step_deg = scan.line_step_deg = 1;
  scan.lines = 41;
  scan.first_line = -20;
  const auto points = table_scan(scan);
  EXPECT_GT(points.size(), 200U);
  EXPECT_GT(static_cast<double>(points_of(points, scan.table, 15).size()), 0.98 * static_cast<double>(points.size()));
  EXPECT_LT(static_cast<double>(points_of(points, scan.table, 0.5).size()), 0.4 * static_cast<double>(points.size()));
}
}  // namespace
}  // namespace binpick::bench
