#include "tests/emulators/world/belt.hpp"

#include <algorithm>
#include <cmath>
#include <gtest/gtest.h>
#include <numbers>
#include <set>

#include "tests/emulators/world/living_pile.hpp"
#include "vision/resting.hpp"

namespace binpick::emulators {
namespace {
using Eigen::Vector2d;
using Eigen::Vector3d;
constexpr double kDegree = std::numbers::pi / 180;

std::vector<Vector3d> points_of(const ExamplePart& part, const LivingPile::Pose& T) {
  std::vector<Vector3d> points;
  for (const auto& v : part.mesh.vertices_mm) points.push_back(T * v.cast<double>());
  return points;
}

/// What is outermost in many directions, seen from above.
std::vector<Vector2d> outline_of(const std::vector<Vector3d>& points) {
  std::vector<Vector2d> outline;
  for (int k = 0; k < 90; ++k) {
    const Vector2d direction{std::cos(k * std::numbers::pi / 45), std::sin(k * std::numbers::pi / 45)};
    outline.push_back(
        std::ranges::max_element(points, {}, [&](const Vector3d& p) { return direction.dot(p.head<2>()); })->head<2>());
  }
  return outline;
}

double lowest_mm(const std::vector<Vector3d>& points) {
  return std::ranges::min_element(points, {}, [](const Vector3d& p) { return p.z(); })->z();
}
double highest_mm(const std::vector<Vector3d>& points) {
  return std::ranges::max_element(points, {}, [](const Vector3d& p) { return p.z(); })->z();
}

class OnTheBelt : public testing::TestWithParam<std::string> {
 protected:
  const ExamplePart part = example_part(GetParam());
  const Vector2d window = GetParam() == "contact_bridge" ? Vector2d{300, 300} : Vector2d{1000, 800};
};
INSTANTIATE_TEST_SUITE_P(Parts, OnTheBelt, testing::ValuesIn(example_part_names()),
                         [](const auto& one) { return one.param; });

TEST_P(OnTheBelt, ObjectsLieByThemselvesInTheWindow) {
  for (const std::uint64_t seed : {1U, 2U}) {
    const auto poses = lay_apart(part, 6, window, seed);
    EXPECT_GE(poses.size(), 2U);
    std::vector<std::vector<Vector2d>> outlines;
    for (const auto& T : poses) {
      const auto points = points_of(part, T);
      // The physics' bodies have a margin, and their hulls are a little smaller than what is round.
      EXPECT_NEAR(lowest_mm(points), 0, 0.01 * part.mesh.diameter_mm());
      outlines.push_back(outline_of(points));
      for (const Vector2d& p : outlines.back())
        EXPECT_TRUE((p.cwiseAbs().array() <= window.array() / 2 + 1e-6).all()) << p.transpose();
    }
    for (std::size_t i = 0; i < outlines.size(); ++i)
      for (std::size_t k = 0; k < i; ++k) {
        double least_mm = 1e9;
        for (const Vector2d& p : outlines[i])
          for (const Vector2d& q : outlines[k]) least_mm = std::min(least_mm, (p - q).norm());
        EXPECT_GE(least_mm, kApartDiameters * part.mesh.diameter_mm() - 1e-6) << i << " beside " << k;
      }
  }
}

TEST_P(OnTheBelt, TheyRestAsGeometrySays) {
  // Bullet knows nothing of what training takes for resting poses, those that are deep enough.
  const double diameter_mm = part.mesh.diameter_mm();
  const auto resting = vision::resting_poses(part.mesh, {}, 0.01 * diameter_mm, 2 * kDegree);
  ASSERT_FALSE(resting.empty());
  for (const auto& T : lay_apart(part, 15, 4 * window, 5)) {
    const Vector3d down = T.iso.linear().transpose() * -Vector3d::UnitZ();
    double least = 9;
    for (const vision::RestingPose& pose : resting)
      least = std::min(least, std::atan2(down.cross(pose.down).norm(), down.dot(pose.down)));
    EXPECT_LT(least, 3 * kDegree);
  }
}

TEST_P(OnTheBelt, TheSameSeedGivesTheSameBeltAndAnotherAnother) {
  const auto first = lay_apart(part, 2, window, 7), again = lay_apart(part, 2, window, 7),
             other = lay_apart(part, 2, window, 8);
  ASSERT_EQ(first.size(), again.size());
  for (std::size_t i = 0; i < first.size(); ++i) EXPECT_EQ(first[i].iso.matrix(), again[i].iso.matrix());
  EXPECT_NE(first[0].iso.matrix(), other[0].iso.matrix());
}

TEST(OnTheBeltAll, TheyLieInMoreThanOneWay) {
  const ExamplePart part = example_part("track_link");
  std::set<long> heights;
  for (const auto& T : lay_apart(part, 12, {2000, 2000}, 1))
    heights.insert(std::lround(highest_mm(points_of(part, T)) / 5));
  EXPECT_GE(heights.size(), 2U);
}

TEST(OnTheBeltAll, AWindowThatIsTooSmallStaysEmpty) {
  EXPECT_TRUE(lay_apart(example_part("steering_wheel"), 3, {300, 300}, 1).empty());
}
}  // namespace
}  // namespace binpick::emulators
