#include "tests/emulators/world/grip.hpp"

#include <chrono>
#include <cstdio>
#include <gtest/gtest.h>
#include <numbers>

#include "tests/emulators/world/solid_contact.hpp"

namespace binpick::emulators {
namespace {
using Eigen::Isometry3d;
using Eigen::Vector3d;
using Kind = GripResult::Kind;
using Phase = GripResult::Phase;
using Solid = vision::Gripper::Solid;

constexpr double kDegree = std::numbers::pi / 180;
const Vector3d kSupply{1000, 800, 500};

Solid solid(Solid::Shape shape, const Vector3d& size_mm) { return {shape, size_mm, Isometry3d::Identity()}; }
Isometry3d shifted(double x, double y, double z) { return Isometry3d{Eigen::Translation3d{x, y, z}}; }

TEST(SolidContact, ABoxMeetsFacesEdgesAndCornersAndNothingBeside) {
  const RayMesh cube{box_mesh({100, 100, 100})};
  const Solid box = solid(Solid::Shape::Box, {20, 20, 20});
  EXPECT_TRUE(meets(box, shifted(59.9, 0, 0), 0, cube));
  EXPECT_FALSE(meets(box, shifted(60.1, 0, 0), 0, cube));
  EXPECT_FALSE(meets(box, shifted(59.9, 0, 0), 0.5, cube)) << "0.1 mm deep only";
  EXPECT_TRUE(meets(box, shifted(59, 59, 59), 0.5, cube)) << "corner in corner";
  // Turned by 45 degrees, an edge stands out by 14.14 mm.
  const Isometry3d turned = shifted(64, 0, 0) * Eigen::AngleAxisd{45 * kDegree, Vector3d::UnitZ()};
  EXPECT_TRUE(meets(box, turned, 0, cube));
  EXPECT_FALSE(meets(box, shifted(0.2, 0, 0) * turned, 0, cube));
  EXPECT_FALSE(meets(box, shifted(64, 56, 0) * Eigen::AngleAxisd{45 * kDegree, Vector3d::UnitZ()}, 0, cube))
      << "bounding boxes overlap, edges do not";
  EXPECT_NEAR(depth_mm(box, shifted(55, 0, 0), 0.5, cube), 4, 1e-9) << "the last doubling below 5 mm";
  EXPECT_EQ(depth_mm(box, shifted(59.9, 0, 0), 0.5, cube), 0);
}

TEST(SolidContact, ACylinderIsRoundAndEnds) {
  const RayMesh cube{box_mesh({100, 100, 100})};
  const Solid cylinder = solid(Solid::Shape::Cylinder, {20, 20, 40});
  EXPECT_TRUE(meets(cylinder, shifted(59.9, 0, 0), 0, cube));
  EXPECT_FALSE(meets(cylinder, shifted(60.1, 0, 0), 0, cube));
  EXPECT_FALSE(meets(cylinder, shifted(57.5, 57.5, 0), 0, cube))
      << "a box of its size would: the corner is 10.6 mm away";
  EXPECT_TRUE(meets(cylinder, shifted(56.5, 56.5, 0), 0, cube)) << "9.2 mm";
  EXPECT_TRUE(meets(cylinder, shifted(0, 0, 69.9), 0, cube));
  EXPECT_FALSE(meets(cylinder, shifted(0, 0, 70.1), 0, cube));
  EXPECT_TRUE(meets(cylinder, shifted(45, 0, 0), 0, cube)) << "its axis runs along the face, inside";
}

ExamplePart bar_part() {
  ExamplePart part;
  part.name = "bar";
  part.scanner = "lms400";
  part.mesh = box_mesh({200, 40, 40});
  part.pieces = {box_piece({-100, -20, -20}, {100, 20, 20})};
  return part;
}
LivingPile::Pose at(double x, double y, double z, double turn_deg = 0) {
  return {shifted(x, y, z) * Eigen::AngleAxisd{turn_deg * kDegree, Vector3d::UnitZ()}};
}

/// From above across a bar of 40 mm, the tips 30 mm down.
class Bars : public testing::Test {
 protected:
  Bars() {
    gripper_.jaws = vision::Gripper::Jaws{80, {10, 20, 60}, 0};
    Solid palm = solid(Solid::Shape::Box, {110, 60, 50});
    palm.T_tcp_solid = shifted(0, 0, -85);
    gripper_.body.push_back(palm);
    grasp_.name = "across";
    grasp_.T_object_tcp.iso = shifted(0, 0, -10) * Eigen::AngleAxisd{180 * kDegree, Vector3d::UnitX()} *
                              Eigen::AngleAxisd{90 * kDegree, Vector3d::UnitZ()};
    grasp_.opening_mm = 60;
    grasp_.holding_mm = 40;
  }
  GripMotion motion(const LivingPile::Pose& T_supply_object, const Isometry3d& off = Isometry3d::Identity()) const {
    GripMotion motion;
    motion.T_supply_grasp.iso = T_supply_object.iso * grasp_.T_object_tcp.iso * off;
    motion.T_supply_approach.iso = motion.T_supply_grasp.iso * Eigen::Translation3d{0, 0, -grasp_.approach_mm};
    return motion;
  }
  GripResult taken(const std::vector<LivingPile::Pose>& bars, const GripMotion& motion) const {
    const LivingPile pile{bar_part(), bars, kSupply};
    return grip(pile, gripper_, {grasp_}, symmetry_, motion, GripRules{});
  }

