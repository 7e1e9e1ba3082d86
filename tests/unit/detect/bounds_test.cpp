#include "vision/bounds.hpp"

#include <gtest/gtest.h>
#include <limits>

#include "tests/unit/detect/shapes.hpp"

namespace binpick::vision {
namespace {
constexpr double kDiameterMm = 100;
const SupplyBox kSupply{{200, 160, 80}};

/// 220 × 180 mm in pixels of 2 mm about the supply's middle, measured at one height.
Scene level(float z_mm) {
  Scene scene;
  scene.pixel_mm = 2;
  scene.noise_mm = 0.5;
  scene.origin_mm = {-109, -89};
  scene.z_mm = Grid<float>::Constant(90, 110, z_mm);
  return scene;
}

Pose at(float x, float y, float z) { return {Eigen::Matrix3f::Identity(), {x, y, z}}; }

std::vector<Eigen::Vector3f> cube() {
  Mesh mesh;
  shapes::add_box(mesh, {-20, -20, 0}, {20, 20, 40});
  return mesh.vertices_mm;
}

TEST(Bounds, NothingReachesThroughFloorOrWalls) {
  const Bounds bounds{level(0), kSupply, kDiameterMm};
  EXPECT_EQ(bounds.floor_mm(), 0);
  EXPECT_EQ(bounds.against(at(0, 0, 0), cube()), "");
  EXPECT_EQ(bounds.against(at(0, 0, -2.5F), cube()), "") << "3 mm are error of the pose";
  EXPECT_EQ(bounds.against(at(0, 0, -3.5F), cube()), "reaches through the floor");
  EXPECT_EQ(bounds.against(at(87, 0, 0), cube()), "") << "4 mm, and two pixels";
  EXPECT_EQ(bounds.against(at(89, 0, 0), cube()), "reaches through a wall");
  EXPECT_EQ(bounds.against(at(0, -69, 0), cube()), "reaches through a wall");
}

TEST(Bounds, AnUnknownSupplyHasNoWallsAndTheFloorOnWhichMuchLies) {
  const Bounds bounds{level(-30), {}, kDiameterMm};
  EXPECT_NEAR(bounds.floor_mm(), -30, 0.1);
  EXPECT_EQ(bounds.against(at(500, 0, -30), cube()), "");
  EXPECT_EQ(bounds.against(at(0, 0, -40), cube()), "reaches through the floor");
  Scene slope = level(0);
  for (int c = 0; c < slope.cols(); ++c) slope.z_mm.col(c).setConstant(static_cast<float>(2 * c));
  EXPECT_EQ((Bounds{slope, {}, kDiameterMm}.floor_mm()), -std::numeric_limits<float>::infinity());
  EXPECT_EQ((Bounds{slope, {}, kDiameterMm}.against(at(0, 0, -1000), cube())), "");
}

TEST(Bounds, ContentIsWhatLiesInTheSupplyHigherThanDirt) {
  Scene scene = level(8);  // a bent floor: less than a tenth of the diameter
  EXPECT_EQ((Bounds{scene, kSupply, kDiameterMm}.content(scene).cast<int>().sum()), 0);
  scene.z_mm.block(40, 50, 10, 20).setConstant(30);
  scene.z_mm.block(40, 50, 10, 5).setConstant(std::numeric_limits<float>::quiet_NaN());
  scene.z_mm.middleCols(5, 4).setConstant(80);  // a wall that leans inwards
  const Grid<std::uint8_t> content = Bounds{scene, kSupply, kDiameterMm}.content(scene);
  EXPECT_EQ(content.cast<int>().sum(), 150);
  EXPECT_EQ(content(45, 60), 1);
  EXPECT_EQ((Bounds{scene, {}, kDiameterMm}.content(scene).cast<int>().sum()), 0) << "whose is it?";
}

TEST(Bounds, AFalseBottomIsNoContent) {
  Scene scene = level(30);
  scene.z_mm.block(40, 50, 10, 20).setConstant(60);
  const Bounds bounds{scene, kSupply, kDiameterMm};
  EXPECT_EQ(bounds.floor_mm(), 0) << "a part may still lie beside the sheet";
  EXPECT_EQ(bounds.content(scene).cast<int>().sum(), 200);
  scene.z_mm.array() += 30;  // higher than half a diameter: a layer
  EXPECT_GT((Bounds{scene, kSupply, kDiameterMm}.content(scene).cast<int>().sum()), 5000);
}
}  // namespace
}  // namespace binpick::vision
