#include "vision/resting.hpp"

#include <gtest/gtest.h>
#include <map>
#include <numbers>
#include <random>

#include "tests/unit/vision/shapes.hpp"
#include "vision/surface.hpp"

namespace binpick::vision {
namespace {
constexpr double kDeg = std::numbers::pi / 180;
using Heights = std::vector<double>;  ///< Of the centre of mass in each resting pose, mm, lowest first.

Mesh tetrahedron(float s) {
  Mesh mesh;
  mesh.vertices_mm = {{s, s, s}, {s, -s, -s}, {-s, s, -s}, {-s, -s, s}};
  mesh.triangles = {{0, 1, 2}, {0, 3, 1}, {0, 2, 3}, {1, 3, 2}};
  return mesh;
}

Mesh stretched(Mesh mesh, float z) {
  for (Eigen::Vector3f& v : mesh.vertices_mm) v.z() *= z;
  return mesh;
}

struct Known {
  const char* name;
  Mesh mesh;
  Heights heights_mm;
};

class KnownRestingPoses : public testing::TestWithParam<Known> {};

TEST_P(KnownRestingPoses, AreFoundInAnyFrame) {
  std::mt19937_64 random(3);
  std::normal_distribution<double> normal;
  for (int i = 0; i < 3; ++i) {
    Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
    if (i > 0) {
      T.linear() = Eigen::Quaterniond(normal(random), normal(random), normal(random), normal(random))
                       .normalized()
                       .toRotationMatrix();
      T.translation() = 100 * Eigen::Vector3d(normal(random), normal(random), normal(random));
    }
    const Mesh mesh = shapes::moved(GetParam().mesh, T);
    const Symmetry symmetry = find_symmetry(mesh, 0.005 * mesh.diameter_mm());
    const auto poses = resting_poses(mesh, symmetry, 0.01 * mesh.diameter_mm(), 6 * kDeg);
    ASSERT_EQ(poses.size(), GetParam().heights_mm.size());
    for (std::size_t k = 0; k < poses.size(); ++k) {
      EXPECT_NEAR(poses[k].height_mm, GetParam().heights_mm[k], 0.15);
      EXPECT_NEAR(poses[k].down.norm(), 1, 1e-9);
      EXPECT_GE(poses[k].barrier_mm, 0.01 * mesh.diameter_mm());
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Solids, KnownRestingPoses,
                         testing::Values(Known{"cube", shapes::box(40, 40, 40), {20}},
                                         Known{"box", shapes::box(60, 40, 20), {10, 20, 30}},
                                         // Lying and standing; both ends are alike.
                                         Known{"cylinder", shapes::cylinder(20, 90), {20, 45}},
                                         Known{"tetrahedron", tetrahedron(30), {17.32}},
                                         // On its base and on its side. The small end would do in mathematics: a
                                         // quarter of a millimetre tips it.
                                         Known{"cone", shapes::turned({{0, 30.0F}, {60, 5.0F}}, 64), {17.79, 20.83}},
                                         // Either side, foot, back, and from the foot's tip to the tower's.
                                         Known{"l_shape", shapes::l_shape(), {15, 15, 16.11, 19.33, 21.35}},
                                         Known{"hexagonal_bar", shapes::cylinder(20, 30, 6), {15, 17.32}},
                                         Known{"sphere", shapes::sphere(30), {30}},
                                         Known{"egg", stretched(shapes::sphere(30), 1.5F), {30}},
                                         Known{"lens", stretched(shapes::sphere(30), 0.6F), {18}}),
                         [](const auto& parameter) { return std::string(parameter.param.name); });

TEST(RestingPoses, EdgesFullOfPointsAreNoFloors) {
  // Three boxes in a row whose long edges lie in line: the hull has needles there that only touch other needles.
  Mesh mesh;
  for (const float x : {-24.0F, 0.0F, 24.0F})
    for (const Mesh& box : {shapes::box(12, 18, 12), shapes::box(48, 18, 12)}) {
      const auto first = static_cast<std::uint32_t>(mesh.vertices_mm.size());
      for (const Eigen::Vector3f& v : box.vertices_mm) mesh.vertices_mm.push_back(v + Eigen::Vector3f{x, 0, 0});
      for (auto t : box.triangles) mesh.triangles.push_back({t[0] + first, t[1] + first, t[2] + first});
    }
  const auto poses = resting_poses(mesh, {}, 0.1, 6 * kDeg);
  Heights heights;
  for (const RestingPose& pose : poses) heights.push_back(pose.height_mm);
  ASSERT_EQ(heights.size(), 6U) << "as of the one box that encloses them";
  for (std::size_t k = 0; k < 6; ++k) EXPECT_NEAR(heights[k], (Heights{6, 6, 9, 9, 48, 48}[k]), 0.01);
}

TEST(ConvexHull, EnclosesEveryPointAndIsClosed) {
  std::mt19937_64 random(9);
  std::normal_distribution<float> normal;
  std::vector<Eigen::Vector3f> cloud;
  for (int i = 0; i < 800; ++i) cloud.emplace_back(30 * normal(random), 20 * normal(random), 5 * normal(random));
  for (const auto& points : {cloud, shapes::box(60, 40, 20).vertices_mm, shapes::cylinder(20, 90).vertices_mm,
                             shapes::l_shape().vertices_mm}) {
    const auto hull = convex_hull(points);
    ASSERT_GE(hull.size(), 4U);
    Mesh mesh{points, hull};
    std::map<std::pair<std::uint32_t, std::uint32_t>, int> edges;
    for (const auto& t : hull) {
      for (std::size_t k = 0; k < 3; ++k) ++edges[{t[k], t[(k + 1) % 3]}];
      const Eigen::Vector3d a = points[t[0]].cast<double>(), b = points[t[1]].cast<double>(),
                            c = points[t[2]].cast<double>();
      const Eigen::Vector3d cross = (b - a).cross(c - a);
      if (cross.norm() < 1e-2) continue;
      for (const Eigen::Vector3f& p : points) EXPECT_LT(cross.normalized().dot(p.cast<double>() - a), 1e-2);
    }
    for (const auto& [edge, times] : edges) {
      EXPECT_EQ(times, 1);
      EXPECT_EQ(edges.count({edge.second, edge.first}), 1U);
    }
  }
  EXPECT_TRUE(convex_hull({}).empty());
  EXPECT_TRUE(convex_hull({{1, 2, 3}, {1, 2, 3}, {1, 2, 3}, {1, 2, 3}}).empty());
}

TEST(CentreOfMass, IsThatOfTheVolumeOrOfTheSurface) {
  const Eigen::Vector3d known(-10.667, 0, 11.111);
  Mesh part = shapes::l_shape();
  EXPECT_LT((centre_of_mass_mm(part) - known).norm(), 1e-2);
  for (auto& t : part.triangles) std::swap(t[0], t[1]);
  EXPECT_LT((centre_of_mass_mm(part) - known).norm(), 1e-2);
  // One box inside out takes its volume away: no body of even density.
  Mesh odd = shapes::box(20, 20, 20);
  shapes::add(odd, shapes::box(20, 20, 20), {30, 0, 0});
  for (std::size_t i = 0; i < 12; ++i) std::swap(odd.triangles[i][0], odd.triangles[i][1]);
  EXPECT_LT((centre_of_mass_mm(odd) - odd.centroid_mm()).norm(), 1e-6);
}

TEST(RestingRotations, PointDownwardsAndCoverTheTurns) {
  const Mesh box = shapes::box(60, 40, 20);
  const Symmetry symmetry = find_symmetry(box, 0.3);
  const auto poses = resting_poses(box, symmetry, 1, 6 * kDeg);
  ASSERT_EQ(poses.size(), 3U);
  // Half a turn looks the same: 30 turns of 6 degrees for each face.
  const auto flat = resting_rotations(poses, symmetry, 6 * kDeg, 0);
  EXPECT_EQ(flat.size(), 90U);
  for (std::size_t i = 0; i < flat.size(); ++i) EXPECT_NEAR((flat[i] * poses[i / 30].down).z(), -1, 1e-9);
  const auto leaning = resting_rotations(poses, symmetry, 6 * kDeg, 3 * kDeg);
  EXPECT_EQ(leaning.size(), 360U);
  for (std::size_t i = 0; i < leaning.size(); ++i)
    EXPECT_NEAR(std::acos(std::min(1.0, -(leaning[i] * poses[i / 120].down).z())), i % 4 == 0 ? 0 : 3 * kDeg, 1e-6);
  // Any turn of a lying box is within half a step of one of them.
  std::mt19937_64 random(5);
  for (int i = 0; i < 200; ++i) {
    Eigen::Isometry3d P = Eigen::Isometry3d::Identity(), Q = P;
    P.linear() =
        (Eigen::AngleAxisd(0.0314159 * i, Eigen::Vector3d::UnitZ()) * flat[static_cast<std::size_t>(i % 3) * 30])
            .toRotationMatrix();
    double least = 9;
    for (const auto& q : flat) {
      Q.linear() = q.toRotationMatrix();
      least = std::min(least, pose_distance(P, Q, symmetry, 1).angle_rad);
    }
    EXPECT_LE(least, 3.001 * kDeg);
  }
  const Mesh cylinder = shapes::cylinder(20, 90);
  const Symmetry round = find_symmetry(cylinder, 0.3);
  // Lying: half a turn; standing: one view.
  EXPECT_EQ(resting_rotations(resting_poses(cylinder, round, 1, 6 * kDeg), round, 6 * kDeg, 0).size(), 31U);
}
}  // namespace
}  // namespace binpick::vision
