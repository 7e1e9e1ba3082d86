#include "vision/grasp.hpp"

#include <cmath>
#include <gtest/gtest.h>
#include <numbers>

namespace binpick::vision {
namespace {
constexpr double kPi = std::numbers::pi;

/// From straight above onto the object's +z face.
Grasp from_above() {
  Grasp grasp;
  grasp.name = "top";
  grasp.T_object_tcp.iso.linear() = Eigen::AngleAxisd(kPi, Eigen::Vector3d::UnitX()).matrix();
  grasp.T_object_tcp.iso.translation() = Eigen::Vector3d(0, 0, 25);
  grasp.approach_mm = 100;
  return grasp;
}

Detection lying_at(double x, double y, double z, double score, double tilt_rad = 0) {
  Detection detection;
  detection.T_supply_object.iso.translation() = Eigen::Vector3d(x, y, z);
  detection.T_supply_object.iso.linear() = Eigen::AngleAxisd(tilt_rad, Eigen::Vector3d::UnitX()).matrix();
  detection.score = score;
  return detection;
}

const SupplyBox kSupply{{1000, 800, 500}};

TEST(Grasp, ApproachStandsBackAlongTcpZ) {
  DetectionReport report;
  report.detections = {lying_at(10, 20, 30, 0.9)};
  const GraspChoice choice = choose_grasps(report, {}, {from_above()}, kSupply, {});
  ASSERT_EQ(choice.reachable.size(), 1U);
  EXPECT_TRUE(choice.reachable[0].T_supply_grasp.iso.translation().isApprox(Eigen::Vector3d(10, 20, 55)));
  EXPECT_TRUE(choice.reachable[0].T_supply_approach.iso.translation().isApprox(Eigen::Vector3d(10, 20, 155)));
  EXPECT_TRUE(choice.unreachable.empty());
}

TEST(Grasp, TiltOverTheLimitIsNamed) {
  DetectionReport report;
  report.detections = {lying_at(0, 0, 30, 0.9, 51 * kPi / 180)};
  ReachLimits limits;
  limits.tilt_max_rad = 40 * kPi / 180;
  const GraspChoice choice = choose_grasps(report, {}, {from_above()}, kSupply, limits);
  ASSERT_EQ(choice.unreachable.size(), 1U);
  EXPECT_EQ(choice.unreachable[0].reason, "tilt 51 deg is over 40 deg");
  limits.tilt_max_rad = 52 * kPi / 180;
  EXPECT_EQ(choose_grasps(report, {}, {from_above()}, kSupply, limits).reachable.size(), 1U);
}

TEST(Grasp, TcpOutsideTheWallIsNamed) {
  DetectionReport report;
  report.detections = {lying_at(512, 0, 30, 0.9), lying_at(0, -395, 30, 0.8)};
  GraspChoice choice = choose_grasps(report, {}, {from_above()}, kSupply, {});
  ASSERT_EQ(choice.unreachable.size(), 1U);
  EXPECT_EQ(choice.unreachable[0].reason, "tcp 12 mm outside the wall x max");
  ReachLimits limits;
  limits.wall_clearance_mm = 20;
  choice = choose_grasps(report, {}, {from_above()}, kSupply, limits);
  ASSERT_EQ(choice.unreachable.size(), 2U);
  EXPECT_EQ(choice.unreachable[1].reason, "tcp 15 mm too near to or outside the wall y min (clearance 20 mm)");
}

TEST(Grasp, UnknownSupplyHasNoWalls) {
  DetectionReport report;
  report.detections = {lying_at(5000, 0, 30, 0.9)};
  EXPECT_EQ(choose_grasps(report, {}, {from_above()}, {}, {}).reachable.size(), 1U);
}

// A shaft lying on its side, its one grasp now pointing sideways: some turn about its axis brings it back on top.
TEST(Grasp, ARevolutionIsTurnedUntilTheGraspIsOnTop) {
  Symmetry symmetry;
  symmetry.kind = Symmetry::Kind::Revolution;
  symmetry.axis = Eigen::Vector3d::UnitX();
  symmetry.centre_mm = Eigen::Vector3d(40, 0, 0);
  DetectionReport report;
  report.detections = {lying_at(0, 0, 30, 0.9, 90 * kPi / 180)};
  const GraspChoice choice = choose_grasps(report, symmetry, {from_above()}, kSupply, {});
  ASSERT_EQ(choice.reachable.size(), 1U);
  EXPECT_NEAR(choice.reachable[0].T_supply_grasp.iso.linear()(2, 2), -1, 1e-9);
  EXPECT_NEAR(choice.reachable[0].T_supply_grasp.iso.translation().z(), 55, 1e-9);
}

TEST(Grasp, AFiniteSymmetryTurnsAboutItsCentre) {
  Symmetry symmetry;
  symmetry.kind = Symmetry::Kind::Finite;
  symmetry.centre_mm = Eigen::Vector3d(0, 0, 10);
  symmetry.rotations.push_back(Eigen::AngleAxisd(kPi, Eigen::Vector3d::UnitX()).matrix());
  DetectionReport report;
  report.detections = {lying_at(0, 0, 30, 0.9, kPi)};  // upside down
  const GraspChoice choice = choose_grasps(report, symmetry, {from_above()}, kSupply, {});
  ASSERT_EQ(choice.reachable.size(), 1U);
  // The face at object z = 25 stands for the one at z = -5, which is now on top at 30 + 5.
  EXPECT_NEAR(choice.reachable[0].T_supply_grasp.iso.translation().z(), 35, 1e-9);
}

TEST(Grasp, TheSurestToHoldThenTheHighest) {
  DetectionReport report;
  report.detections = {lying_at(0, 0, 30, 0.962), lying_at(0, 200, 90, 0.955), lying_at(200, 0, 300, 0.7)};
  const GraspChoice choice = choose_grasps(report, {}, {from_above()}, kSupply, {});
  ASSERT_EQ(choice.reachable.size(), 3U);
  EXPECT_EQ(choice.reachable[0].detection, 1U);
  EXPECT_EQ(choice.reachable[1].detection, 0U);
  EXPECT_EQ(choice.reachable[2].detection, 2U);
}

// A wheel on top of all, sure to be there, but nobody saw its spokes.
TEST(Grasp, APoseThatIsNotKnownWellEnoughWaits) {
  DetectionReport report;
  report.detections = {lying_at(0, 0, 300, 0.99), lying_at(0, 200, 90, 0.9)};
  Symmetry symmetry;
  EXPECT_NEAR(probability_of_holding(report.detections[0], symmetry), 0.99, 1e-3);
  const double sd_rad = 10 * kPi / 180;
  report.detections[0].covariance(5, 5) = sd_rad * sd_rad;
  EXPECT_NEAR(probability_of_holding(report.detections[0], symmetry), 0.99 * std::erf(0.3 / std::sqrt(2)), 1e-3);
  EXPECT_EQ(choose_grasps(report, symmetry, {from_above()}, kSupply, {}).reachable[0].detection, 1U);
  // Nothing can be wrong about how a round part is turned.
  symmetry.kind = Symmetry::Kind::Revolution;
  symmetry.axis = Eigen::Vector3d::UnitZ();
  EXPECT_NEAR(probability_of_holding(report.detections[0], symmetry), 0.99, 1e-3);
  EXPECT_EQ(choose_grasps(report, symmetry, {from_above()}, kSupply, {}).reachable[0].detection, 0U);
  symmetry.axis = Eigen::Vector3d::UnitX();
  EXPECT_LT(probability_of_holding(report.detections[0], symmetry), 0.3);
  report.detections[1].covariance.topLeftCorner<3, 3>() = 9 * Eigen::Matrix3d::Identity();
  EXPECT_NEAR(probability_of_holding(report.detections[1], symmetry), 0.9 * 0.683, 1e-3);
}

TEST(Grasp, NoGraspIsAReason) {
  DetectionReport report;
  report.detections = {lying_at(0, 0, 30, 0.9)};
  const GraspChoice choice = choose_grasps(report, {}, {}, kSupply, {});
  ASSERT_EQ(choice.unreachable.size(), 1U);
  EXPECT_NE(choice.unreachable[0].reason.find("no grasp"), std::string::npos);
}
}  // namespace
}  // namespace binpick::vision
