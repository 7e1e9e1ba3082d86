#include "vision/clearance.hpp"

#include <gtest/gtest.h>

#include "tests/unit/detect/table.hpp"

namespace binpick::vision {
namespace {
using namespace table;
}  // namespace

TEST(Clearance, ABarAloneOnTheFloorIsFree) {
  for (std::uint32_t seed = 0; seed < 20; ++seed) {
    Table table{bar()};
    table.lay({10, 20, 10}, 0.1 * seed);
    table.add_noise(seed);
    const GraspChoice choice = table.choose({across_bar()});
    ASSERT_EQ(choice.reachable.size(), 1U) << choice.unreachable.front().reason;
    EXPECT_DOUBLE_EQ(choice.reachable[0].clearance_mm, 4 * kNoiseMm);
    EXPECT_TRUE(choice.rejected.empty());
  }
}

TEST(Clearance, ANeighbourBesideTheJawIsInTheWay) {
  // The jaw takes up y from 10 mm to 26 mm, x within 6 mm, down to 6 mm above the floor.
  const auto with_block = [](double x0, double x1, double y0, double y1, float z) {
    Table table{bar()};
    table.lay({0, 0, 10});
    table.lay_block(x0, x1, y0, y1, z);
    return table.why_not(across_bar());
  };
  EXPECT_EQ(with_block(-40, 40, 20, 40, 15), Obstacle::Neighbour);
  EXPECT_EQ(with_block(-40, 40, 24, 40, 15), Obstacle::Neighbour);
  EXPECT_EQ(with_block(-40, 40, 28, 40, 15), Obstacle::None);
  EXPECT_EQ(with_block(-40, 40, 20, 40, 5), Obstacle::None);
  EXPECT_EQ(with_block(8, 40, 20, 40, 15), Obstacle::None);
  EXPECT_EQ(with_block(4, 40, 20, 40, 15), Obstacle::Neighbour);
  // Between jaw and bar: hit when the jaws close.
  EXPECT_EQ(with_block(-4, 4, 13, 16, 15), Obstacle::Neighbour);
  // The palm is 60 mm along y at 34 mm and more above the tcp's tips, which stand at 6 mm.
  EXPECT_EQ(with_block(-10, 10, 29, 40, 50), Obstacle::Neighbour);
  EXPECT_EQ(with_block(-10, 10, 29, 40, 40), Obstacle::None);
}

TEST(Clearance, ANeighbourThatWasFoundIsWhereItWasFound) {
  Table table{bar()};
  table.lay({0, 0, 10});
  table.lay({0, 33, 10});
  EXPECT_EQ(table.why_not(across_bar()), Obstacle::Neighbour);
  // Where the scanner saw nothing of it, it is there all the same.
  table.image.z_mm.block(135, 100, 28, 100).setConstant(kHole);
  ReachLimits limits = usual();
  limits.unmeasured = Unmeasured::Free;
  EXPECT_EQ(table.why_not(across_bar(), limits), Obstacle::Neighbour);
  table.report.detections[1].T_supply_object.iso.translation().y() = 38;
  EXPECT_EQ(table.why_not(across_bar(), limits), Obstacle::None);
}

TEST(Clearance, SomethingOnTheObjectIsNamed) {
  Table table{bar()};
  table.lay({0, 0, 10});
  table.lay_block(20, 34, -14, 14, 35);
  EXPECT_EQ(table.why_not(across_bar()), Obstacle::Covered);
  const GraspChoice choice = table.choose({across_bar()});
  EXPECT_NE(choice.unreachable[0].reason.find("something lies on it"), std::string::npos);
  EXPECT_EQ(main_obstacle(choice), Obstacle::Covered);
}

TEST(Clearance, SpecksAreNoObstacles) {
  Table table{bar()};
  table.lay({0, 0, 10});
  table.add_noise(1);
  std::mt19937 random{5};
  for (int k = 0; k < 300; ++k)
    table.image.z_mm(static_cast<Eigen::Index>(3 * (random() % 80)), static_cast<Eigen::Index>(3 * (random() % 100))) +=
        20;
  EXPECT_EQ(table.why_not(across_bar()), Obstacle::None);
}

TEST(Clearance, WallsAreSolidBelowTheirHeight) {
  // The jaws' outer faces are 26 mm beside the bar's middle.
  Table near{bar()};
  near.lay({0, 120 - 24, 10});
  EXPECT_EQ(near.why_not(across_bar()), Obstacle::Wall);
  Table clear{bar()};
  clear.lay({0, 120 - 28, 10});
  // The palm would stand 2 mm within the wall, were it not above its top.
  EXPECT_EQ(clear.why_not(across_bar()), Obstacle::Wall);
  Gripper high = two_jaws();
  high.jaws->size_mm.z() = 80;
  high.body[0].T_tcp_solid.translation().z() = 6 - 80 - 15;
  EXPECT_EQ(clear.why_not(across_bar(), usual(), high), Obstacle::None);
  EXPECT_EQ(near.why_not(across_bar(), usual(), high), Obstacle::Wall);
}

TEST(Clearance, TheFloorIsSolid) {
  Table table{bar()};
  table.lay({0, 0, 10});
  Grasp low = across_bar();
  low.T_object_tcp.iso.translation().z() = -5;
  EXPECT_EQ(table.why_not(low), Obstacle::Floor);
  low.T_object_tcp.iso.translation().z() = -3;
  EXPECT_EQ(table.why_not(low), Obstacle::None);
}

TEST(Clearance, HolesAreWhatTheIntegratorSays) {
  // A step of 20 mm beside the jaw, and what is before it unseen.
  const auto with_hole = [](Unmeasured unmeasured, int rows) {
    Table table{bar()};
    table.lay({0, 0, 10});
    table.lay_block(-150, 150, 30, 120, 40);
    table.image.z_mm.block(150 - rows, 0, rows, 300).setConstant(kHole);  // up to y = 30
    ReachLimits limits = usual();
    limits.unmeasured = unmeasured;
    return table.why_not(across_bar(), limits);
  };
  EXPECT_EQ(with_hole(Unmeasured::Free, 1), Obstacle::None);
  EXPECT_EQ(with_hole(Unmeasured::Free, 15), Obstacle::None);
  // What stands 40 mm high may hide something 16 mm beside it.
  EXPECT_EQ(with_hole(Unmeasured::Blocked, 15), Obstacle::Unmeasured);
  EXPECT_EQ(with_hole(Unmeasured::Blocked, 3), Obstacle::None);
}

TEST(Clearance, WhereHolesAreFreeTheyAreTheLastChoice) {
  Table table{bar()};
  table.lay({0, 50, 40});
  table.lay({0, -50, 10});
  ReachLimits limits = usual();
  limits.unmeasured = Unmeasured::Free;
  EXPECT_EQ(table.choose({across_bar()}, limits).reachable.at(0).detection, 0U);
  table.lay_block(-60, 60, 82, 119, 75);
  table.image.z_mm.block(180, 90, 22, 120).setConstant(kHole);  // y from 60 to 82
  const GraspChoice choice = table.choose({across_bar()}, limits);
  ASSERT_EQ(choice.reachable.size(), 2U);
  EXPECT_EQ(choice.reachable[0].detection, 1U);
  EXPECT_EQ(choice.reachable[1].clearance_mm, 0);
}

TEST(Clearance, HolesMayBeFreeOnlyWhereNothingElseCanBeTaken) {
  Table table{bar()};
  table.lay({0, 50, 40});
  table.lay_block(-60, 60, 82, 119, 75);
  table.image.z_mm.block(180, 90, 22, 120).setConstant(kHole);  // y from 60 to 82
  ReachLimits limits = usual();
  limits.unmeasured = Unmeasured::Blocked;
  EXPECT_TRUE(table.choose({across_bar()}, limits).reachable.empty());
  limits.unmeasured = Unmeasured::Last;
  EXPECT_EQ(table.choose({across_bar()}, limits).reachable.size(), 1U);
  table.lay({0, -50, 10});
  const GraspChoice choice = table.choose({across_bar()}, limits);
  ASSERT_EQ(choice.reachable.size(), 1U);
  EXPECT_EQ(choice.reachable[0].detection, 1U);
}

TEST(Clearance, ATiltedWayIsFreeAlongAllOfIt) {
  // Coming in from +y, tilted by 30 degrees; a bank stands there, higher than the bar, well beside the grasp itself.
  Table table{bar()};
  table.lay({0, 0, 10}, 0, 0);
  const Grasp tilted = [] {
    Grasp grasp;
    grasp.T_object_tcp.iso.linear() =
        (Eigen::AngleAxisd(kPi + kPi / 6, Vector3d::UnitX())).toRotationMatrix();  // the jaws along x
    grasp.T_object_tcp.iso.translation() = Vector3d(0, 0, 4);
    grasp.opening_mm = 80;
    grasp.holding_mm = 60;
    grasp.approach_mm = 60;
    return grasp;
  }();
  Gripper wide = two_jaws();
  wide.jaws->opening_max_mm = 90;
  EXPECT_EQ(table.why_not(tilted, usual(), wide), Obstacle::None);
  const Eigen::Vector3d back =
      -(table.report.detections[0].T_supply_object.iso * tilted.T_object_tcp.iso).linear().col(2);
  const double side = back.y() > 0 ? 1 : -1;
  table.lay_block(-60, 60, side > 0 ? 45 : -70, side > 0 ? 70 : -45, 70);
  EXPECT_EQ(table.why_not(tilted, usual(), wide), Obstacle::Neighbour);
  Grasp short_way = tilted;
  short_way.approach_mm = 0;
  short_way.T_object_tcp.iso.linear() = Eigen::AngleAxisd(kPi, Vector3d::UnitX()).toRotationMatrix();
  EXPECT_EQ(table.why_not(short_way, usual(), wide), Obstacle::None);
}

TEST(Clearance, InASlantedSupplyTheHeldPartMustPass) {
  // Lifted straight up, which is aslant in the supply, the bar's end meets a post that the gripper itself passes by.
  Table table{bar()};
  table.lay({0, 0, 10});
  Gripper slim = two_jaws();
  slim.body.clear();
  ReachLimits slanted = usual();
  slanted.T_base_supply.iso.linear() = Eigen::AngleAxisd(-kPi / 6, Vector3d::UnitY()).toRotationMatrix();
  EXPECT_EQ(table.why_not(across_bar(), slanted, slim), Obstacle::None);
  table.lay_block(34, 38, -9, 9, 45);
  EXPECT_EQ(table.why_not(across_bar(), slanted, slim), Obstacle::Neighbour);
  EXPECT_EQ(table.why_not(across_bar(), usual(), slim), Obstacle::None) << "level, it passes";
  // So far and no farther it has to pass.
  Grasp little = across_bar();
  little.retreat_mm = 5;
  EXPECT_EQ(table.why_not(little, slanted, slim), Obstacle::None);
}

TEST(Clearance, InASlantedSupplyTheGripperMustPassOnTheWayOut) {
  Table table{bar()};
  table.lay({0, 0, 10});
  ReachLimits slanted = usual();
  slanted.T_base_supply.iso.linear() = Eigen::AngleAxisd(-kPi / 6, Vector3d::UnitY()).toRotationMatrix();
  EXPECT_EQ(table.why_not(across_bar(), slanted), Obstacle::None);
  table.lay_block(20, 60, -60, -14, 36);  // beside the bar's way, under the palm
  EXPECT_EQ(table.why_not(across_bar(), slanted), Obstacle::Neighbour);
  EXPECT_EQ(table.why_not(across_bar()), Obstacle::None);
}

TEST(Clearance, InASlantedSupplyTheWayDownMustBeFree) {
  // The tool stands as the supply does; it comes down to the approach pose along the base's z, where a post stands.
  Table table{bar()};
  table.lay({0, 0, 10});
  ReachLimits slanted = usual();
  slanted.T_base_supply.iso.linear() = Eigen::AngleAxisd(-kPi / 6, Vector3d::UnitY()).toRotationMatrix();
  Gripper slim = two_jaws();
  slim.body.clear();
  Grasp low = across_bar();
  low.approach_mm = 15;
  low.retreat_mm = 12;
  EXPECT_EQ(table.why_not(low, slanted, slim), Obstacle::None);
  table.lay_block(8, 12, -26, -14, 34);  // over the lift's 12 mm, in the way of the descent
  EXPECT_EQ(table.why_not(low, slanted, slim), Obstacle::Neighbour);
}

TEST(Clearance, ABaseThatDoesNotPointUpIsNoEnd) {
  Table table{bar()};
  table.lay({0, 0, 10});
  for (const double angle : {kPi / 2, 2 * kPi / 3, kPi}) {
    ReachLimits turned = usual();
    turned.T_base_supply.iso.linear() = Eigen::AngleAxisd(angle, Vector3d::UnitY()).toRotationMatrix();
    EXPECT_NE(table.why_not(across_bar(), turned), Obstacle::None) << "through the floor or the wall";
  }
}

TEST(Clearance, WhatMayLieUnderAnotherOneGoesLast) {
  // The second bar lies across the first one's end and reaches over it by a hair; the third lies alone, lower.
  Table table{bar()};
  table.lay({0, 0, 30});
  table.lay({40 - 0.2, 0, 50}, kPi / 2);
  table.lay({0, 85, 10});
  GraspChoice choice = table.choose({across_bar()});
  ASSERT_EQ(choice.reachable.size(), 3U) << choice.unreachable.front().reason;
  EXPECT_EQ(choice.reachable.back().detection, 0U);
  EXPECT_NEAR(choice.reachable.back().covered_mm, 0.2, 0.2);
  EXPECT_EQ(choice.reachable.front().covered_mm, 0);
  // A little more, and it lies on it for sure.
  table.report.detections[1].T_supply_object.iso.translation().x() -= 1;
  choice = table.choose({across_bar()});
  ASSERT_EQ(choice.unreachable.size(), 1U);
  EXPECT_EQ(choice.unreachable[0].why, Obstacle::Covered);
  EXPECT_NE(choice.unreachable[0].reason.find("mm wide"), std::string::npos) << choice.unreachable[0].reason;
}

TEST(Clearance, AnotherGraspStandsByForASecondTry) {
  Table table{bar()};
  table.lay({0, 0, 10});
  Grasp at_end = across_bar(), near = across_bar();
  at_end.T_object_tcp.iso.translation().x() = 20;
  near.T_object_tcp.iso.translation().x() = 5;
  EXPECT_FALSE(table.choose({across_bar(), near}).reachable[0].other) << "nearly the same";
  const auto found = table.choose({across_bar(), near, at_end}).reachable[0];
  ASSERT_TRUE(found.other);
  EXPECT_EQ(found.other->grasp, 2U);
  EXPECT_NEAR(found.other->T_supply_grasp.iso.translation().x(), 20, 1e-6);
  EXPECT_NEAR(found.other->T_supply_approach.iso.translation().z() - found.other->T_supply_grasp.iso.translation().z(),
              60, 1e-6);
  // It has to be free as well.
  table.lay_block(14, 30, 14, 30, 40);
  EXPECT_FALSE(table.choose({across_bar(), near, at_end}).reachable[0].other);
}

TEST(Clearance, AGripFromWithinABore) {
  Gripper gripper = two_jaws();
  gripper.jaws->size_mm = {6, 10, 40};
  Grasp within = across_bar();
  within.T_object_tcp.iso.translation().z() = 2;
  within.opening_mm = 10;
  within.holding_mm = 18;
  for (const bool seen : {true, false}) {
    Table table{frame_part()};
    table.lay({0, 0, 10});
    if (!seen) table.image.z_mm.block(105, 135, 30, 30).setConstant(kHole);
    EXPECT_EQ(table.why_not(within, usual(), gripper), Obstacle::None) << seen;
    // Something stands in the bore.
    if (seen) table.lay_block(-15, 15, -15, 15, 15);
    if (seen) {
      EXPECT_EQ(table.why_not(within, usual(), gripper), Obstacle::Neighbour);
    }
  }
}

TEST(Clearance, JawsThatHitThePartItselfAreNamed) {
  Table table{bar()};
  table.lay({0, 0, 10});
  Grasp narrow = across_bar();
  narrow.opening_mm = 19;
  narrow.holding_mm = 18;
  EXPECT_EQ(table.why_not(narrow), Obstacle::Itself);
  EXPECT_TRUE(hits_part(two_jaws(), narrow, bar(), 0.2));
  EXPECT_FALSE(hits_part(two_jaws(), across_bar(), bar(), 0.2));
  Grasp deep = across_bar();
  deep.T_object_tcp.iso.translation().z() = -30;  // the palm within the bar
  EXPECT_TRUE(hits_part(two_jaws(), deep, bar(), 0.2));
}

TEST(Clearance, TheSymmetryBringsAFreeWayIn) {
  // Jaws at the bar's two ends would hit the blocks beside; half a turn about z changes nothing, a quarter does.
  Table table{bar()};
  table.lay({0, 0, 10});
  table.lay_block(-8, 8, 15, 30, 18);
  Symmetry symmetry;
  symmetry.kind = Symmetry::Kind::Finite;
  symmetry.rotations = {Eigen::Matrix3d::Identity(), Eigen::AngleAxisd(kPi, Vector3d::UnitZ()).toRotationMatrix()};
  Grasp off_middle = across_bar();
  off_middle.T_object_tcp.iso.translation().x() = 5;
  EXPECT_TRUE(table.choose({off_middle}, usual(), two_jaws(), {}).reachable.empty());
  off_middle.T_object_tcp.iso.translation().x() = 18;
  const GraspChoice choice = table.choose({off_middle}, usual(), two_jaws(), symmetry);
  ASSERT_EQ(choice.reachable.size(), 1U);
}

TEST(Clearance, PreferredGraspsGoFirstThenRoomyOnes) {
  Table table{bar()};
  table.lay({0, 0, 10});
  table.lay_block(-40, 0, 26.4, 60, 18);  // half a millimetre beside the jaw of the first
  Grasp narrow = across_bar(), roomy = across_bar();
  narrow.T_object_tcp.iso.translation().x() = -10;
  roomy.T_object_tcp.iso.translation().x() = 12;
  const auto best = [&] { return table.choose({narrow, roomy}).reachable.at(0); };
  EXPECT_EQ(best().grasp, 1U);
  narrow.preference = 1;
  EXPECT_EQ(best().grasp, 0U);
  EXPECT_LT(best().clearance_mm, 4 * kNoiseMm);
  table.lay_block(-40, 0, 20, 60, 18);
  EXPECT_EQ(best().grasp, 1U);
}

TEST(Clearance, RoomyPicksGoBeforeHigherOnes) {
  Table table{bar()};
  table.lay({0, 60, 40});
  table.lay({0, -60, 10});
  EXPECT_EQ(table.choose({across_bar()}).reachable.at(0).detection, 0U);
  table.lay_block(-40, 40, 60 + 26.4, 119, 48);
  const GraspChoice choice = table.choose({across_bar()});
  ASSERT_EQ(choice.reachable.size(), 2U);
  EXPECT_EQ(choice.reachable[0].detection, 1U);
  EXPECT_LT(choice.reachable[1].clearance_mm, choice.reachable[0].clearance_mm);
}

TEST(Clearance, TheArmsReachIsALimit) {
  Table table{bar()};
  table.lay({50, 0, 10});
  ReachLimits limits = usual();
  limits.T_base_supply.iso.translation() = Vector3d{800, 0, -300};
  EXPECT_EQ(table.why_not(across_bar(), limits), Obstacle::None);
  limits.radius_max_mm = 880;
  EXPECT_EQ(table.why_not(across_bar(), limits), Obstacle::Reach);
  limits.radius_max_mm = 920;
  EXPECT_EQ(table.why_not(across_bar(), limits), Obstacle::None);
  limits.axis_min_mm = 860;
  EXPECT_EQ(table.why_not(across_bar(), limits), Obstacle::Reach);
  const GraspChoice choice = table.choose({across_bar()}, limits);
  EXPECT_EQ(choice.unreachable[0].reason, "tcp 850 mm from the base's z axis, less than 860 mm");
}

TEST(Clearance, ContactIsWhatSampledPointsSay) {
  // Heights of blocks at random, a room at random: the deepest of the sampled points below the surface.
  std::mt19937 random{11};
  const auto even = [&](double low, double high) { return std::uniform_real_distribution{low, high}(random); };
  int hits = 0;
  for (int k = 0; k < 300; ++k) {
    Heights heights;
    heights.pixel_mm = 2;
    heights.origin_mm = {-99, -99};
    heights.z_mm = Grid<float>::Zero(100, 100);
    heights.kind = Grid<Heights::Kind>::Constant(100, 100, Heights::Kind::Known);
    for (int block = 0; block < 12; ++block) {
      const auto r = static_cast<Eigen::Index>(random() % 90), c = static_cast<Eigen::Index>(random() % 90);
      heights.z_mm.block(r, c, 10, 10) = static_cast<float>(even(0, 60));
    }
    heights.block_mm = Grid<float>::Zero(13, 13);
    for (Eigen::Index r = 0; r < 100; ++r)
      for (Eigen::Index c = 0; c < 100; ++c) {
        float& block = heights.block_mm(r / Heights::kBlockPx, c / Heights::kBlockPx);
        block = std::max(block, heights.z_mm(r, c));
      }
    Grasp grasp = across_bar(even(-0.6, 0.6));
    grasp.opening_mm = even(20, 44);
    grasp.holding_mm = even(5, 44);
    Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
    T.linear() = Eigen::AngleAxisd(even(0, 6), Vector3d::UnitZ()).toRotationMatrix() * grasp.T_object_tcp.iso.linear();
    T.translation() = Vector3d{even(-50, 50), even(-50, 50), even(20, 90)};
    // Pixels stand for their centres: a body that is larger by their half diagonal meets what this one's points do.
    const std::vector<Swept> room = room_of(two_jaws(), grasp, T, 0), larger = room_of(two_jaws(), grasp, T, 1.5);
    double deepest = 0;
    for (const Swept& body : k % 2 == 0 ? room : larger)
      for (int i = 0; i < 4000; ++i) {
        Vector3d p = body.middle_mm();
        const bool corner = i % 4 == 0;
        for (const Vector3d& edge : body.edges_mm())
          p += (corner ? (random() % 2 == 0 ? -1.0 : 1.0) : even(-1, 1)) * edge;
        const auto col = std::lround((p.x() - heights.origin_mm.x()) / 2);
        const auto row = std::lround((p.y() - heights.origin_mm.y()) / 2);
        if (row < 0 || col < 0 || row >= 100 || col >= 100) continue;
        deepest = std::max(deepest, static_cast<double>(heights.z_mm(row, col)) - p.z());
      }
    const Contact found = contact(k % 2 == 0 ? larger : room, heights, {});
    if (k % 2 == 0 && deepest > 0.1) {
      EXPECT_NE(found.with, Obstacle::None) << k << ": " << deepest;
    }
    if (k % 2 == 1 && found.with == Obstacle::Neighbour && found.depth_mm > 3) {
      EXPECT_GT(deepest, 0) << k << ": " << found.depth_mm;
    }
    hits += found.with == Obstacle::Neighbour ? 1 : 0;
  }
  EXPECT_GT(hits, 50);
  EXPECT_LT(hits, 290);
}
}  // namespace binpick::vision
