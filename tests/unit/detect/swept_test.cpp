#include "vision/swept.hpp"

#include <gtest/gtest.h>
#include <numbers>
#include <random>

namespace binpick::vision {
namespace {
using Eigen::Vector3d;

double even(std::mt19937& random, double low, double high) { return std::uniform_real_distribution{low, high}(random); }

struct Motion {
  Gripper::Solid solid;
  Eigen::Isometry3d T_a_tcp;
  Vector3d way_mm;
};

Eigen::Isometry3d any_pose(std::mt19937& random, double reach_mm) {
  Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  T.linear() = Eigen::Quaterniond{even(random, -1, 1), even(random, -1, 1), even(random, -1, 1), even(random, -1, 1)}
                   .normalized()
                   .toRotationMatrix();
  T.translation() =
      Vector3d{even(random, -reach_mm, reach_mm), even(random, -reach_mm, reach_mm), even(random, -reach_mm, reach_mm)};
  return T;
}

/// Every other one along its own z axis, as jaws move; every third stands still.
Motion any_motion(std::mt19937& random, int k) {
  Motion motion;
  motion.solid.shape = k % 2 == 0 ? Gripper::Solid::Shape::Box : Gripper::Solid::Shape::Cylinder;
  motion.solid.size_mm = {even(random, 5, 60), even(random, 5, 60), even(random, 5, 120)};
  if (k % 2 == 1) motion.solid.size_mm.y() = motion.solid.size_mm.x();
  motion.T_a_tcp = any_pose(random, 100);
  if (k % 4 < 2) motion.solid.T_tcp_solid = any_pose(random, 50);
  if (k % 3 != 0) motion.way_mm = -even(random, 1, 150) * motion.T_a_tcp.linear().col(2);
  if (k % 3 == 0) motion.way_mm.setZero();
  return motion;
}

/// A point of the solid itself somewhere on its way.
Vector3d any_point(std::mt19937& random, const Motion& motion) {
  Vector3d p = 0.5 * motion.solid.size_mm;
  if (motion.solid.shape == Gripper::Solid::Shape::Box) {
    for (double& x : p) x *= even(random, -1, 1);
  } else {
    const double angle = even(random, 0, 2 * std::numbers::pi), r = p.x() * std::sqrt(even(random, 0, 1));
    p = {r * std::cos(angle), r * std::sin(angle), p.z() * even(random, -1, 1)};
  }
  return motion.T_a_tcp * (motion.solid.T_tcp_solid * p) + even(random, 0, 1) * motion.way_mm;
}
}  // namespace

TEST(Swept, HoldsAllPointsOfASolidOnItsWay) {
  std::mt19937 random{1};
  for (int k = 0; k < 300; ++k) {
    const Motion motion = any_motion(random, k);
    const Swept swept{motion.solid, motion.T_a_tcp, motion.way_mm, 1e-3};
    for (int i = 0; i < 200; ++i) {
      const Vector3d p = any_point(random, motion);
      ASSERT_TRUE(swept.contains(p));
      const Swept::Span span = swept.at(static_cast<float>(p.x()), static_cast<float>(p.y()));
      ASSERT_LE(span.low, p.z() + 0.01);
      ASSERT_GE(span.high, p.z() - 0.01);
      for (Eigen::Index axis = 0; axis < 3; ++axis) {
        const Swept::Range range = swept.along(Vector3d::Unit(axis));
        ASSERT_TRUE(range.least <= p[axis] && p[axis] <= range.greatest);
      }
    }
  }
}

TEST(Swept, HoldsLittleElse) {
  std::mt19937 random{2};
  for (int k = 0; k < 300; ++k) {
    const Motion motion = any_motion(random, k);
    const Swept swept{motion.solid, motion.T_a_tcp, motion.way_mm};
    // A point of it is a point of the solid somewhere on its way, but for the prism's corners.
    const Eigen::Isometry3d T_solid_a = (motion.T_a_tcp * motion.solid.T_tcp_solid).inverse();
    for (int i = 0; i < 50; ++i) {
      Vector3d p = swept.middle_mm();
      for (const Vector3d& edge : swept.edges_mm()) p += even(random, -1, 1) * edge;
      ASSERT_TRUE(swept.contains(p + 1e-9 * (swept.middle_mm() - p)));
      double nearest = 1e9;
      for (int step = 0; step <= 300; ++step) {
        const Vector3d q = T_solid_a * (p - motion.way_mm * step / 300.0);
        const Vector3d half = 0.5 * motion.solid.size_mm;
        const double across = motion.solid.shape == Gripper::Solid::Shape::Box
                                  ? std::max(std::abs(q.x()) - half.x(), std::abs(q.y()) - half.y())
                                  : q.head<2>().norm() - half.x();
        nearest = std::min(nearest, std::max(across, std::abs(q.z()) - half.z()));
      }
      ASSERT_LT(nearest, 0.021 * 0.5 * motion.solid.size_mm.x() + 0.3) << k;
    }
  }
}

TEST(Swept, SpansAreWithinTheirBounds) {
  std::mt19937 random{3};
  for (int k = 0; k < 200; ++k) {
    const Motion motion = any_motion(random, k);
    const Swept swept{motion.solid, motion.T_a_tcp, motion.way_mm};
    for (int i = 0; i < 100; ++i) {
      const Vector3d middle = any_point(random, motion) + Vector3d::Random() * 20;
      const double half_x = even(random, 0, 20), half_y = even(random, 0, 20);
      const auto f = [](double v) { return static_cast<float>(v); };
      const Swept::Span bound = swept.over(f(middle.x()), f(middle.y()), f(half_x), f(half_y));
      const Swept::Span span =
          swept.at(f(middle.x() + even(random, -half_x, half_x)), f(middle.y() + even(random, -half_y, half_y)));
      if (span.empty()) continue;
      ASSERT_FALSE(bound.empty());
      ASSERT_LE(bound.low, span.low + 0.01F);
      ASSERT_GE(bound.high, span.high - 0.01F);
    }
  }
}

TEST(Swept, MeetsATriangleThatHasAPointInIt) {
  std::mt19937 random{4};
  int met = 0;
  for (int k = 0; k < 400; ++k) {
    const Motion motion = any_motion(random, k);
    const Swept swept{motion.solid, motion.T_a_tcp, motion.way_mm};
    std::array<Vector3d, 3> triangle;
    for (Vector3d& corner : triangle) corner = any_point(random, motion) + 100 * Vector3d::Random();
    bool inside = false;
    for (int i = 0; i < 2000 && !inside; ++i) {
      double a = even(random, 0, 1), b = even(random, 0, 1);
      if (a + b > 1) a = 1 - a, b = 1 - b;
      inside = swept.contains(triangle[0] + a * (triangle[1] - triangle[0]) + b * (triangle[2] - triangle[0]));
    }
    const bool meets = swept.meets(triangle);
    ASSERT_TRUE(meets || !inside) << k;
    met += meets ? 1 : 0;
    // Beyond one of its faces there is nothing to meet.
    const Vector3d away = 1000 * Vector3d::Random().normalized();
    for (Vector3d& corner : triangle) corner += away;
    ASSERT_FALSE(swept.meets(triangle));
  }
  EXPECT_GT(met, 100);
  EXPECT_LT(met, 400);
}
}  // namespace binpick::vision
