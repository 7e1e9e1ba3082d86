#include "vision/ways_out.hpp"

#include <cmath>
#include <gtest/gtest.h>

#include "tests/unit/detect/table.hpp"

namespace binpick::vision {
namespace {
using namespace table;
constexpr double kPixelMm = 0.5, kLimitMm = 1;
const Vector3d kAlong = Vector3d{1, 0, 1}.normalized(), kUpperSide = Vector3d{-1, 0, 1}.normalized();

/// A bar of 60 × 20 × 20 mm that leans by 45 degrees, its upper end at +x, its lower one on the floor; and one that
/// lies across its lower half: lifted straight up the first would take it along, drawn out along itself it would not.
Eigen::Isometry3d leaning(double x = 0) {
  return Eigen::Translation3d{x, 0, 29} * Eigen::AngleAxisd{-kPi / 4, Vector3d::UnitY()} *
         Eigen::Isometry3d::Identity();
}
Eigen::Isometry3d across_it(double x = 0) {
  const Vector3d at = leaning(x).translation() + 25 * kUpperSide - 20 * kAlong;
  return Eigen::Translation3d{at} * Eigen::AngleAxisd{kPi / 2, Vector3d::UnitZ()} * Eigen::Isometry3d::Identity();
}

std::vector<WayOut> of_first(const std::vector<Eigen::Isometry3d>& bars, bool wanted = true, double diameter_mm = 60) {
  std::vector<Detection> detections;
  for (const auto& T : bars) detections.emplace_back().T_supply_object.iso = T;
  std::vector<bool> mask(bars.size(), false);
  mask[0] = wanted;
  return ways_out(Rasteriser{bar()}, diameter_mm, detections, mask, kPixelMm, kLimitMm).at(0);
}
}  // namespace

TEST(WaysOut, AlongItselfFromUnderWhatLiesAcross) {
  const auto ways = of_first({leaning(), across_it()});
  ASSERT_FALSE(ways.empty());
  EXPECT_GT(ways.front().way_mm.normalized().dot(kAlong), 0.9);
  for (const WayOut& way : ways) {
    EXPECT_LT(way.way_mm.dot(kUpperSide), 5) << "into the other one";
    EXPECT_LE(way.covered_mm, kLimitMm);
  }
  EXPECT_TRUE(of_first({leaning(), across_it()}, false).empty()) << "it was not asked for";
}

TEST(WaysOut, UnderAPileThereIsNone) {
  const Eigen::Isometry3d on_end{Eigen::Translation3d{leaning().translation() + 30 * kAlong + Vector3d{0, 0, 25}}};
  EXPECT_TRUE(of_first({leaning(), across_it(), on_end}).empty());
}

TEST(WaysOut, FarEnoughToPassStraightUpFromThere) {
  // A roof over its upper end: it has to come past that before it goes up.
  const Eigen::Isometry3d roof = Eigen::Translation3d{leaning().translation() + Vector3d{0, 0, 60}} *
                                 Eigen::AngleAxisd{kPi / 2, Vector3d::UnitZ()} * Eigen::Isometry3d::Identity();
  const auto without = of_first({leaning(), across_it()}), with = of_first({leaning(), across_it(), roof});
  ASSERT_FALSE(without.empty());
  ASSERT_FALSE(with.empty());
  EXPECT_GT(with.front().way_mm.norm(), without.front().way_mm.norm() + 1);
}

TEST(WaysOut, NoHigherThanRobotProgramsLift) {
  const auto ways = of_first({leaning(), across_it()}, true, 1000);
  ASSERT_FALSE(ways.empty());
  for (const WayOut& way : ways) EXPECT_LE(way.way_mm.z(), 250);
}

/// The whole choice.
class Aslant : public testing::Test {
 protected:
  explicit Aslant(double x = 0) {
    limits.tilt_max_rad = 0.9;
    scene.lay(leaning(x));
    scene.lay(across_it(x));
    // On the far side of the upper one: its own jaws have no room.
    scene.lay_block(x - 62, x - 44, -20, 20, 50);
  }
  /// At the upper end.
  static Grasp at_end() {
    Grasp grasp = across_bar();
    grasp.T_object_tcp.iso.translation().x() = 20;
    return grasp;
  }
  /// How the leaning one is taken; none: not.
  std::optional<Reachable> taken() const {
    const GraspChoice choice = scene.choose({at_end()}, limits);
    for (const Reachable& one : choice.reachable)
      if (one.detection == 0) return one;
    return std::nullopt;
  }
  Table scene{bar()};
  ReachLimits limits = usual();
};

TEST_F(Aslant, WhereNothingElseCanBeTaken) {
  const GraspChoice choice = scene.choose({at_end()}, limits);
  ASSERT_EQ(choice.reachable.size(), 1U) << choice.unreachable.front().reason;
  const Reachable& pick = choice.reachable.front();
  EXPECT_EQ(pick.detection, 0U);
  EXPECT_TRUE(pick.is_aslant);
  EXPECT_TRUE(pick.T_supply_retreat.iso.linear().isApprox(pick.T_supply_grasp.iso.linear()));
  const Vector3d way = pick.T_supply_retreat.iso.translation() - pick.T_supply_grasp.iso.translation();
  EXPECT_GT(way.normalized().dot(kAlong), 0.9);
  for (const Unreachable& one : choice.unreachable) EXPECT_NE(one.detection, 0U) << "it is one or the other";
}

TEST_F(Aslant, NotWhileSomethingCanBeLiftedStraightUp) {
  scene.lay({90, 60, 10});
  const GraspChoice choice = scene.choose({at_end()}, limits);
  ASSERT_EQ(choice.reachable.size(), 1U);
  const Reachable& pick = choice.reachable.front();
  EXPECT_EQ(pick.detection, 2U);
  EXPECT_FALSE(pick.is_aslant);
  const Vector3d up = pick.T_supply_retreat.iso.translation() - pick.T_supply_grasp.iso.translation();
  EXPECT_TRUE(up.isApprox(at_end().approach_mm * Vector3d::UnitZ(), 1e-9));
}

TEST_F(Aslant, NotThroughWhatWasNotFound) {
  scene.lay_block(32, 60, -60, 60, 79);
  EXPECT_FALSE(taken());
}

TEST_F(Aslant, NotThroughWhatLiesOnAnotherOne) {
  scene.lay_block(35, 57, -31, 31, 79);
  scene.lay({46, 0, 10}, kPi / 2);
  ASSERT_EQ(scene.image.z_mm(120, 196), 79) << "over the one that was found";
  EXPECT_FALSE(taken());
}

TEST_F(Aslant, NotWhereTheGripperWouldHitOnTheWayUpFromThere) {
  // The part passes between them, the jaws do not. Too steep to be taken themselves.
  for (const double side : {-1.0, 1.0}) scene.lay({28, 43 * side, 125}, kPi / 2, 1);
  EXPECT_FALSE(taken());
}

TEST_F(Aslant, NotWhereThePartAloneWouldHit) {
  scene.lay_block(32, 60, -8, 8, 70);  // between the jaws, under the palm
  EXPECT_FALSE(taken());
}

TEST_F(Aslant, NotWhereTheJawsAloneWouldHit) {
  for (const double side : {-18.0, 18.0}) scene.lay_block(24, 60, side - 5, side + 5, 80);
  EXPECT_FALSE(taken());
}

TEST_F(Aslant, NotWhereTheJawsWouldHitWhatWasFound) {
  // Too steep to be taken themselves.
  for (const double side : {-1.0, 1.0}) scene.lay({62, 26 * side, 60}, 0, side);
  EXPECT_FALSE(taken());
}

TEST_F(Aslant, NotWhereTheGripperHasNoWayIn) {
  scene.lay_block(-90, -70, -20, 20, 120);  // under the palm at the approach pose
  EXPECT_FALSE(taken());
}

TEST_F(Aslant, AfterWhatIsTightStraightUp) {
  scene.lay({90, 60.2, 10});
  scene.lay_block(60, 120, 86.4, 110, 40);  // .3 mm beside the open jaws
  const GraspChoice choice = scene.choose({at_end()}, limits);
  ASSERT_EQ(choice.reachable.size(), 2U);
  EXPECT_EQ(choice.reachable[0].detection, 2U);
  EXPECT_TRUE(choice.reachable[0].is_tight);
  EXPECT_TRUE(choice.reachable[1].is_aslant);
}

TEST_F(Aslant, ItsOtherGraspOrWayIsAnother) {
  Grasp beside = at_end();
  beside.T_object_tcp.iso.translation().x() -= 4;
  const GraspChoice choice = scene.choose({at_end(), beside}, limits);
  ASSERT_EQ(choice.reachable.size(), 1U);
  const Reachable& pick = choice.reachable.front();
  ASSERT_TRUE(pick.other);
  const auto way = [](const auto& one) {
    return (one.T_supply_retreat.iso.translation() - one.T_supply_grasp.iso.translation()).normalized();
  };
  EXPECT_TRUE(!is_same_way(pick.T_supply_grasp, pick.other->T_supply_grasp) ||
              way(pick).dot(way(*pick.other)) < std::cos(10 * kPi / 180));
}

TEST_F(Aslant, NotWhereTheArmDoesNotReach) {
  limits.T_base_supply.iso.translation() = Vector3d{800, 0, -300};
  const auto pick = taken();
  ASSERT_TRUE(pick);
  const auto from_base = [&](const auto& T) { return (limits.T_base_supply.iso * T.iso.translation()).norm(); };
  const double highest = std::max(from_base(pick->T_supply_grasp), from_base(pick->T_supply_approach));
  ASSERT_GT(from_base(pick->T_supply_retreat), highest + 1) << "of all, it is the retreat pose that is out of reach";
  limits.radius_max_mm = from_base(pick->T_supply_retreat) + 0.1;
  EXPECT_TRUE(taken());
  limits.radius_max_mm = highest + 0.1;
  const auto nearer = taken();
  EXPECT_TRUE(!nearer || from_base(nearer->T_supply_retreat) <= limits.radius_max_mm) << "another way, or none";
}

TEST_F(Aslant, NotInASupplyThatStandsAslant) {
  const auto slanted_by = [&](double angle_rad) {
    limits.T_base_supply.iso.linear() = Eigen::AngleAxisd{angle_rad, Vector3d::UnitY()}.toRotationMatrix();
    return taken().has_value();
  };
  EXPECT_TRUE(slanted_by(0.01)) << "taught, it never stands quite level";
  EXPECT_TRUE(slanted_by(-0.01));
  EXPECT_FALSE(slanted_by(0.03));
}

class AslantAtAWall : public Aslant {
 protected:
  AslantAtAWall() : Aslant{0.5 * kSupply.size_mm.x() - 32} {}
};
TEST_F(AslantAtAWall, NotThroughIt) { EXPECT_FALSE(taken()); }
}  // namespace binpick::vision
