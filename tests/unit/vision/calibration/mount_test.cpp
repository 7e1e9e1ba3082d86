#include "vision/calibration/mount.hpp"

#include <gtest/gtest.h>

#include "base/rotation.hpp"

namespace binpick::vision::calibration {
namespace {
using Eigen::Isometry3d;
using Eigen::Vector3d;

Isometry3d pose(const Vector3d& xyz_mm, const Vector3d& rpy_deg) {
  Isometry3d T = Isometry3d::Identity();
  T.linear() = from_wpr_deg(rpy_deg);
  T.translation() = xyz_mm;
  return T;
}

Mount pivot_mount() { return {true, pose({1200, 0, 1860}, {1, 90, 2}), pose({60, 5, -3}, {179, -89, 1})}; }
Mount flange_mount() { return {false, Isometry3d::Identity(), pose({10, 80, 120}, {20, -10, 30})}; }

struct MountSteps : testing::TestWithParam<Mount> {};
}  // namespace

TEST_P(MountSteps, DerivativesAreThoseOfTheStepsThemselves) {
  const Mount& mount = GetParam();
  const Isometry3d carrier = mount.on_pivot ? pivot_turned(Angle::deg(12)) : pose({900, -200, 1500}, {160, 10, 45});
  const Vector3d p{300, 0, 1700};
  const Eigen::Matrix3Xd shift = mount.shift_by_step(carrier, p), turn = mount.turn_by_step(carrier);
  constexpr double kStep = 1e-6;
  for (int i = 0; i < mount.unknowns(); ++i) {
    const Eigen::VectorXd step = kStep * Eigen::VectorXd::Unit(mount.unknowns(), i);
    const Isometry3d plus = mount.moved(step).T_base_scanner(carrier),
                     minus = mount.moved(-step).T_base_scanner(carrier);
    EXPECT_LT(((plus * p - minus * p) / (2 * kStep) - shift.col(i)).norm(), 1e-3) << i;
    const Eigen::Matrix3d R = plus.linear() * minus.linear().transpose();
    const Vector3d turned{R(2, 1) - R(1, 2), R(0, 2) - R(2, 0), R(1, 0) - R(0, 1)};
    EXPECT_LT((turned / (4 * kStep) - turn.col(i)).norm(), 1e-6) << i;
  }
}
INSTANTIATE_TEST_SUITE_P(Carriers, MountSteps, testing::Values(pivot_mount(), flange_mount()),
                         [](const auto& one) { return one.param.on_pivot ? "pivot" : "flange"; });

TEST(Mount, AShiftAlongThePivotsAxisAndATurnAboutItMayBeOnEitherSide) {
  const Mount mount = pivot_mount();
  const Isometry3d along = Eigen::Translation3d{0, 0, 7} * Isometry3d{Eigen::AngleAxisd{0.1, Vector3d::UnitZ()}};
  const Mount other{true, mount.T_base_root * along, along.inverse() * mount.T_carrier_scanner};
  const std::vector<SeenPoint> seen{{pivot_turned(Angle::deg(-16)), {-400, 0, 1500}},
                                    {pivot_turned(Angle::deg(16)), {400, 0, 1900}}};
  EXPECT_LT(apart_mm(mount, other, seen), 1e-9);
  EXPECT_GT(apart_mm(mount, mount.moved(Eigen::VectorXd::Unit(10, 0)), seen), 0.99);
}

TEST(Mount, APointOfTheBaseIsSeenWhereThePlaneMeetsIt) {
  const Mount mount = pivot_mount();
  const Vector3d place{1350, 220, 130};
  const auto seen = seen_from_pivot(mount, place);
  ASSERT_TRUE(seen.has_value());
  EXPECT_LT((mount.T_base_scanner(seen->T_root_carrier) * seen->p_scanner_mm - place).norm(), 1e-9);
  EXPECT_NEAR(seen->p_scanner_mm.y(), 0, 1e-9);
  EXPECT_GT(seen->p_scanner_mm.z(), 1000);
  // Nearer to the axis than the plane ever comes.
  EXPECT_FALSE(seen_from_pivot({true, Isometry3d::Identity(), pose({0, 50, 0}, {0, 0, 0})}, {10, 0, 0}).has_value());
}
}  // namespace binpick::vision::calibration
