#include "vision/maxima.hpp"

#include <gtest/gtest.h>

namespace binpick::vision {
namespace {
/// A block of 24 × 40 mm, 55 high, about (80, 60) mm, seen in pixels of 4 mm.
Scene block(double noise_mm) {
  Scene scene;
  scene.pixel_mm = 4;
  scene.noise_mm = noise_mm;
  scene.jump_mm = jump_of(noise_mm, scene.pixel_mm);
  scene.z_mm = Grid<float>::Zero(30, 40);
  scene.z_mm.block(10, 17, 10, 6).setConstant(55);
  return scene;
}

std::vector<Eigen::Vector3f> maxima_of(const Scene& scene) {
  MaximaOptions options;
  options.diameter_mm = 100;
  options.z_min_mm = 20;
  return find_maxima(scene, options);
}

TEST(Maxima, OfAPlateauAreAGridOnIt) {
  const auto maxima = maxima_of(block(1));
  EXPECT_GE(maxima.size(), 6U);
  for (const Eigen::Vector3f& m : maxima) {
    EXPECT_NEAR(m.x(), 80, 14);
    EXPECT_NEAR(m.y(), 60, 22);
    EXPECT_FLOAT_EQ(m.z(), 55);
  }
}

TEST(Maxima, NoiseOnTopDoesNotHideThePlateau) {
  Scene scene = block(3);
  // Each pixel of the block lies beside one of these.
  scene.z_mm(12, 19) = scene.z_mm(12, 20) = scene.z_mm(17, 19) = scene.z_mm(17, 20) = 66;
  const auto maxima = maxima_of(scene);
  ASSERT_FALSE(maxima.empty());
  for (const Eigen::Vector3f& m : maxima) EXPECT_FLOAT_EQ(m.z(), 55);
}

TEST(Maxima, AFineScannersNarrowTopIsReal) {
  Scene scene = block(0.5);
  scene.z_mm.block(12, 19, 2, 1).setConstant(66);
  scene.z_mm(14, 19) = 66;
  bool found = false;
  for (const Eigen::Vector3f& m : maxima_of(scene)) found |= m.z() > 65;
  EXPECT_TRUE(found);
}
}  // namespace
}  // namespace binpick::vision
