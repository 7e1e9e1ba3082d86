#include "tests/emulators/world/living_pile.hpp"

#include <chrono>
#include <cstdio>
#include <gtest/gtest.h>

#include "tests/emulators/world/pile.hpp"

namespace binpick::emulators {
namespace {
using Eigen::Vector3d;

int highest(const World& world) {
  int id = 0;
  float top = -1;
  for (const auto& object : world.objects())
    if (object.box.max().z() > top) top = object.box.max().z(), id = object.id;
  return id;
}

/// The longest of its sides along z: the box part lies on its side or stands.
ExamplePart block(const Vector3d& size_mm) {
  ExamplePart part;
  part.name = "block";
  part.scanner = "lms400";
  part.mesh = box_mesh(size_mm);
  const Eigen::Vector3f half = (size_mm / 2).cast<float>();
  part.pieces = {box_piece(-half, half)};
  return part;
}
LivingPile::Pose at(double x, double y, double z) {
  LivingPile::Pose T;
  T.iso.translation() = Vector3d{x, y, z};
  return T;
}
const Vector3d kSupply{1000, 800, 500};

TEST(LivingPile, BeginsAsThePileThatIsThrownWithThatSeed) {
  const ExamplePart part = example_part("track_link");
  const LivingPile living{part, 6, kSupply, 3};
  const World still = make_pile(part, 6, kSupply, 3);
  ASSERT_EQ(living.world().objects().size(), 6U);
  for (std::size_t i = 0; i < 6; ++i)
    EXPECT_EQ(living.world().objects()[i].T_supply_object.iso.matrix(),
              still.objects()[i].T_supply_object.iso.matrix());
}

TEST(LivingPile, WhatLayOnTheTakenOneFallsAndTheRestStays) {
  // Two blocks on each other, and one that stands alone.
  LivingPile pile{block({200, 100, 50}), {at(0, 0, 25), at(0, 0, 75.5), at(350, 0, 25)}, kSupply};
  EXPECT_GT(pile.take(1), 45);
  ASSERT_EQ(pile.world().objects().size(), 2U);
  EXPECT_NEAR(pile.world().find(2)->T_supply_object.iso.translation().z(), 25, 1.5);
  EXPECT_NEAR(pile.world().find(2)->box.max().z(), 50, 1.5) << "the rays see it there";
  EXPECT_LT((pile.world().find(3)->T_supply_object.iso.translation() - Vector3d{350, 0, 25}).norm(), 0.01);
  EXPECT_LT(pile.take(3), 0.01) << "nobody touched it";
}

class Emptied : public testing::TestWithParam<std::tuple<std::string, int, Vector3d>> {};
INSTANTIATE_TEST_SUITE_P(Parts, Emptied,
                         testing::Values(std::tuple{"track_link", 12, kSupply},
                                         std::tuple{"steering_wheel", 5, kSupply},
                                         std::tuple{"gear_shaft", 12, Vector3d{450, 400, 300}},
                                         std::tuple{"contact_bridge", 15, Vector3d{180, 180, 60}}),
                         [](const auto& each) { return std::get<0>(each.param); });

TEST_P(Emptied, FromTheTopTwiceTheSameAndCheaply) {
  const auto& [name, count, size] = GetParam();
  const ExamplePart part = example_part(name);
  LivingPile a{part, count, size, 5}, b{part, count, size, 5};
  double seconds = 0, worst_s = 0;
  while (!a.world().objects().empty()) {
    const int id = highest(a.world());
    const auto began = std::chrono::steady_clock::now();
    a.take(id);
    const double took = std::chrono::duration<double>(std::chrono::steady_clock::now() - began).count();
    seconds += took;
    worst_s = std::max(worst_s, took);
    b.take(id);
    ASSERT_EQ(a.world().objects().size(), b.world().objects().size());
    for (std::size_t i = 0; i < a.world().objects().size(); ++i) {
      const auto& T = a.world().objects()[i].T_supply_object.iso;
      ASSERT_EQ(T.matrix(), b.world().objects()[i].T_supply_object.iso.matrix());
      for (const auto& v : part.mesh.vertices_mm) ASSERT_GT((T * v.cast<double>()).z(), -1.5);
      EXPECT_LT(std::abs(T.translation().x()), size.x() / 2);
      EXPECT_LT(std::abs(T.translation().y()), size.y() / 2);
    }
  }
  std::printf("  %d × %s taken one by one: %.3f s each, %.2f s at most\n", count, name.c_str(), seconds / count,
              worst_s);
}

TEST(LivingPile, ACarriedObjectPushesWhatIsInItsWay) {
  const LivingPile pile{block({200, 100, 50}), {at(0, 0, 25), at(0, 0, 75.5), at(205, 0, 25)}, kSupply};
  const auto along = [](const Vector3d& from, const Vector3d& step) {
    std::vector<LivingPile::Pose> poses;
    for (int k = 0; k < 120; ++k)
      poses.push_back(at(from.x() + k * step.x(), from.y() + k * step.y(), from.z() + k * step.z()));
    return poses;
  };
  EXPECT_FALSE(pile.first_push(2, along({0, 0, 75.5}, {0, 0, 2}), 3)) << "nothing lies on it";
  EXPECT_FALSE(pile.first_push(3, along({205, 0, 25}, {0, 0, 2}), 3)) << "it only brushes its neighbours";
  const auto lifts = pile.first_push(1, along({0, 0, 25}, {0, 0, 2}), 3);
  ASSERT_TRUE(lifts);
  EXPECT_EQ(lifts->object, 2);
  EXPECT_NEAR(static_cast<double>(lifts->pose), 2, 1);
  EXPECT_GT(lifts->depth_mm, 3);
  const auto wall = pile.first_push(3, along({205, 0, 25}, {2, 0, 0}), 3);
  ASSERT_TRUE(wall);
  EXPECT_EQ(wall->object, 0);
  EXPECT_NEAR(205 + 2.0 * static_cast<double>(wall->pose), 404, 3);
}
}  // namespace
}  // namespace binpick::emulators