  vision::Gripper gripper_;
  vision::Grasp grasp_;
  vision::Symmetry symmetry_;
};

TEST_F(Bars, AloneItIsTaken) {
  const GripResult result = taken({at(100, 50, 20, 30)}, motion(at(100, 50, 20, 30)));
  EXPECT_EQ(to_string(result), "taken");
  EXPECT_EQ(result.object, 1);
  const auto closed = closed_on(RayMesh{bar_part().mesh}, gripper_, grasp_, GripRules{});
  ASSERT_TRUE(closed);
  EXPECT_NEAR(closed->jaws_mm, 40, 0.01);
  EXPECT_NEAR(closed->off_middle_mm, 0, 0.01);
}

TEST_F(Bars, APoseThatIsALittleOffHoldsItToo) {
  const auto bar = at(0, 0, 20);
  EXPECT_EQ(taken({bar}, motion(bar, shifted(5, 0, 0))).kind, Kind::Taken) << "the object slides to the middle";
  EXPECT_EQ(taken({bar}, motion(bar, shifted(0, 40, 0))).kind, Kind::Taken) << "along the bar";
  const GripResult beside = taken({bar}, motion(bar, shifted(12, 0, 0)));
  EXPECT_EQ(beside.kind, Kind::Collision) << "a jaw comes down on the bar";
  EXPECT_EQ(beside.phase, Phase::Approach);
  EXPECT_EQ(beside.what, "jaw");
  EXPECT_EQ(beside.with, beside.object) << to_string(beside);
}

TEST_F(Bars, TurnedTheJawsTouchTooLittle) {
  const auto bar = at(0, 0, 20);
  const GripResult result = taken({bar}, motion(bar, Isometry3d{Eigen::AngleAxisd{12 * kDegree, Vector3d::UnitZ()}}));
  EXPECT_EQ(result.kind, Kind::Missed) << to_string(result);
}

TEST_F(Bars, TooHighTheJawsCloseOnNothing) {
  const auto bar = at(0, 0, 20);
  EXPECT_EQ(to_string(taken({bar}, motion(bar, shifted(0, 0, -32)))), "missed: the object is not between the jaws");
  EXPECT_EQ(taken({bar}, motion(bar, shifted(0, 0, -28))).what, "a jaw hardly touches the object");
  EXPECT_EQ(taken({bar}, motion(bar, shifted(0, 130, 0))).kind, Kind::Missed) << "beside its end";
  EXPECT_EQ(taken({}, motion(bar)).what, "nothing is there");
}

TEST_F(Bars, FloorWallsAndNeighboursAreHit) {
  const auto bar = at(0, 0, 20);
  const GripResult floor = taken({bar}, motion(bar, shifted(0, 0, 11)));
  EXPECT_EQ(floor.kind, Kind::Collision);
  EXPECT_EQ(floor.with, 0);
  EXPECT_NEAR(floor.from_grasp_mm, 0, 2) << to_string(floor);

  const auto near_wall = at(0, 379, 20);  // 1 mm from it; the jaw needs 20
  const GripResult wall = taken({near_wall}, motion(near_wall));
  EXPECT_EQ(wall.kind, Kind::Collision);
  EXPECT_EQ(wall.phase, Phase::Down);
  EXPECT_EQ(wall.with, 0) << to_string(wall);

  const GripResult neighbour = taken({bar, at(0, 55, 20)}, motion(bar));  // 15 mm free beside the bar
  EXPECT_EQ(neighbour.kind, Kind::Collision);
  EXPECT_EQ(neighbour.what, "jaw");
  EXPECT_EQ(neighbour.with, 2) << to_string(neighbour);
  EXPECT_EQ(taken({bar, at(0, 62, 20)}, motion(bar)).kind, Kind::Taken) << "22 mm are enough";

  // One that stands upright beside the gripper's way reaches the palm only.
  LivingPile::Pose upright{shifted(0, 78, 100) * Eigen::AngleAxisd{90 * kDegree, Vector3d::UnitY()}};
  EXPECT_EQ(taken({bar, upright}, motion(bar)).kind, Kind::Taken);
  upright.iso.translation().y() = 72;
  const GripResult palm = taken({bar, upright}, motion(bar));
  EXPECT_EQ(palm.kind, Kind::Collision);
  EXPECT_EQ(palm.what, "body") << to_string(palm);
}

TEST_F(Bars, WhatLiesOnItMustNotBeLifted) {
  // The second bar lies across one end of the first.
  const auto lower = at(0, 0, 20), across = at(75, 0, 60.2, 90);
  const GripResult result = taken({lower, across}, motion(lower));
  EXPECT_EQ(result.kind, Kind::Collision);
  EXPECT_EQ(result.phase, Phase::Up);
  EXPECT_EQ(result.what, "held object");
  EXPECT_EQ(result.with, 2) << to_string(result);
  EXPECT_EQ(taken({lower, across}, motion(across)).kind, Kind::Taken) << "that one first";
  EXPECT_EQ(taken({lower, at(0, 41, 20)}, motion(lower)).kind, Kind::Collision);
  EXPECT_EQ(taken({lower, at(200.2, 0, 20)}, motion(lower)).kind, Kind::Taken) << "end to end they may brush";
}

TEST_F(Bars, AnotherOneBetweenTheJawsIsNoGrip) {
  // A thin bar stands in the gap between jaw and bar.
  grasp_.opening_mm = 70;
  const auto bar = at(0, 0, 20);
  EXPECT_EQ(taken({bar}, motion(bar)).kind, Kind::Taken);
  const LivingPile pile{bar_part(), {bar, at(190, 12, 65)}, kSupply};
  const GripResult over = grip(pile, gripper_, {grasp_}, symmetry_, motion(at(95, 0, 20)), GripRules{});
  EXPECT_NE(over.kind, Kind::Taken) << to_string(over);
}

TEST(Grip, ASleeveIsHeldFromWithin) {
  // Four walls around a square bore of 60 mm.
  ExamplePart part;
  part.name = "sleeve";
  part.scanner = "lms400";
  for (const double side : {-1.0, 1.0})
    for (const bool x : {true, false}) {
      vision::Mesh wall = box_mesh(x ? Vector3d{10, 80, 50} : Vector3d{60, 10, 50});
      const std::uint32_t first = static_cast<std::uint32_t>(part.mesh.vertices_mm.size());
      for (auto& v : wall.vertices_mm)
        part.mesh.vertices_mm.push_back(v + (x ? Eigen::Vector3f{static_cast<float>(35 * side), 0, 0}
                                               : Eigen::Vector3f{0, static_cast<float>(35 * side), 0}));
      for (const auto& [a, b, c] : wall.triangles) part.mesh.triangles.push_back({a + first, b + first, c + first});
    }
  part.pieces = {box_piece({-40, -40, -25}, {40, 40, 25})};
  vision::Gripper gripper;
  gripper.jaws = vision::Gripper::Jaws{60, {8, 20, 60}, 0};
  vision::Grasp grasp;
  grasp.T_object_tcp.iso = Isometry3d{Eigen::AngleAxisd{180 * kDegree, Vector3d::UnitX()}};
  grasp.opening_mm = 10;
  grasp.holding_mm = 44;
  const auto closed = closed_on(RayMesh{part.mesh}, gripper, grasp, GripRules{});
  ASSERT_TRUE(closed);
  EXPECT_NEAR(closed->jaws_mm, 44, 0.01) << "60 less two jaws of 8";
  const LivingPile pile{part, {at(0, 0, 25)}, kSupply};
  GripMotion motion;
  motion.T_supply_grasp.iso = at(0, 0, 25).iso * grasp.T_object_tcp.iso;
  motion.T_supply_approach.iso = shifted(0, 0, 100) * motion.T_supply_grasp.iso;
  EXPECT_EQ(to_string(grip(pile, gripper, {grasp}, {}, motion, GripRules{})), "taken");
  motion.T_supply_grasp.iso = shifted(6, 0, 0) * motion.T_supply_grasp.iso;
  motion.T_supply_approach.iso = shifted(6, 0, 0) * motion.T_supply_approach.iso;
  EXPECT_EQ(grip(pile, gripper, {grasp}, {}, motion, GripRules{}).kind, Kind::Taken);
  motion.T_supply_grasp.iso = shifted(14, 0, 0) * motion.T_supply_grasp.iso;
  motion.T_supply_approach.iso = shifted(14, 0, 0) * motion.T_supply_approach.iso;
  EXPECT_EQ(grip(pile, gripper, {grasp}, {}, motion, GripRules{}).kind, Kind::Collision);
}

TEST(Grip, AMagnetHoldsWhatItsFaceLiesOn) {
  vision::Gripper magnet;
  Solid pad = solid(Solid::Shape::Cylinder, {30, 30, 100});
  pad.T_tcp_solid = shifted(0, 0, -50);
  magnet.body.push_back(pad);
  vision::Grasp grasp;
  grasp.T_object_tcp.iso = shifted(0, 0, 20) * Eigen::AngleAxisd{180 * kDegree, Vector3d::UnitX()};
  const LivingPile pile{bar_part(), {at(0, 0, 20)}, kSupply};
  const auto taken = [&](const Isometry3d& off) {
    GripMotion motion;
    motion.T_supply_grasp.iso = at(0, 0, 20).iso * grasp.T_object_tcp.iso * off;
    motion.T_supply_approach.iso = shifted(0, 0, 100) * motion.T_supply_grasp.iso;
    return grip(pile, magnet, {grasp}, {}, motion, GripRules{});
  };
  EXPECT_EQ(to_string(taken(Isometry3d::Identity())), "taken");
  EXPECT_EQ(taken(shifted(0, 0, -4)).kind, Kind::Missed) << "above it";
  EXPECT_EQ(taken(shifted(0, 16, 0)).kind, Kind::Missed) << "over the edge";
  EXPECT_EQ(taken(shifted(0, 0, 2)).kind, Kind::Collision) << "pressed in";
  EXPECT_NE(taken(Isometry3d{Eigen::AngleAxisd{15 * kDegree, Vector3d::UnitY()}}).kind, Kind::Taken) << "tilted";
}

TEST(Grip, ExamplePartsOnTheFloorAreTakenAsTheirGraspsSay) {
  for (const std::string& name : example_part_names()) {
    const ExamplePart part = example_part(name);
    std::vector<vision::Grasp> grasps;
    for (const ExampleGrasp& grasp : part.grasps) grasps.push_back(grasp.grasp());
    const LivingPile pile{part, 1, kSupply, 4};
    const auto& T = pile.world().objects().front().T_supply_object;
    int tried = 0, taken = 0;
    const auto began = std::chrono::steady_clock::now();
    vision::Symmetry symmetry;
    if (name == "gear_shaft") symmetry.kind = vision::Symmetry::Kind::Revolution;
    for (int turn = 0; turn < (name == "gear_shaft" ? 24 : 1); ++turn)
      for (const vision::Grasp& grasp : grasps) {
        const Isometry3d T_supply_tcp =
            T.iso * Eigen::AngleAxisd{15 * kDegree * turn, Vector3d::UnitZ()} * grasp.T_object_tcp.iso;
        if (T_supply_tcp.linear()(2, 2) > -0.7) continue;
        const GripMotion motion{{T_supply_tcp * Eigen::Translation3d{0, 0, -grasp.approach_mm}}, {T_supply_tcp}};
        ++tried;
        taken += grip(pile, part.gripper, grasps, symmetry, motion, GripRules::of(part)).kind == Kind::Taken;
      }
    const double ms = std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - began).count() /
                      std::max(tried, 1);
    std::printf("  %s: %d of %d grasps from above take it, %.1f ms each\n", name.c_str(), taken, tried, ms);
    EXPECT_GT(taken, 0) << name;
  }
}
}  // namespace
}  // namespace binpick::emulators
