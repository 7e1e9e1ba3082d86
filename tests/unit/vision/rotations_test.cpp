#include "vision/rotations.hpp"

#include <gtest/gtest.h>
#include <numbers>
#include <random>

#include "tests/unit/vision/shapes.hpp"

namespace binpick::vision {
namespace {
constexpr double kDeg = std::numbers::pi / 180;

Eigen::Quaterniond random_rotation(std::mt19937_64& random) {
  std::normal_distribution<double> normal;
  return Eigen::Quaterniond(normal(random), normal(random), normal(random), normal(random)).normalized();
}

/// Angle from random rotations to the nearest of the set, the symmetry minded: mean and largest of 300, degrees.
std::pair<double, double> gaps_deg(const std::vector<Eigen::Quaterniond>& set, const Symmetry& symmetry) {
  std::mt19937_64 random(4);
  double sum = 0, most = 0;
  for (int i = 0; i < 300; ++i) {
    Eigen::Isometry3d P = Eigen::Isometry3d::Identity(), Q = P;
    P.linear() = random_rotation(random).toRotationMatrix();
    double least = 10;
    for (const auto& q : set) {
      Q.linear() = q.toRotationMatrix();
      least = std::min(least, pose_distance(P, Q, symmetry, 1).angle_rad);
    }
    sum += least / kDeg;
    most = std::max(most, least / kDeg);
  }
  return {sum / 300, most};
}

TEST(Rotations, AreSpreadAsTheSourceSays) {
  const auto set = training_rotations(4608, {});
  ASSERT_EQ(set.size(), 4608U);
  const auto [mean, most] = gaps_deg(set, {});
  EXPECT_NEAR(mean, 7.5, 0.4);
  EXPECT_LT(most, 13);
}

TEST(Rotations, SymmetryLeavesItsShareAndNoGap) {
  const Symmetry box = find_symmetry(shapes::box(60, 40, 20), 0.3);
  ASSERT_EQ(box.rotations.size(), 4U);
  const auto set = training_rotations(4608, box);
  EXPECT_NEAR(static_cast<double>(set.size()), 4608 / 4.0, 60);
  const auto [mean, most] = gaps_deg(set, box);
  EXPECT_NEAR(mean, 7.5, 0.5);
  EXPECT_LT(most, 15.5);
}

TEST(Rotations, ARevolutionLeavesDirectionsOfItsAxis) {
  Symmetry turned;
  turned.kind = Symmetry::Kind::Revolution;
  turned.axis = Eigen::Vector3d(1, 1, 0).normalized();
  const auto set = training_rotations(20'000, turned);
  EXPECT_EQ(set.size(), 2500U);
  EXPECT_LT(gaps_deg(set, turned).second, 4);
  Symmetry flip = turned;
  flip.kind = Symmetry::Kind::RevolutionFlip;
  const auto half = training_rotations(20'000, flip);
  EXPECT_NEAR(static_cast<double>(half.size()), 1250, 2);
  EXPECT_LT(gaps_deg(half, flip).second, 4);
}

TEST(Rotations, ASphereHasOneView) {
  Symmetry sphere;
  sphere.kind = Symmetry::Kind::Sphere;
  EXPECT_EQ(training_rotations(10'000, sphere).size(), 1U);
}
}  // namespace
}  // namespace binpick::vision
