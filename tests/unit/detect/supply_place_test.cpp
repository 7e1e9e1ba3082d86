#include "vision/supply_place.hpp"

#include <gtest/gtest.h>
#include <numbers>
#include <random>

namespace binpick::vision {
namespace {
constexpr double kDegree = std::numbers::pi / 180;

struct Stand {
  double x_mm = 0, y_mm = 0, turn_deg = 0;
  Eigen::Isometry3d T_said_true() const {
    Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
    T.translate(Eigen::Vector3d{x_mm, y_mm, 0}).rotate(Eigen::AngleAxisd{turn_deg * kDegree, Eigen::Vector3d::UnitZ()});
    return T;
  }
};

struct Scene {
  Eigen::Vector3d size_mm{1000, 800, 500};
  double wall_mm = 20, noise_mm = 1.5, spacing_mm = 4;
  double fill_mm = 200;        ///< Height of what lies in it.
  double heap_share = 0;       ///< Of the inside, near the walls too, that is heaped up to the rim.
  bool without_low_x = false;  ///< This wall is out of sight.
  std::uint64_t seed = 1;
};

/// The rim, the contents, the floor around and points that hang at the rim's edges, as a scanner gives them.
std::vector<Eigen::Vector3f> scan_of(const Scene& scene, const Stand& stand) {
  std::mt19937_64 random{scene.seed};
  std::normal_distribution<double> noise{0, scene.noise_mm};
  std::uniform_real_distribution<double> share{0, 1};
  std::vector<Eigen::Vector3f> points;
  const Eigen::Isometry3d T = stand.T_said_true();
  const Eigen::Vector2d half = scene.size_mm.head<2>() / 2;
  for (double x = -half.x() - 150; x <= half.x() + 150; x += scene.spacing_mm)
    for (double y = -half.y() - 150; y <= half.y() + 150; y += scene.spacing_mm) {
      const Eigen::Vector2d at{x + scene.spacing_mm * share(random), y + scene.spacing_mm * share(random)};
      const double out = (at.cwiseAbs() - half).maxCoeff();
      if (scene.without_low_x && at.x() < -half.x() + 30) continue;
      double z = 0;
      if (out > 0 && out < scene.wall_mm)
        z = scene.size_mm.z();
      else if (out <= 0 && out > -2 && share(random) < 0.3)
        z = scene.size_mm.z() - 60 * share(random);  // mixed
      else if (out <= 0) {
        const bool heaped = std::sin(at.x() / 60) * std::cos(at.y() / 45) > 1 - 2 * scene.heap_share;
        z = heaped ? scene.size_mm.z() - 30 + 60 * share(random)
                   : scene.fill_mm + 0.16 * scene.size_mm.z() * share(random);
      }
      points.push_back((T * Eigen::Vector3d{at.x(), at.y(), z + noise(random)}).cast<float>());
    }
  return points;
}

void expect_found(const Scene& scene, const Stand& stand, double within_mm, double within_deg) {
  const auto place = find_supply(scan_of(scene, stand), {scene.size_mm}, {}, scene.noise_mm);
  ASSERT_TRUE(place) << place.error() << " at " << stand.x_mm << " " << stand.y_mm << " " << stand.turn_deg;
  const Eigen::Isometry3d error = place->T_said_found.inverse() * stand.T_said_true();
  EXPECT_LT(error.translation().norm(), within_mm) << stand.x_mm << " " << stand.y_mm << " " << stand.turn_deg;
  EXPECT_LT(Eigen::AngleAxisd{error.linear()}.angle() / kDegree, within_deg);
}

std::string refusal(const Scene& scene, const Stand& stand) {
  const auto place = find_supply(scan_of(scene, stand), {scene.size_mm}, {}, scene.noise_mm);
  return place ? "found" : place.error();
}
}  // namespace

TEST(SupplyPlace, FoundWhereverTheForkliftLeftIt) {
  std::mt19937_64 random{3};
  const auto uniform = [&](double limit) { return std::uniform_real_distribution{-limit, limit}(random); };
  for (std::uint64_t seed = 1; seed <= 25; ++seed) {
    expect_found({.seed = seed}, {uniform(78), uniform(78), uniform(9.7)}, 2.0, 0.2);
    expect_found(
        {.size_mm = {300, 300, 120}, .wall_mm = 8, .noise_mm = 0.2, .spacing_mm = 1, .fill_mm = 40, .seed = seed},
        {uniform(78), uniform(78), uniform(9.7)}, 1.0, 0.3);
  }
}

TEST(SupplyPlace, WhatIsHeapedUpToTheRimIsNoWall) {
  for (std::uint64_t seed = 1; seed <= 8; ++seed)
    expect_found({.heap_share = 0.3, .seed = seed}, {50, -30, 4}, 3.0, 0.3);
}

TEST(SupplyPlace, ThreeWallsAreEnough) { expect_found({.without_low_x = true}, {-40, 25, -6}, 3.0, 0.3); }

TEST(SupplyPlace, WhatIsNotPlausibleIsRefusedWithNumbers) {
  EXPECT_NE(refusal({}, {95, 0, 0}).find("stands 95 mm in x"), std::string::npos) << refusal({}, {95, 0, 0});
  EXPECT_NE(refusal({}, {0, 0, 11.5}).find("turned by 11.5 deg"), std::string::npos) << refusal({}, {0, 0, 11.5});
  Scene other;
  other.size_mm = {1000, 800, 500};
  const auto points = scan_of({.size_mm = {940, 800, 500}}, {});
  const auto place = find_supply(points, {other.size_mm}, {}, 1.5);
  ASSERT_FALSE(place);
  EXPECT_NE(place.error().find("apart, supply.size_mm says 1000"), std::string::npos) << place.error();
}

TEST(SupplyPlace, AFloorWithoutASupplyHasNone) {
  EXPECT_NE(refusal({.wall_mm = 0}, {}).find("no rim"), std::string::npos) << refusal({.wall_mm = 0}, {});
  EXPECT_FALSE(find_supply({}, {{1000, 800, 500}}, {}, 1.5));
  // Things at the rim's height that are no walls.
  EXPECT_NE(refusal({.wall_mm = 0, .heap_share = 0.5}, {}), "found");
}
}  // namespace binpick::vision
