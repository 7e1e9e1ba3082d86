#include "bench/scenes/pose_measure.hpp"

#include <cmath>
#include <gtest/gtest.h>
#include <limits>
#include <numbers>
#include <random>

#include "bench/scenes/parts.hpp"
#include "tests/emulators/world/shapes.hpp"
#include "tests/emulators/world/world.hpp"

namespace binpick::bench {
namespace {
using Eigen::Isometry3d;
using Eigen::Matrix3d;
using Eigen::Vector3d;
using Matrix6 = Eigen::Matrix<double, 6, 6>;
using Kind = vision::Symmetry::Kind;
constexpr double kPi = std::numbers::pi;

Isometry3d random_pose(std::mt19937& random) {
  std::normal_distribution<double> normal;
  Isometry3d T = Isometry3d::Identity();
  T.linear() = Eigen::Quaterniond{normal(random), normal(random), normal(random), normal(random)}
                   .normalized()
                   .toRotationMatrix();
  T.translation() = 30 * Vector3d{normal(random), normal(random), normal(random)};
  return T;
}

/// Root of the mean squared displacement of the surface, by points strewn over it.
double strewn_distance(const vision::Mesh& mesh, const Isometry3d& a, const Isometry3d& b) {
  double sum = 0, area = 0;
  constexpr int n = 6;
  for (const auto& corners : mesh.triangles) {
    const Vector3d p = mesh.vertices_mm[corners[0]].cast<double>(), q = mesh.vertices_mm[corners[1]].cast<double>(),
                   r = mesh.vertices_mm[corners[2]].cast<double>();
    const double piece = 0.5 * (q - p).cross(r - p).norm() / (n * n);
    for (int i = 0; i < n; ++i)
      for (int j = 0; j < n - i; ++j)
        for (const double third : {1.0 / 3, 2.0 / 3}) {
          const double u = (i + third) / n, v = (j + third) / n;
          if (u + v > 1) continue;
          const Vector3d x = p + u * (q - p) + v * (r - p);
          sum += piece * (a * x - b * x).squaredNorm();
          area += piece;
        }
  }
  return std::sqrt(sum / area);
}

TEST(PoseMeasure, OfACubeByHand) {
  // Surface covariance of a cube of edge 2a about each axis: (4 sides · a²/3 + 2 sides · a²) / 6 = 5 a² / 9.
  const vision::Mesh cube = emulators::box_mesh({12, 12, 12});
  vision::Symmetry none;
  const PoseMeasure measure{cube, none};
  EXPECT_NEAR((measure.spread_mm() - Matrix3d::Identity() * 6 * std::sqrt(5.0 / 9)).norm(), 0, 1e-9);
  Isometry3d b = Isometry3d::Identity();
  b.translation() = Vector3d{3, 4, 0};
  EXPECT_NEAR(measure.distance_mm(Isometry3d::Identity(), b), 5, 1e-9);
  // Half a turn about z moves each point by twice its distance from the axis: mean square 4 · 2 · 20.
  Isometry3d half = Isometry3d::Identity();
  half.linear() = Eigen::AngleAxisd{kPi, Vector3d::UnitZ()}.toRotationMatrix();
  EXPECT_NEAR(measure.distance_mm(Isometry3d::Identity(), half), std::sqrt(160.0), 1e-9);
}

TEST(PoseMeasure, IsTheMeanDisplacementOfTheSurface) {
  std::mt19937 random{3};
  for (const std::string name : {"track_link", "contact_bridge"}) {
    const vision::Mesh mesh = emulators::example_part(name).mesh;
    const PoseMeasure measure{mesh, vision::Symmetry{}};
    for (int i = 0; i < 5; ++i) {
      const Isometry3d a = random_pose(random), b = random_pose(random);
      EXPECT_NEAR(measure.distance_mm(a, b), strewn_distance(mesh, a, b), 0.02 * measure.distance_mm(a, b)) << name;
    }
  }
}

TEST(PoseMeasure, AFiniteGroupIsTriedInFull) {
  const ScenePart wheel = scene_part(vision::ScannerClass::Lms400, "steering_wheel");
  const PoseMeasure measure{wheel.body.mesh, judged_symmetry(wheel.body.mesh, 3)};
  ASSERT_EQ(measure.symmetry().kind, Kind::Finite);
  // What is symmetric has a spread that the group leaves alone.
  for (const Matrix3d& g : measure.symmetry().rotations)
    EXPECT_NEAR((g * measure.spread_mm() - measure.spread_mm() * g).norm() / measure.spread_mm().norm(), 0, 0.01);
  std::mt19937 random{5};
  for (int i = 0; i < 20; ++i) {
    const Isometry3d a = random_pose(random), b = random_pose(random);
    double least = std::numeric_limits<double>::infinity();
    for (const Matrix3d& g : measure.symmetry().rotations) {
      Isometry3d moved = a;
      moved.linear() = a.linear() * g;
      moved.translation() = a * measure.centroid_mm() - moved.linear() * measure.centroid_mm();
      least = std::min(least, PoseMeasure{wheel.body.mesh, vision::Symmetry{}}.distance_mm(moved, b));
    }
    EXPECT_NEAR(measure.distance_mm(a, b), least, 1e-6);
    EXPECT_NEAR(measure.distance_mm(a, b), measure.distance_mm(b, a), 1e-3 * least);
  }
}

// The closed form of a revolution against the least over 3600 angles.
TEST(PoseMeasure, ARevolutionIsTheLeastOverAllAngles) {
  const ScenePart nozzle = scene_part(vision::ScannerClass::Lps36Hi, "nozzle");
  const PoseMeasure measure{nozzle.body.mesh, judged_symmetry(nozzle.body.mesh, 0.12)};
  ASSERT_EQ(measure.symmetry().kind, Kind::Revolution);
  const PoseMeasure plain{nozzle.body.mesh, vision::Symmetry{}};
  std::mt19937 random{7};
  for (int i = 0; i < 10; ++i) {
    const Isometry3d a = random_pose(random), b = random_pose(random);
    double least = std::numeric_limits<double>::infinity();
    for (int step = 0; step < 3600; ++step) {
      Isometry3d moved = a;
      moved.linear() = a.linear() * Eigen::AngleAxisd{step * kPi / 1800, measure.symmetry().axis}.toRotationMatrix();
      moved.translation() = a * measure.centroid_mm() - moved.linear() * measure.centroid_mm();
      least = std::min(least, plain.distance_mm(moved, b));
    }
    EXPECT_NEAR(measure.distance_mm(a, b), least, 2e-3 * least);
  }
}

TEST(PoseMeasure, BothEndsAlikeAreOne) {
  vision::Symmetry symmetry;
  symmetry.kind = Kind::RevolutionFlip;
  const PoseMeasure measure{emulators::shapes::turn(-20, {{20, 5, 0}}, 48), symmetry};
  Isometry3d flipped = Isometry3d::Identity();
  flipped.linear() = Eigen::AngleAxisd{kPi, Vector3d::UnitX()}.toRotationMatrix();
  EXPECT_NEAR(measure.distance_mm(Isometry3d::Identity(), flipped), 0, 1e-3);
  EXPECT_NEAR(measure.error(Isometry3d::Identity(), flipped).angle_rad(), 0, 1e-6);
}

TEST(PoseMeasure, ErrorsAreOfTheNearestSymmetricPose) {
  const ScenePart bridge = scene_part(vision::ScannerClass::Lps36, "contact_bridge");
  const PoseMeasure measure{bridge.body.mesh, judged_symmetry(bridge.body.mesh, 0.5)};
  std::mt19937 random{9};
  const Isometry3d truth = random_pose(random);
  Isometry3d found = truth;
  found.linear() = truth.linear() * Eigen::AngleAxisd{kPi + 0.02, Vector3d::UnitZ()}.toRotationMatrix();
  found.translation() = truth * measure.centroid_mm() + Vector3d{0.3, 0, 0.4} - found.linear() * measure.centroid_mm();
  const PoseMeasure::Error error = measure.error(found, truth);
  EXPECT_NEAR((error.centroid_mm - Vector3d{0.3, 0, 0.4}).norm(), 0, 1e-9);
  EXPECT_NEAR(error.angle_rad(), 0.02, 1e-6);
  EXPECT_NEAR((error.turn_rad - 0.02 * (truth.linear() * Vector3d::UnitZ())).norm(), 0, 1e-6);
}

TEST(PoseMeasure, TheNormalisedErrorCountsTheDegreesOfFreedom) {
  Matrix6 covariance = Matrix6::Zero();
  covariance.diagonal() << 4, 4, 4, 0.01, 0.01, 0.01;
  const vision::Mesh cube = emulators::box_mesh({20, 20, 20});
  Isometry3d found = Isometry3d::Identity();
  found.translation() = Vector3d{2, 0, 0};
  found.linear() = Eigen::AngleAxisd{0.1, Vector3d::UnitZ()}.toRotationMatrix();
  const PoseMeasure none{cube, vision::Symmetry{}};
  EXPECT_NEAR(none.normalised_error_squared(found, Isometry3d::Identity(), covariance), (1.0 + 1.0) / 6, 1e-9);
  vision::Symmetry about_z;
  about_z.kind = Kind::Revolution;
  const PoseMeasure round{cube, about_z};
  EXPECT_NEAR(round.normalised_error_squared(found, Isometry3d::Identity(), covariance), 1.0 / 5, 1e-9)
      << "a turn about the axis is none";
  EXPECT_LT(none.normalised_error_squared(found, Isometry3d::Identity(), Matrix6::Zero()), 0);
}
}  // namespace
}  // namespace binpick::bench
