#include "tests/emulators/world/world.hpp"

#include <chrono>
#include <cmath>
#include <cstdio>
#include <gtest/gtest.h>
#include <random>

#include "tests/emulators/world/example_parts.hpp"
#include "tests/emulators/world/pile.hpp"
#include "tests/emulators/world/ray_bundle.hpp"

namespace binpick::emulators {
namespace {
using Eigen::Vector3d;
const Vector3d kSupply{1000, 800, 500};
const Vector3d kDown{0, 0, -1};

TEST(World, EmptySupplyHasFloorAndWalls) {
  const World world{kSupply};
  const auto floor = world.cast({100, 50, 1800}, kDown, 3000);
  ASSERT_TRUE(floor);
  EXPECT_NEAR(floor->distance_mm, 1800, 1e-2);
  EXPECT_EQ(floor->object, 0);
  EXPECT_NEAR(floor->cos_incidence, 1, 1e-6);
  EXPECT_NEAR(world.cast({510, 0, 1800}, kDown, 3000)->distance_mm, 1300, 1e-2) << "top of the wall";
  EXPECT_NEAR(world.cast({0, 0, 250}, {1, 0, 0}, 3000)->distance_mm, 500, 1e-2);
  EXPECT_NEAR(world.cast({0, 0, 250}, {0, -1, 0}, 3000)->distance_mm, 400, 1e-2);
  EXPECT_NEAR(world.cast({900, 0, 1800}, kDown, 3000)->distance_mm, 1800, 1e-2) << "the hall's floor";
  EXPECT_FALSE(world.cast({0, 0, 1800}, {0, 0, 1}, 3000));
  EXPECT_FALSE(world.cast({0, 0, 1800}, kDown, 1700)) << "beyond the limit";
}

TEST(World, BlockOnTheFloorIsWhereItWasPut) {
  World world{kSupply};
  Transform<frame::Supply, frame::Object> T;
  T.iso = Eigen::Translation3d{100, -50, 60} * Eigen::AngleAxisd{0.3, Vector3d::UnitZ()};
  const int id = world.add("block", std::make_shared<RayMesh>(box_mesh({200, 100, 120})), T);
  const auto top = world.cast({100, -50, 1000}, kDown, 3000);
  ASSERT_TRUE(top);
  EXPECT_EQ(top->object, id);
  EXPECT_NEAR(top->distance_mm, 880, 1e-2);
  const Vector3d corner = T * Vector3d{99, 49, 0}, beyond = T * Vector3d{101, 49, 0};
  EXPECT_EQ(world.cast({corner.x(), corner.y(), 1000}, kDown, 3000)->object, id);
  EXPECT_EQ(world.cast({beyond.x(), beyond.y(), 1000}, kDown, 3000)->object, 0);
  EXPECT_TRUE(world.remove(id));
  EXPECT_FALSE(world.remove(id));
  EXPECT_EQ(world.cast({100, -50, 1000}, kDown, 3000)->object, 0);
  EXPECT_EQ(world.add("block", std::make_shared<RayMesh>(box_mesh({1, 1, 1})), T), id + 1) << "ids are not used twice";
}

TEST(World, RaysAgreeWithEveryTriangleTriedInTurn) {
  std::mt19937 random{5};
  std::uniform_real_distribution<float> place{-300, 300};
  for (const std::string& name : example_part_names()) {
    const vision::Mesh mesh = example_part(name).mesh;
    const RayMesh tree{mesh};
    int hits = 0;
    for (int i = 0; i < 400; ++i) {
      const Eigen::Vector3f origin{place(random), place(random), place(random)};
      const Eigen::Vector3f target = Eigen::Vector3f{place(random), place(random), place(random)} * 0.3F;
      const Eigen::Vector3f direction = (target - origin).normalized();
      float nearest = 2000;
      for (const auto& [a, b, c] : mesh.triangles) {
        // Where the ray meets the plane, and whether that is inside all three edges.
        const Eigen::Vector3f p = mesh.vertices_mm[a], q = mesh.vertices_mm[b], r = mesh.vertices_mm[c];
        const Eigen::Vector3f n = (q - p).cross(r - p);
        const float t = n.dot(p - origin) / n.dot(direction);
        const Eigen::Vector3f x = origin + t * direction;
        if (t > 0 && t < nearest && n.dot((q - p).cross(x - p)) >= 0 && n.dot((r - q).cross(x - q)) >= 0 &&
            n.dot((p - r).cross(x - r)) >= 0)
          nearest = t;
      }
      const auto hit = tree.cast(origin, direction, 2000);
      hits += hit.has_value();
      EXPECT_NEAR(hit ? hit->distance_mm : 2000, nearest, 0.05) << name;
    }
    EXPECT_GT(hits, 10) << name;
  }
}

void expect_settled(const std::string& name, int count, const Vector3d& size) {
  const ExamplePart part = example_part(name);
  const auto began = std::chrono::steady_clock::now();
  const Pile pile = settle(part, count, size, 11);
  const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - began).count();
  std::printf("  %d × %s: %.1f s, left speed %.1f mm/s, deepest penetration %.2f mm\n", count, name.c_str(), seconds,
              pile.speed_max_mm_s, pile.penetration_max_mm);
  ASSERT_EQ(pile.T_supply_object.size(), static_cast<std::size_t>(count));
  EXPECT_LT(pile.penetration_max_mm, 0.5);
  EXPECT_LT(pile.speed_max_mm_s, 20);
  int above_others = 0;
  for (const auto& T : pile.T_supply_object) {
    double low = 1e9;
    for (const auto& v : part.mesh.vertices_mm) {
      const Vector3d p = T * v.cast<double>();
      EXPECT_LT(std::abs(p.x()), size.x() / 2 + 1.5);
      EXPECT_LT(std::abs(p.y()), size.y() / 2 + 1.5);
      low = std::min(low, p.z());
    }
    EXPECT_GT(low, -1.5);
    above_others += low > 5;
  }
  EXPECT_GT(above_others, 0) << "a pile, not a layer";
}

TEST(Pile, TrackLinksLieInTheSupply) { expect_settled("track_link", 24, kSupply); }
TEST(Pile, SteeringWheelsLieInTheSupply) { expect_settled("steering_wheel", 9, kSupply); }
TEST(Pile, GearShaftsLieInTheSupply) { expect_settled("gear_shaft", 20, {500, 400, 300}); }
TEST(Pile, ContactBridgesLieInTheSupply) { expect_settled("contact_bridge", 20, {180, 180, 60}); }

TEST(Pile, SameSeedSamePileOtherSeedOther) {
  const ExamplePart part = example_part("track_link");
  const World a = make_pile(part, 6, kSupply, 3), b = make_pile(part, 6, kSupply, 3),
              c = make_pile(part, 6, kSupply, 4);
  ASSERT_EQ(a.objects().size(), 6U);
  for (std::size_t i = 0; i < 6; ++i) {
    EXPECT_EQ(a.objects()[i].T_supply_object.iso.matrix(), b.objects()[i].T_supply_object.iso.matrix());
    EXPECT_NE(a.objects()[i].T_supply_object.iso.matrix(), c.objects()[i].T_supply_object.iso.matrix());
  }
}

TEST(World, ABundleMeetsWhatItsRaysMeetOneByOne) {
  const World world = make_pile(example_part("gear_shaft"), 12, {500, 400, 300}, 3);
  std::mt19937 random{5};
  std::uniform_real_distribution<double> place{-300, 300};
  for (int bundle = 0; bundle < 40; ++bundle) {
    const Vector3d origin{place(random), place(random), 900};
    const Vector3d towards{place(random), place(random), 0};
    std::vector<Eigen::Vector3f> directions;
    for (int i = 0; i < 37; ++i) {
      const Vector3d at = towards + Vector3d{8.0 * i, bundle % 2 == 0 ? 0.0 : place(random), 0};
      directions.push_back((at - origin).normalized().cast<float>());
    }
    std::vector<BundleHit> hits;
    cast_bundle(world, origin.cast<float>(), directions, 2000, hits);
    ASSERT_EQ(hits.size(), directions.size());
    for (std::size_t i = 0; i < hits.size(); ++i) {
      const Vector3d direction = directions[i].cast<double>();
      const auto one = world.cast(origin, direction, 2000);
      ASSERT_EQ(hits[i].met(), one.has_value());
      // At an edge either neighbour is right.
      if (one->object != hits[i].object) continue;
      ASSERT_NEAR(hits[i].distance_mm, one->distance_mm, 0.01);
      EXPECT_NEAR(std::abs(hits[i].normal.cast<double>().dot(direction)), one->cos_incidence, 1e-3);
    }
    const World::Object& object = world.objects()[static_cast<std::size_t>(bundle) % world.objects().size()];
    cast_bundle(object, origin.cast<float>(), directions, 2000, hits);
    for (std::size_t i = 0; i < hits.size(); ++i) {
      EXPECT_TRUE(!hits[i].met() || hits[i].object == object.id);
      const auto one = world.cast(origin, directions[i].cast<double>(), 2000);
      EXPECT_TRUE(one->object != object.id || hits[i].met()) << "what is seen in the pile is seen alone";
    }
  }
}

TEST(World, ManyRaysAreCastASecond) {
  const World world = make_pile(example_part("track_link"), 20, kSupply, 1);
  const auto began = std::chrono::steady_clock::now();
  constexpr int n = 400'000;
  double sum = 0;
  for (int i = 0; i < n; ++i) {
    const Vector3d target{-500 + 1000.0 * (i % 633) / 633, -400 + 800.0 * (i / 633) / 633, 50};
    const Vector3d origin{0, 0, 1800};
    if (const auto hit = world.cast(origin, (target - origin).normalized(), 3000)) sum += hit->distance_mm;
  }
  const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - began).count();
  std::printf("  %.2f million rays a second at 20 track links\n", n / seconds * 1e-6);
  EXPECT_GT(sum / n, 1500);
}
}  // namespace
}  // namespace binpick::emulators
