#include "vision/registration.hpp"

#include <array>
#include <gtest/gtest.h>
#include <limits>
#include <numbers>

namespace binpick::vision {
namespace {
TEST(Registration, StraightAheadIsTheScannersZAxis) {
  std::vector<Eigen::Vector3f> points;
  const std::array<float, 3> x_mm{70.0F, 0.0F, -210.0F}, z_mm{70.0F, 200.0F, 215.0F};
  register_profile(x_mm, z_mm, {}, points);
  EXPECT_EQ(points, (std::vector<Eigen::Vector3f>{{70, 0, 70}, {0, 0, 200}, {-210, 0, 215}}));
}

TEST(Registration, NoEchoGivesNoPointAndPointsAreAppended) {
  std::vector<Eigen::Vector3f> points{{1, 2, 3}};
  constexpr float kNan = std::numeric_limits<float>::quiet_NaN(), kInf = std::numeric_limits<float>::infinity();
  const std::array<float, 6> x_mm{kNan, 0.0F, 3.0F, 1.0F, 7.0F, kInf}, z_mm{kNan, 0.0F, -5.0F, kInf, 100.0F, 5.0F};
  register_profile(x_mm, z_mm, {}, points);
  ASSERT_EQ(points.size(), 2U);
  EXPECT_EQ(points[1], Eigen::Vector3f(7, 0, 100));
}

// Scanner 200 mm beside the pivot's axis, looking down; the pivot turns about the base's y axis.
TEST(Registration, ThePivotTurnsTheScanPlaneAboutItsOwnZ) {
  ScannerMount mount;
  mount.T_base_pivot.iso.translation() = Eigen::Vector3d(0, 0, 2000);
  mount.T_base_pivot.iso.linear() = Eigen::AngleAxisd(-std::numbers::pi / 2, Eigen::Vector3d::UnitX()).matrix();
  mount.T_pivot_scanner.iso.translation() = Eigen::Vector3d(0, 200, 0);
  mount.T_pivot_scanner.iso.linear() = Eigen::AngleAxisd(-std::numbers::pi / 2, Eigen::Vector3d::UnitX()).matrix();
  // Pivot z is base y, pivot y is base -z; scanner z is pivot y.
  const Transform<frame::Base, frame::Scanner> T_straight = scanner_at(mount, Angle::rad(0));
  EXPECT_NEAR((T_straight * Eigen::Vector3d(0, 0, 1000) - Eigen::Vector3d(0, 0, 800)).norm(), 0, 1e-9);
  const Transform<frame::Base, frame::Scanner> T_turned = scanner_at(mount, Angle::deg(30));
  const Eigen::Vector3d hit = T_turned * Eigen::Vector3d(0, 0, 1000);
  EXPECT_NEAR(std::abs(hit.x()), 1200 * 0.5, 1e-6);
  EXPECT_NEAR(hit.z(), 2000 - 1200 * std::sqrt(0.75), 1e-6);
  EXPECT_NEAR(hit.y(), 0, 1e-9);
}

TEST(Registration, AProfileLandsInTheSupplyFrame) {
  Transform<frame::Supply, frame::Scanner> T_supply_scanner;
  T_supply_scanner.iso.translation() = Eigen::Vector3d(10, 20, 1800);
  T_supply_scanner.iso.linear() = Eigen::AngleAxisd(std::numbers::pi, Eigen::Vector3d::UnitX()).matrix();
  std::vector<Eigen::Vector3f> points;
  const std::array<float, 1> x_mm{0.0F}, z_mm{1750.0F};
  register_profile(x_mm, z_mm, T_supply_scanner, points);
  ASSERT_EQ(points.size(), 1U);
  EXPECT_NEAR((points[0] - Eigen::Vector3f(10, 20, 50)).norm(), 0, 1e-3);
}
}  // namespace
}  // namespace binpick::vision
