#include "bench/scenes/scanners.hpp"

#include <algorithm>
#include <cmath>
#include <gtest/gtest.h>

#include "bench/scenes/precision.hpp"
#include "bench/scenes/truth.hpp"

namespace binpick::bench {
namespace {
using Eigen::Vector3d;
using Eigen::Vector3f;

struct Swept {
  std::vector<Profile> lines;
  std::vector<std::vector<Echo>> ideal;
  std::vector<Vector3f> points;
};
Swept sweep(const ClassSetting& setting, const emulators::World& world, const ScanOptions& options = {}) {
  Swept swept;
  swept.lines = sweep_lines(setting, 4);
  swept.ideal = ideal_sweep(setting, swept.lines, world);
  swept.points = measured_points(setting, swept.lines, swept.ideal, world, options);
  return swept;
}

Transform<frame::Supply, frame::Object> at(double x, double y, double z) {
  Transform<frame::Supply, frame::Object> T;
  T.iso.translation() = Vector3d{x, y, z};
  return T;
}

TEST(SceneScanners, TheFloorHasTheNoiseOfTheClass) {
  for (const ClassSetting& setting : class_settings()) {
    const emulators::World world{{setting.supply_mm.x(), setting.supply_mm.y(), 0}};
    const Swept swept = sweep(setting, world);
    const vision::ScannerFigures& figures = vision::figures_of(setting.scanner);
    std::vector<double> heights;
    for (const Vector3f& p : swept.points)
      if (std::abs(p.x()) < 0.2 * setting.supply_mm.x()) heights.push_back(p.z());
    EXPECT_GT(heights.size(), 1000U);
    EXPECT_NEAR(quantile(heights, 0.5), 0, 0.1 * figures.noise_mm) << setting.name;
    // Steps of the values and the carrier's jitter add a little.
    double squares = 0, count = 0;
    for (const double z : heights)
      if (std::abs(z) < 5 * figures.noise_mm) squares += z * z, ++count;
    EXPECT_NEAR(std::sqrt(squares / count), figures.noise_mm, 0.12 * figures.noise_mm) << setting.name;
    const double share =
        static_cast<double>(swept.points.size()) / static_cast<double>(swept.lines.size() * swept.lines[0].rays.size());
    EXPECT_GT(share, 0.97) << setting.name;
    EXPECT_LE(share, 1) << setting.name;
  }
}

TEST(SceneScanners, SameSeedSamePointsOtherSeedOthers) {
  const ClassSetting& setting = *find_setting("lps36");
  const emulators::World world{{100, 100, 0}};
  EXPECT_EQ(sweep(setting, world).points, sweep(setting, world).points);
  EXPECT_NE(sweep(setting, world).points, sweep(setting, world, {9, 0}).points);
}

// A block 50 mm high, camera 110 mm behind the laser in +y at 500 mm: beyond the block's -y side the camera sees
// nothing for 50 · 110 / (500 - 50) = 12.2 mm, on the other side the light reaches the floor and the camera sees it.
TEST(SceneScanners, TheCameraDoesNotSeeBehindABlock) {
  const ClassSetting& setting = *find_setting("lps36");
  emulators::World world{{300, 300, 0}};
  world.add("block", std::make_shared<emulators::RayMesh>(emulators::box_mesh({60, 60, 50})), at(0, 0, 25));
  const Swept swept = sweep(setting, world);
  const auto on_floor = [&](double y_from, double y_to) {
    return std::ranges::count_if(swept.points, [&](const Vector3f& p) {
      return std::abs(p.x()) < 20 && p.y() > y_from && p.y() < y_to && std::abs(p.z()) < 3;
    });
  };
  EXPECT_EQ(on_floor(-40.5, -31.5), 0);
  EXPECT_GT(on_floor(-60, -44), 400);
  EXPECT_GT(on_floor(32, 42), 250);
}

TEST(SceneScanners, AtAJumpThePointsMixButOfSurfacesFarApartOneIsTaken) {
  const ClassSetting& setting = *find_setting("lps36hi");
  for (const auto& [height, between] : {std::pair{1.5, true}, std::pair{30.0, false}}) {
    emulators::World world{{180, 180, 0}};
    world.add("block", std::make_shared<emulators::RayMesh>(emulators::box_mesh({60, 60, height})),
              at(0, 0, height / 2));
    const Swept swept = sweep(setting, world);
    const auto mixed = std::ranges::count_if(
        swept.points, [&](const Vector3f& p) { return p.z() > 0.3 * height && p.z() < 0.7 * height; });
    if (between)
      EXPECT_GT(mixed, 20) << height;
    else
      EXPECT_LT(mixed, 20) << height;
  }
}

TEST(SceneScanners, TimeOfFlightMixesAndIsBiasedByTheMaterial) {
  const ClassSetting& setting = *find_setting("lms400");
  emulators::World world{{1000, 800, 0}};
  world.add("block", std::make_shared<emulators::RayMesh>(emulators::box_mesh({300, 300, 200})), at(0, 0, 100));
  const auto heights = [&](const std::vector<Vector3f>& points) {
    std::vector<double> top;
    for (const Vector3f& p : points)
      if (p.head<2>().cwiseAbs().maxCoeff() < 100) top.push_back(p.z());
    return quantile(top, 0.5);
  };
  const Swept plain = sweep(setting, world);
  EXPECT_NEAR(heights(plain.points), 200, 0.3);
  EXPECT_GT(std::ranges::count_if(plain.points, [](const Vector3f& p) { return p.z() > 40 && p.z() < 160; }), 30);
  const double biased = heights(sweep(setting, world, {1, 4.0}).points);
  EXPECT_GT(std::abs(biased - 200), 0.1);
  EXPECT_LT(std::abs(biased - 200), 4.3);
}

TEST(SceneTruth, AloneInTheMiddleAllIsVisibleUnderALidHalf) {
  for (const ClassSetting& setting : class_settings()) {
    const double edge = 0.2 * setting.supply_mm.x();
    ScenePart part;
    part.scanner = setting.scanner;
    const auto block = std::make_shared<emulators::RayMesh>(emulators::box_mesh({edge, edge, 0.1 * edge}));
    emulators::World world{setting.supply_mm};
    world.add("block", block, at(0, 0, 0.05 * edge));
    const auto truths = [&] {
      const std::vector<Profile> lines = sweep_lines(setting, 4);
      return truths_of(part, setting, lines, ideal_sweep(setting, lines, world), world);
    };
    ASSERT_EQ(truths().size(), 1U);
    EXPECT_NEAR(truths()[0].visible, 1, 0.02) << setting.name;
    world.add("block", block, at(0.5 * edge, 0, 0.15 * edge));
    EXPECT_NEAR(truths()[0].visible, 0.5, 0.06) << setting.name;
    EXPECT_NEAR(truths()[1].visible, 1, 0.02) << setting.name;
    EXPECT_TRUE(truths()[0].told);
  }
}

// The camera stands in +y: close to the wall there it looks over the wall.
TEST(SceneTruth, WhatLiesInTheShadowOfAWallIsHidden) {
  const ClassSetting& setting = *find_setting("lps36hi");
  ScenePart part;
  part.scanner = setting.scanner;
  emulators::World world{setting.supply_mm};
  const auto block = std::make_shared<emulators::RayMesh>(emulators::box_mesh({30, 20, 4}));
  world.add("block", block, at(0, 79.5, 2));
  world.add("block", block, at(0, -79.5, 2));
  const std::vector<Profile> lines = sweep_lines(setting, 4);
  const auto truths = truths_of(part, setting, lines, ideal_sweep(setting, lines, world), world);
  EXPECT_LT(truths[0].visible, 0.4);
  EXPECT_GT(truths[1].visible, 0.97);
}

TEST(SceneTruth, AKeywayBelowTellsNothing) {
  const ClassSetting& setting = *find_setting("lps36hi");
  const ScenePart shaft = scene_part(setting.scanner, "keyed_shaft");
  const auto mesh = std::make_shared<emulators::RayMesh>(shaft.body.mesh);
  for (const bool above : {true, false}) {
    emulators::World world{setting.supply_mm};
    Transform<frame::Supply, frame::Object> T = at(0, 0, 7);
    // The shaft's axis along x; its keyway, which is at +x, up or down.
    T.iso.linear() = Eigen::AngleAxisd{above ? -M_PI / 2 : M_PI / 2, Vector3d::UnitY()}.toRotationMatrix();
    world.add("keyed_shaft", mesh, T);
    const std::vector<Profile> lines = sweep_lines(setting, 4);
    EXPECT_EQ(truths_of(shaft, setting, lines, ideal_sweep(setting, lines, world), world)[0].told, above);
  }
}
}  // namespace
}  // namespace binpick::bench
