#include "vision/symmetry.hpp"

#include <chrono>
#include <gtest/gtest.h>
#include <numbers>
#include <random>

#include "tests/unit/vision/shapes.hpp"
#include "vision/knowledge_base.hpp"
#include "vision/surface.hpp"

namespace binpick::vision {
namespace {
using Kind = Symmetry::Kind;
constexpr double kPi = std::numbers::pi;

Eigen::Isometry3d random_pose(std::mt19937_64& random, double spread_mm) {
  std::normal_distribution<double> normal;
  Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  T.linear() = Eigen::Quaterniond(normal(random), normal(random), normal(random), normal(random))
                   .normalized()
                   .toRotationMatrix();
  T.translation() = spread_mm * Eigen::Vector3d(normal(random), normal(random), normal(random));
  return T;
}

/// A prism with the corners (x, y), from z = -h/2 to h/2; the corners must see the origin.
Mesh prism(const std::vector<Eigen::Vector2f>& corners, float h) {
  Mesh mesh;
  const auto n = static_cast<std::uint32_t>(corners.size());
  for (const float z : {-h / 2, h / 2}) {
    for (const Eigen::Vector2f& c : corners) mesh.vertices_mm.emplace_back(c.x(), c.y(), z);
    mesh.vertices_mm.emplace_back(0, 0, z);
  }
  for (std::uint32_t i = 0; i < n; ++i) {
    const std::uint32_t k = (i + 1) % n, up = n + 1;
    mesh.triangles.insert(mesh.triangles.end(),
                          {{i, k, k + up}, {i, k + up, i + up}, {n, k, i}, {n + up, i + up, k + up}});
  }
  return mesh;
}

Mesh star(int points, float outer, float inner, float h) {
  std::vector<Eigen::Vector2f> corners;
  for (int i = 0; i < 2 * points; ++i) {
    const double a = kPi * i / points;
    const float r = i % 2 ? inner : outer;
    corners.emplace_back(r * static_cast<float>(std::cos(a)), r * static_cast<float>(std::sin(a)));
  }
  return prism(corners, h);
}

/// Arms askew on a disc that closes one end: turns by 360 / arms degrees and nothing else.
Mesh propeller(int arms) {
  std::vector<Eigen::Vector2f> corners;
  for (int i = 0; i < 4 * arms; ++i) {
    static constexpr float kRadius[] = {12, 12, 40, 24};
    const double a = 2 * kPi * i / (4 * arms);
    corners.emplace_back(kRadius[i % 4] * static_cast<float>(std::cos(a)),
                         kRadius[i % 4] * static_cast<float>(std::sin(a)));
  }
  Mesh mesh = prism(corners, 12);
  shapes::add(mesh, shapes::cylinder(20, 15, 60), {0, 0, 13.5F});
  return mesh;
}

Mesh octahedron(float s) {
  Mesh mesh;
  mesh.vertices_mm = {{s, 0, 0}, {-s, 0, 0}, {0, s, 0}, {0, -s, 0}, {0, 0, s}, {0, 0, -s}};
  mesh.triangles = {{0, 2, 4}, {2, 1, 4}, {1, 3, 4}, {3, 0, 4}, {2, 0, 5}, {1, 2, 5}, {3, 1, 5}, {0, 3, 5}};
  return mesh;
}

Mesh tetrahedron(float s) {
  Mesh mesh;
  mesh.vertices_mm = {{s, s, s}, {s, -s, -s}, {-s, s, -s}, {-s, -s, s}};
  mesh.triangles = {{0, 1, 2}, {0, 3, 1}, {0, 2, 3}, {1, 3, 2}};
  return mesh;
}

/// A shaft with a slot cut along one half: turned but for the slot.
Mesh keyway_shaft(float slot_depth) {
  std::vector<Eigen::Vector2f> corners;
  for (int i = 0; i < 96; ++i) {
    const double a = 2 * kPi * i / 96;
    float r = 20;
    if (std::abs(std::remainder(a, 2 * kPi)) < 0.35) r -= slot_depth;
    corners.emplace_back(r * static_cast<float>(std::cos(a)), r * static_cast<float>(std::sin(a)));
  }
  return prism(corners, 100);
}

struct Known {
  const char* name;
  Mesh mesh;
  Kind kind;
  std::size_t order;
};

class KnownSymmetry : public testing::TestWithParam<Known> {};

TEST_P(KnownSymmetry, IsFoundInAnyPose) {
  std::mt19937_64 random(11);
  for (int i = 0; i < 3; ++i) {
    const Eigen::Isometry3d T = i == 0 ? Eigen::Isometry3d::Identity() : random_pose(random, 100);
    const Mesh mesh = shapes::moved(GetParam().mesh, T);
    const Symmetry found = find_symmetry(mesh, 0.005 * mesh.diameter_mm());
    ASSERT_EQ(found.kind, GetParam().kind) << to_string(found);
    EXPECT_NEAR((found.centre_mm - mesh.centroid_mm()).norm(), 0, 1e-6);
    if (found.kind == Kind::Finite) {
      ASSERT_EQ(found.rotations.size(), GetParam().order) << to_string(found);
      EXPECT_TRUE(found.rotations[0].isIdentity(1e-12));
      // A group: products stay in it. Each element maps the surface onto itself.
      const SurfaceTree tree(mesh);
      for (const auto& g : found.rotations) {
        for (const auto& h : found.rotations) {
          double least = kPi;
          for (const auto& k : found.rotations)
            least = std::min(least, Eigen::AngleAxisd(k.transpose() * g * h).angle());
          EXPECT_LT(least, 0.02);
        }
        for (const Eigen::Vector3d& p : sample_surface(mesh, 100))
          EXPECT_LT(tree.distance_mm(g * (p - found.centre_mm) + found.centre_mm, 50), 0.03 * mesh.diameter_mm());
      }
    }
    if (found.kind == Kind::Revolution || found.kind == Kind::RevolutionFlip) {
      EXPECT_NEAR(std::abs(found.axis.dot(T.linear().col(2))), 1, 1e-5);
    }
  }
}

INSTANTIATE_TEST_SUITE_P(
    Solids, KnownSymmetry,
    testing::Values(
        Known{"box", shapes::box(60, 40, 20), Kind::Finite, 4},
        Known{"square_bar", shapes::box(20, 20, 70), Kind::Finite, 8},
        Known{"cube", shapes::box(40, 40, 40), Kind::Finite, 24},
        Known{"tetrahedron", tetrahedron(30), Kind::Finite, 12}, Known{"l_shape", shapes::l_shape(), Kind::None, 1},
        Known{"cylinder", shapes::cylinder(20, 90), Kind::RevolutionFlip, 1},
        Known{"ball_like_cylinder", shapes::cylinder(30, 51.9615F), Kind::RevolutionFlip, 1},
        Known{"cone", shapes::turned({{0, 30.0F}, {60, 5.0F}}, 64), Kind::Revolution, 1},
        Known{"sphere", shapes::sphere(30), Kind::Sphere, 1}, Known{"hex_prism", star(3, 30, 30, 20), Kind::Finite, 12},
        Known{"star_of_five", star(5, 40, 20, 15), Kind::Finite, 10},
        Known{"star_of_twelve", star(12, 50, 38, 15), Kind::Finite, 24},
        Known{"gear_of_24", star(24, 50, 40, 15), Kind::Finite, 48},
        Known{"hex_pyramid", shapes::turned({{0, 30.0F}, {50, 6.0F}}, 6), Kind::Finite, 6},
        Known{"two_armed_propeller", propeller(2), Kind::Finite, 2},
        Known{"three_armed_propeller", propeller(3), Kind::Finite, 3},
        Known{"square_frustum", shapes::turned({{0, 30.0F}, {40, 12.0F}}, 4), Kind::Finite, 4},
        Known{"octahedron", octahedron(30), Kind::Finite, 24}, Known{"keyway_shaft", keyway_shaft(6), Kind::Finite, 2}),
    [](const auto& parameter) { return std::string(parameter.param.name); });

TEST(Symmetry, ToleranceSaysWhatIsNear) {
  EXPECT_EQ(find_symmetry(keyway_shaft(6), 3).kind, Kind::RevolutionFlip);
  EXPECT_EQ(find_symmetry(shapes::box(60, 40, 38), 0.2).rotations.size(), 4U);
  EXPECT_EQ(find_symmetry(shapes::box(60, 40, 38), 2.5).rotations.size(), 8U);
}

TEST(Symmetry, AKeywayIsSeenWithAFineScannerAndHiddenByTheNoiseOfACoarseOne) {
  PartOptions options;
  options.scanner = ScannerClass::Lps36Hi;
  EXPECT_EQ(symmetry_of(keyway_shaft(3), options).kind, Kind::Finite);
  options.scanner = ScannerClass::Lms400;
  EXPECT_EQ(symmetry_of(keyway_shaft(3), options).kind, Kind::RevolutionFlip);
}

TEST(Symmetry, AGivenKindAndAxisMeanTheSameAsWhatIsFound) {
  // The mesh's origin lies far from the part, so that a centre of (0, 0, 0) would mean another symmetry.
  std::mt19937_64 random(21);
  const Eigen::Isometry3d T = random_pose(random, 200);
  const Eigen::Vector3d axis = T.linear().col(2);
  struct Case {
    Mesh mesh;
    Kind kind;
  };
  for (const Case& c :
       {Case{shapes::cylinder(20, 90), Kind::RevolutionFlip},
        Case{shapes::turned({{0, 30.0F}, {60, 5.0F}}, 64), Kind::Revolution}, Case{shapes::sphere(30), Kind::Sphere}}) {
    const Mesh mesh = shapes::moved(c.mesh, T);
    const Symmetry found = symmetry_of(mesh, {});
    PartOptions options;
    options.symmetry.emplace();
    options.symmetry->kind = c.kind;
    options.symmetry->axis = -axis;
    const Symmetry given = symmetry_of(mesh, options);
    ASSERT_EQ(found.kind, given.kind);
    for (int i = 0; i < 20; ++i) {
      // Beside each other: a pose, and one that only the symmetry makes nearly equal.
      const Eigen::Isometry3d P = random_pose(random, 50);
      Eigen::Isometry3d Q = P;
      Q.translate(found.centre_mm);
      Q.rotate(Eigen::AngleAxisd(0.3 * i, axis));
      if (c.kind == Kind::RevolutionFlip) Q.rotate(Eigen::AngleAxisd(kPi, axis.unitOrthogonal()));
      Q.translate(-found.centre_mm);
      for (const Symmetry& s : {found, given}) {
        EXPECT_LT(pose_distance(P, Q, s, 30).centroid_mm, 1e-3);
        EXPECT_LT(pose_distance(P, Q, s, 30).angle_rad, 1e-3);
      }
    }
    options.symmetry_centre_mm = Eigen::Vector3d(1, 2, 3);
    EXPECT_EQ(symmetry_of(mesh, options).centre_mm, Eigen::Vector3d(1, 2, 3));
  }
}

TEST(Symmetry, FlippedNormalsChangeNothing) {
  Mesh mesh = shapes::box(60, 40, 20);
  for (auto& t : mesh.triangles) std::swap(t[0], t[1]);
  EXPECT_EQ(find_symmetry(mesh, 0.3).rotations.size(), 4U);
}

TEST(Symmetry, WordsNameTheGroup) {
  Symmetry symmetry;
  EXPECT_EQ(to_string(symmetry), "none");
  symmetry.kind = Kind::RevolutionFlip;
  EXPECT_EQ(to_string(symmetry), "revolution about (0.000, 0.000, 1.000), both ends alike");
  symmetry.kind = Kind::Finite;
  symmetry.rotations.assign(4, Eigen::Matrix3d::Identity());
  EXPECT_EQ(to_string(symmetry), "finite, order 4");
}

TEST(PoseDistance, IsTheLeastOverTheGroupByBruteForce) {
  std::mt19937_64 random(5);
  const auto angle = [](const Eigen::Matrix3d& A, const Eigen::Matrix3d& B) {
    return Eigen::AngleAxisd(A.transpose() * B).angle();
  };
  Symmetry none, square, turned, turned_flip, sphere;
  const Eigen::Vector3d axis = Eigen::Vector3d(1, 2, -0.5).normalized();
  none.centre_mm = square.centre_mm = turned.centre_mm = turned_flip.centre_mm = sphere.centre_mm = {3, -7, 11};
  square.kind = Kind::Finite;
  square.rotations.clear();
  for (int i = 0; i < 4; ++i) square.rotations.push_back(Eigen::AngleAxisd(i * kPi / 2, axis).toRotationMatrix());
  turned.kind = Kind::Revolution;
  turned_flip.kind = Kind::RevolutionFlip;
  turned.axis = turned_flip.axis = axis;
  sphere.kind = Kind::Sphere;
  for (int trial = 0; trial < 50; ++trial) {
    const Eigen::Isometry3d P = random_pose(random, 20), Q = random_pose(random, 20);
    const double centroid = (P * none.centre_mm - Q * none.centre_mm).norm();
    EXPECT_NEAR(pose_distance(P, Q, none, 30).angle_rad, angle(P.linear(), Q.linear()), 1e-9);
    double best = kPi;
    for (const auto& g : square.rotations) best = std::min(best, angle(P.linear() * g, Q.linear()));
    EXPECT_NEAR(pose_distance(P, Q, square, 30).angle_rad, best, 1e-9);
    double spun = kPi, spun_flip = kPi;
    const Eigen::Matrix3d flip = Eigen::AngleAxisd(kPi, axis.unitOrthogonal()).toRotationMatrix();
    for (int i = 0; i < 3600; ++i) {
      const Eigen::Matrix3d g = Eigen::AngleAxisd(2 * kPi * i / 3600, axis).toRotationMatrix();
      spun = std::min(spun, angle(P.linear() * g, Q.linear()));
      spun_flip = std::min({spun_flip, spun, angle(P.linear() * g * flip, Q.linear())});
    }
    EXPECT_NEAR(pose_distance(P, Q, turned, 30).angle_rad, spun, 2e-3);
    EXPECT_NEAR(pose_distance(P, Q, turned_flip, 30).angle_rad, spun_flip, 2e-3);
    EXPECT_EQ(pose_distance(P, Q, sphere, 30).angle_rad, 0);
    for (const Symmetry& s : {none, square, turned, turned_flip, sphere}) {
      EXPECT_NEAR(pose_distance(P, Q, s, 30).centroid_mm, centroid, 1e-9);
      EXPECT_NEAR(pose_distance(P, P, s, 30).angle_rad, 0, 1e-7);
    }
  }
}

TEST(Surface, DistanceAgreesWithBruteForceOverPoints) {
  const Mesh mesh = shapes::l_shape();
  const SurfaceTree tree(mesh);
  const auto dense = sample_surface(mesh, 20'000);
  ASSERT_EQ(dense.size(), 20'000U);
  std::mt19937_64 random(2);
  std::normal_distribution<double> normal;
  for (int i = 0; i < 50; ++i) {
    const Eigen::Vector3d p = 25 * Eigen::Vector3d(normal(random), normal(random), normal(random));
    double least = 1e9;
    for (const Eigen::Vector3d& q : dense) least = std::min(least, (p - q).norm());
    const double d = tree.distance_mm(p, 1e9);
    EXPECT_LE(d, least + 1e-9);
    EXPECT_NEAR(d, least, 0.8);
    EXPECT_EQ(tree.distance_mm(p, 1e-3), 1e-3);
  }
}

TEST(Surface, CovarianceOfABoxIsThatOfItsFormula) {
  // Mean of x² over the surface of a cube of edge a: two faces at a²/4, four with a²/12.
  EXPECT_TRUE(surface_covariance(shapes::box(12, 12, 12)).isApprox(20.0 * Eigen::Matrix3d::Identity(), 1e-6));
}
}  // namespace
}  // namespace binpick::vision
