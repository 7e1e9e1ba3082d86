#include "vision/calibration/sphere_search.hpp"

#include <gtest/gtest.h>
#include <limits>

#include "tests/support/sphere_scans.hpp"

namespace binpick::vision::calibration {
namespace {
using support::SphereCarrier;
using support::SphereScanner;

struct Search : testing::TestWithParam<std::tuple<SphereScanner, SphereCarrier>> {
  support::EmulatedScans emulated = support::scan_spheres(
      {.scanner = std::get<0>(GetParam()), .carrier = std::get<1>(GetParam()), .scans = 1, .seed = 21});
};
}  // namespace

TEST_P(Search, FindsTheSphereBesideRodGripperAndWalls) {
  for (const SphereScan& scan : emulated.question.scans) {
    const auto sight = find_sphere(scan, emulated.truth, emulated.question.sphere_radius_mm);
    ASSERT_TRUE(sight.has_value()) << sight.error();
    // Its points lie on it, most of them, and they are many.
    EXPECT_GT(sight->points, 200U);
    std::size_t near = 0;
    for (const auto& line : sight->lines) near += line.points_mm.size();
    EXPECT_GT(near, sight->points);
  }
}

TEST_P(Search, AWrongMountOnlyMovesIt) {
  Eigen::VectorXd step = Eigen::VectorXd::Zero(emulated.truth.unknowns());
  step.tail<6>() << 50, -60, 50, 0.1, -0.1, 0.1;
  const Mount wrong = emulated.truth.moved(step);
  for (const SphereScan& scan : emulated.question.scans) {
    const auto right = find_sphere(scan, emulated.truth, emulated.question.sphere_radius_mm);
    const auto sight = find_sphere(scan, wrong, emulated.question.sphere_radius_mm);
    ASSERT_TRUE(right.has_value()) << right.error();
    ASSERT_TRUE(sight.has_value()) << sight.error();
    // The same place in the scanner's own field.
    const auto& middle = right->lines[right->lines.size() / 2].T_root_carrier;
    const Eigen::Vector3d there = emulated.truth.T_base_scanner(middle).inverse() * right->centre_mm,
                          here = wrong.T_base_scanner(middle).inverse() * sight->centre_mm;
    EXPECT_LT((there - here).norm(), 0.3 * emulated.question.sphere_radius_mm);
  }
}

TEST_P(Search, WithoutItsPointsThereIsNoSphere) {
  SphereScan scan = emulated.question.scans.front();
  const auto sight = find_sphere(scan, emulated.truth, emulated.question.sphere_radius_mm);
  ASSERT_TRUE(sight.has_value()) << sight.error();
  for (CarriedProfile& profile : scan.profiles) {
    const Eigen::Vector3d centre = emulated.truth.T_base_scanner(profile.T_root_carrier).inverse() * sight->centre_mm;
    for (std::size_t i = 0; i < profile.x_mm.size(); ++i)
      if ((Eigen::Vector3d{profile.x_mm[i], 0, profile.z_mm[i]} - centre).norm() <
          1.2 * emulated.question.sphere_radius_mm)
        profile.x_mm[i] = profile.z_mm[i] = std::numeric_limits<float>::quiet_NaN();
  }
  const auto none = find_sphere(scan, emulated.truth, emulated.question.sphere_radius_mm);
  ASSERT_FALSE(none.has_value()) << none->centre_mm.transpose() << ", " << sight->centre_mm.transpose();
  EXPECT_TRUE(none.error().starts_with("scan 1: no sphere of ")) << none.error();
  EXPECT_TRUE(none.error().ends_with("; it must be seen whole, and be of the diameter that --sphere-mm says"))
      << none.error();
}

INSTANTIATE_TEST_SUITE_P(Scanners, Search,
                         testing::Combine(testing::Values(SphereScanner::Lms400, SphereScanner::Lps36),
                                          testing::Values(SphereCarrier::Pivot, SphereCarrier::Robot)));

TEST(SphereSearch, AnEmptyScanHasHardlyAPoint) {
  SphereScan scan;
  scan.name = "a.record";
  const auto none = find_sphere(scan, {}, 30);
  ASSERT_FALSE(none.has_value());
  EXPECT_EQ(none.error(), "a.record: the scan has hardly a point");
}
}  // namespace binpick::vision::calibration
