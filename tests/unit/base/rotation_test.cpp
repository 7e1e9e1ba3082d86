#include "base/rotation.hpp"

#include <Eigen/Geometry>
#include <cmath>
#include <gtest/gtest.h>
#include <numbers>
#include <random>
#include <vector>

namespace binpick {
namespace {
using Eigen::Matrix3d;
using Eigen::Vector3d;

struct Vector {
  Vector3d wpr_deg, oat_deg, rotation_vector;
  Eigen::Quaterniond quaternion;  // w, x, y, z
};

/// The same rotations in four notations, computed independently of this code (six decimals).
const std::vector<Vector>& vectors() {
  static const std::vector<Vector> all{
      {{10, 20, 30},
       {2.726830, 22.268744, 25.505550},
       {0.077525, 0.384852, 0.486479},
       {0.951549, 0.038135, 0.189308, 0.239298}},
      {{180, 0, 0}, {180, 180, 0}, {3.141593, 0, 0}, {0, 1, 0, 0}},
      {{180, 0, 45}, {-135, 180, 0}, {2.902453, 1.202235, 0}, {0, 0.923880, 0.382683, 0}},
      {{-90, 0, 90}, {180, 90, -90}, {-1.209200, -1.209200, 1.209200}, {0.5, -0.5, -0.5, 0.5}},
      {{30, 90, 0}, {-30, 90, 0}, {0.410380, 1.531560, -0.410380}, {0.683013, 0.183013, 0.683013, -0.183013}},
      {{180, 0, -150}, {30, 180, 0}, {-0.813104, 3.034545, 0}, {0, -0.258819, 0.965926, 0}},
      {{175, -12, -100},
       {-122.821223, 167.014115, 157.704628},
       {1.869026, -2.248291, 0.099737},
       {0.107882, 0.635165, -0.764054, 0.033894}},
  };
  return all;
}

/// Largest difference, of angles in degrees modulo a full turn.
double apart_deg(const Vector3d& a, const Vector3d& b) {
  double worst = 0;
  for (int i = 0; i < 3; ++i) worst = std::max(worst, std::abs(std::remainder(a[i] - b[i], 360.0)));
  return worst;
}

void expect_round_trips(const Matrix3d& R) {
  EXPECT_LT((from_rotation_vector(to_rotation_vector(R)) - R).cwiseAbs().maxCoeff(), 2e-14) << R;
  EXPECT_LT((from_wpr_deg(to_wpr_deg(R)) - R).cwiseAbs().maxCoeff(), 1e-8) << R;
  EXPECT_LT((from_oat_deg(to_oat_deg(R)) - R).cwiseAbs().maxCoeff(), 1e-8) << R;
  EXPECT_LE(to_rotation_vector(R).norm(), std::numbers::pi + 1e-12);
}
}  // namespace

TEST(Rotation, TestVectorsBothWays) {
  for (const Vector& v : vectors()) {
    const Matrix3d R = v.quaternion.normalized().toRotationMatrix();
    EXPECT_LT((from_wpr_deg(v.wpr_deg) - R).cwiseAbs().maxCoeff(), 3e-6) << v.wpr_deg.transpose();
    EXPECT_LT((from_oat_deg(v.oat_deg) - R).cwiseAbs().maxCoeff(), 3e-6) << v.oat_deg.transpose();
    EXPECT_LT((from_rotation_vector(v.rotation_vector) - R).cwiseAbs().maxCoeff(), 3e-6)
        << v.rotation_vector.transpose();
    const Matrix3d exact = from_wpr_deg(v.wpr_deg);
    EXPECT_LT(apart_deg(to_wpr_deg(exact), v.wpr_deg), 2e-6) << to_wpr_deg(exact).transpose();
    EXPECT_LT(apart_deg(to_oat_deg(exact), v.oat_deg), 2e-6) << to_oat_deg(exact).transpose();
    // Half a turn has two vectors, of opposite sign.
    const Vector3d back = to_rotation_vector(exact);
    const bool half_turn = v.rotation_vector.norm() > std::numbers::pi - 1e-5;
    const double apart = (back - v.rotation_vector).norm();
    EXPECT_LT(half_turn ? std::min(apart, (back + v.rotation_vector).norm()) : apart, 2e-6) << back.transpose();
  }
}

TEST(Rotation, KawasakiNamesTheStraightDownToolOnce) {
  // 40, 180, 10 is the same rotation as 30, 180, 0: only O - T is defined.
  EXPECT_LT((from_oat_deg({40, 180, 10}) - from_oat_deg({30, 180, 0})).norm(), 1e-14);
  EXPECT_LT(apart_deg(to_oat_deg(from_oat_deg({40, 180, 10})), {30, 180, 0}), 1e-9);
  EXPECT_LT(apart_deg(to_oat_deg(from_oat_deg({40, 0, 10})), {50, 0, 0}), 1e-9);
}

TEST(Rotation, FanucNamesTheGimbalPoseOnce) {
  EXPECT_LT(apart_deg(to_wpr_deg(from_wpr_deg({40, 90, 10})), {30, 90, 0}), 1e-6);
  EXPECT_LT(apart_deg(to_wpr_deg(from_wpr_deg({40, -90, 10})), {50, -90, 0}), 1e-6);
}

TEST(Rotation, RotationVectorOfNoTurnAndOfAlmostHalfATurn) {
  EXPECT_EQ(to_rotation_vector(Matrix3d::Identity()), Vector3d::Zero());
  EXPECT_LT((to_rotation_vector(from_rotation_vector({1e-7, -2e-7, 3e-7})) - Vector3d{1e-7, -2e-7, 3e-7}).norm(),
            1e-15);
  for (const double below_pi : {1e-3, 1e-6, 1e-9, 0.0})
    for (const Vector3d& direction :
         {Vector3d{1, 0, 0}, Vector3d{0, -1, 0}, Vector3d{1, 2, -3}, Vector3d{-1, 1e-9, 1}}) {
      const Vector3d v = (std::numbers::pi - below_pi) * direction.normalized();
      const Vector3d back = to_rotation_vector(from_rotation_vector(v));
      EXPECT_LT(std::min((back - v).norm(), below_pi < 1e-8 ? (back + v).norm() : 1.0), 1e-8) << v.transpose();
    }
}

TEST(Rotation, LongRotationVectorIsTheSameRotation) {
  const Vector3d v{0.3, -0.4, 1.2};
  const Vector3d other = -(2 * std::numbers::pi - v.norm()) * v.normalized();
  EXPECT_LT((from_rotation_vector(other) - from_rotation_vector(v)).norm(), 1e-14);
}

TEST(Rotation, TwentyThousandRandomRoundTrips) {
  std::mt19937 random{20260101};
  std::normal_distribution<double> normal;
  for (int i = 0; i < 20'000; ++i) {
    const Eigen::Quaterniond q{normal(random), normal(random), normal(random), normal(random)};
    expect_round_trips(q.normalized().toRotationMatrix());
    if (HasFailure()) FAIL() << "draw " << i;
  }
}

TEST(Rotation, RoundTripsOnAndAroundTheSingularPoses) {
  for (const double offset_deg : {0.0, 1e-12, 1e-9, 1e-7, 1e-5, 1e-3})
    for (const double p : {-90.0, 90.0})
      for (const double w : {-170.0, -45.0, 0.0, 60.0}) {
        expect_round_trips(from_wpr_deg({w, p - offset_deg, 25}));
        expect_round_trips(from_oat_deg({w, p + 90 + offset_deg, 25}));
      }
}
}  // namespace binpick
