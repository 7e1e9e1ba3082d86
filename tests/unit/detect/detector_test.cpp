#include "vision/detector.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <gtest/gtest.h>
#include <limits>
#include <numbers>
#include <string>
#include <thread>
#include <vector>

#include "tests/unit/detect/scenes.hpp"
#include "vision/symmetry.hpp"

namespace binpick::vision {
namespace {
using scenes::bracket_base;
using scenes::kSupply;
using scenes::pose;
constexpr double kDegree = std::numbers::pi / 180;
constexpr float kNan = std::numeric_limits<float>::quiet_NaN();

struct Error {
  double mm = 1e9, deg = 1e9;
};
/// Of the detection nearest to the truth.
Error error_of(const DetectionReport& report, const Eigen::Isometry3d& truth) {
  Error least;
  for (const Detection& d : report.detections) {
    const PoseDistance distance = pose_distance(d.T_supply_object.iso, truth, bracket_base().symmetry(), 60);
    if (distance.centroid_mm < least.mm) least = {distance.centroid_mm, distance.angle_rad / kDegree};
  }
  return least;
}

DetectionReport detect_in(const DepthImage& image) { return detect(image, kSupply, bracket_base(), scenes::options()); }

TEST(Detector, OneObjectInManyPoses) {
  const std::vector<Eigen::Isometry3d> poses{pose(40, -30, 0, 0.3), pose(-100, 60, 45, 2.0, -std::numbers::pi / 2),
                                             pose(0, 0, 45, -1.2, std::numbers::pi / 2), pose(120, 80, 60, 0.9, 0.35),
                                             pose(-60, -90, 90, 2.7, std::numbers::pi - 0.3)};
  for (std::size_t k = 0; k < poses.size(); ++k) {
    const DetectionReport report =
        detect_in(scenes::image_of(bracket_base().mesh(), {poses[k]}, static_cast<std::uint32_t>(k)));
    ASSERT_EQ(report.detections.size(), 1U) << "pose " << k;
    const Error error = error_of(report, poses[k]);
    EXPECT_LT(error.mm, 1.5) << "pose " << k;
    EXPECT_LT(error.deg, 1.0) << "pose " << k;
    EXPECT_GT(report.detections[0].score, 0.9) << "pose " << k;
    EXPECT_GT(report.detections[0].visible_fraction, 0.8) << "pose " << k;
    EXPECT_GT(report.maxima, 0U);
    EXPECT_GT(report.hypotheses, 0U);
  }
}

// A view's first anchor is its highest place. Votes point at it; where it was not measured, another one has to serve.
TEST(Detector, VotesFindWhatDoesNotShowItsHighestPlace) {
  constexpr int kPoses = 12, kHidden = 11;
  int found = 0, by_the_first_anchor_alone = 0;
  for (int k = 0; k < kPoses; ++k) {
    const Eigen::Isometry3d truth = pose(-60 + 10 * k, 30, 120, 0.9 * k, 0.25 * k);
    DepthImage image = scenes::image_of(bracket_base().mesh(), {truth}, static_cast<std::uint32_t>(k));
    Eigen::Index row = 0, col = 0;
    image.z_mm.isNaN().select(-1e9F, image.z_mm).maxCoeff(&row, &col);
    image.z_mm.block(row - kHidden, col - kHidden, 2 * kHidden + 1, 2 * kHidden + 1).setConstant(kNan);
    DetectorOptions options = scenes::options();
    options.search = Search::Votes;
    found += error_of(detect(image, kSupply, bracket_base(), options), truth).mm < 3;
    options.without = {"all anchors"};
    by_the_first_anchor_alone += error_of(detect(image, kSupply, bracket_base(), options), truth).mm < 3;
  }
  EXPECT_EQ(found, kPoses);
  EXPECT_LT(by_the_first_anchor_alone, found);
}

TEST(Detector, SeveralObjectsEachOnce) {
  const std::vector<Eigen::Isometry3d> truth{pose(-180, -120, 0, 0.3), pose(-180, 110, 45, 1.0, std::numbers::pi / 2),
                                             pose(30, 0, 0, 2.2), pose(180, 130, 0, -0.7),
                                             pose(170, -120, 30, 0.1, 0.2)};
  const DetectionReport report = detect_in(scenes::image_of(bracket_base().mesh(), truth, 5));
  EXPECT_EQ(report.detections.size(), truth.size());
  for (std::size_t k = 0; k < truth.size(); ++k) {
    EXPECT_LT(error_of(report, truth[k]).mm, 1.5) << "object " << k;
    EXPECT_LT(error_of(report, truth[k]).deg, 1.2) << "object " << k;
  }
  for (std::size_t k = 1; k < report.detections.size(); ++k)
    EXPECT_GE(report.detections[k - 1].score, report.detections[k].score);
}

TEST(Detector, AHalfHiddenObjectIsFoundAndSaysSo) {
  const Eigen::Isometry3d below = pose(0, 0, 0, 0), above = pose(75, 10, 72, 1.5);
  const DetectionReport report = detect_in(scenes::image_of(bracket_base().mesh(), {below, above}, 9));
  EXPECT_LT(error_of(report, above).mm, 1.5);
  ASSERT_LT(error_of(report, below).mm, 3);
  EXPECT_LT(error_of(report, below).deg, 2);
  for (const Detection& d : report.detections) {
    const bool is_below = (d.T_supply_object.iso.translation() - below.translation()).norm() < 20;
    EXPECT_TRUE(!is_below || d.visible_fraction < 0.8) << d.visible_fraction;
  }
}

/// A bracket beside a box of 80 mm that takes half of the supply.
DepthImage beside_a_box(const Eigen::Isometry3d& bracket) {
  DepthImage image = scenes::image_of(bracket_base().mesh(), {bracket}, 4);
  image.z_mm.rightCols(image.z_mm.cols() / 2) += 80;
  return image;
}

TEST(Detector, TellsHowMuchOfTheSupplyIsThePart) {
  const Eigen::Isometry3d truth = pose(-180, 0, 0, 0.3);
  DepthImage image = scenes::image_of(bracket_base().mesh(), {truth}, 4);
  const DetectionReport alone = detect_in(image);
  ASSERT_EQ(alone.detections.size(), 1U);
  EXPECT_GT(alone.detections[0].score, 0.9);
  EXPECT_GT(alone.detections[0].evidence[Clue::Extent], 0.9F);
  EXPECT_GT(alone.detections[0].evidence[Clue::Known], 0.8F);
  image.z_mm.rightCols(image.z_mm.cols() / 2) += 10;  // a sheet of board
  const DetectionReport board = detect_in(image);
  ASSERT_EQ(board.detections.size(), 1U);
  EXPECT_GT(board.detections[0].evidence[Clue::Known], 0.8F);
  const DetectionReport box = detect_in(beside_a_box(truth));
  std::string reason;
  for (const Rejection& r : box.rejected)
    if ((r.T_supply_object.iso.translation() - truth.translation()).norm() < 5 && reason.empty()) reason = r.reason;
  ASSERT_LT(error_of(box, truth).mm < 5 ? box.detections[0].score : 0.0, alone.detections[0].score - 0.1);
  if (box.detections.empty()) {
    EXPECT_NE(reason.find("most of the supply is something else"), std::string::npos) << reason;
  }
}

TEST(Detector, AsksForTheRestOfTheSupplyOnlyWhereItIsKnownAndLookedAt) {
  const Eigen::Isometry3d truth = pose(-180, 0, 0, 0.3);
  const DepthImage image = beside_a_box(truth);
  const double asked = error_of(detect_in(image), truth).mm < 5 ? detect_in(image).detections[0].score : 0;
  DetectorOptions without = scenes::options();
  without.without = {"known"};
  const DetectionReport not_asked = detect(image, kSupply, bracket_base(), without);
  ASSERT_LT(error_of(not_asked, truth).mm, 5);
  EXPECT_GT(not_asked.detections[0].score, asked + 0.1);
  DetectorOptions late = scenes::options();
  late.deadline = std::chrono::seconds{2};
  const auto end = std::chrono::steady_clock::now() + *late.deadline;
  late.observer = [&](const StageSurvivors& alive) {
    while (alive.stage == "rendered test" && std::chrono::steady_clock::now() <= end) std::this_thread::yield();
  };
  const DetectionReport cut_off = detect(image, kSupply, bracket_base(), late);
  ASSERT_LT(error_of(cut_off, truth).mm, 5);
  EXPECT_TRUE(cut_off.cut_short);
  EXPECT_FALSE(not_asked.cut_short);
  EXPECT_GT(cut_off.detections[0].score, asked + 0.1) << "others may have been left out";
  const DetectionReport no_walls = detect(image, {}, bracket_base(), scenes::options());
  ASSERT_LT(error_of(no_walls, truth).mm, 5);
  EXPECT_GT(no_walls.detections[0].score, asked + 0.1);
}

// From below the bracket shows a plain rectangle: half a turn about the vertical cannot be told.
TEST(Detector, WhatTwoPosesExplainAlikeIsNotBelieved) {
  const DetectionReport report =
      detect_in(scenes::image_of(bracket_base().mesh(), {pose(0, 0, 70, 2.0, std::numbers::pi)}, 1));
  ASSERT_EQ(report.detections.size(), 1U);
  EXPECT_LT(report.detections[0].score, 0.85);
}

TEST(Detector, TheCovarianceHoldsTheError) {
  const Eigen::Isometry3d truth = pose(10, 20, 0, 0.5);
  int outside = 0;
  for (std::uint32_t seed = 0; seed < 8; ++seed) {
    const DetectionReport report = detect_in(scenes::image_of(bracket_base().mesh(), {truth}, seed));
    ASSERT_FALSE(report.detections.empty());
    const Matrix6& covariance = report.detections[0].covariance;
    EXPECT_TRUE(covariance.isApprox(covariance.transpose()));
    EXPECT_GT(covariance.diagonal().minCoeff(), 0);
    const Eigen::Vector3d centroid = bracket_base().mesh().centroid_mm();
    const Eigen::Vector3d off = report.detections[0].T_supply_object.iso * centroid - truth * centroid;
    for (int axis = 0; axis < 3; ++axis) outside += std::abs(off[axis]) > 4 * std::sqrt(covariance(axis, axis)) + 0.3;
  }
  EXPECT_LE(outside, 2);
}

TEST(Detector, AnEmptyFloorAndWallsAreNoDetection) {
  DepthImage floor = scenes::image_of(bracket_base().mesh(), {}, 3);
  EXPECT_TRUE(detect_in(floor).detections.empty());
  EXPECT_TRUE(detect(floor, {}, bracket_base(), scenes::options()).detections.empty());
  // Walls: 300 mm high, three pixels inside the picture.
  floor.z_mm.leftCols(3) = floor.z_mm.rightCols(3) = 300;
  floor.z_mm.topRows(3) = floor.z_mm.bottomRows(3) = 300;
  EXPECT_TRUE(detect_in(floor).detections.empty());
  EXPECT_TRUE(detect(floor, {}, bracket_base(), scenes::options()).detections.empty());
}

TEST(Detector, WithoutASupplySizeItWorksAsWell) {
  const Eigen::Isometry3d truth = pose(40, -30, 0, 0.3);
  const DetectionReport report =
      detect(scenes::image_of(bracket_base().mesh(), {truth}, 4), {}, bracket_base(), scenes::options());
  ASSERT_EQ(report.detections.size(), 1U);
  EXPECT_LT(error_of(report, truth).mm, 1.5);
}

TEST(Detector, AnotherPartIsNotTakenForThisOne) {
  const Mesh other = shapes::scaled(shapes::bracket(), 0.6F);
  const DetectionReport report = detect_in(scenes::image_of(other, {pose(0, 0, 0, 0.4), pose(120, 90, 0, 1.4)}, 6));
  for (const Detection& d : report.detections) EXPECT_LT(d.score, 0.5);
}

TEST(Detector, GarbageIsNoDetectionAndNoCrash) {
  const DepthImage good = scenes::image_of(bracket_base().mesh(), {pose(0, 0, 0, 0)}, 2);
  for (const float value : {kNan, 1e30F, -1e30F, std::numeric_limits<float>::infinity(), 0.0F}) {
    DepthImage bad = good;
    bad.z_mm.setConstant(value);
    EXPECT_TRUE(detect_in(bad).detections.empty()) << value;
  }
  std::mt19937 random{3};
  DepthImage wild = good;
  for (float& z : wild.z_mm.reshaped()) z = static_cast<float>(random() % 1000);
  for (const Detection& d : detect_in(wild).detections) EXPECT_LT(d.score, 0.5);
  DepthImage none;
  EXPECT_TRUE(detect_in(none).detections.empty());
  DepthImage one;
  one.z_mm.setConstant(1, 1, 5);
  EXPECT_TRUE(detect_in(one).detections.empty());
}

TEST(Detector, TheResultDoesNotDependOnTheThreads) {
  const DepthImage image =
      scenes::image_of(bracket_base().mesh(),
                       {pose(-150, -60, 0, 0.3), pose(60, 50, 70, 1.0, std::numbers::pi), pose(90, 20, 70, 2)}, 7);
  DetectorOptions options = scenes::options();
  options.threads = 1;
  const DetectionReport expected = detect(image, kSupply, bracket_base(), options);
  ASSERT_FALSE(expected.detections.empty());
  for (const int threads : {2, 3, 5, 2}) {
    options.threads = threads;
    const DetectionReport report = detect(image, kSupply, bracket_base(), options);
    ASSERT_EQ(report.detections.size(), expected.detections.size());
    ASSERT_EQ(report.rejected.size(), expected.rejected.size());
    for (std::size_t k = 0; k < report.detections.size(); ++k) {
      EXPECT_EQ(report.detections[k].T_supply_object.iso.matrix(), expected.detections[k].T_supply_object.iso.matrix());
      EXPECT_EQ(report.detections[k].score, expected.detections[k].score);
    }
  }
}

TEST(Detector, AnObserverSeesTheTruePoseThroughEveryStage) {
  const Eigen::Isometry3d truth = pose(40, -30, 0, 0.3);
  const DepthImage image = scenes::image_of(bracket_base().mesh(), {truth}, 3);
  std::vector<std::string> stages;
  DetectorOptions options = scenes::options();
  options.observer = [&](const StageSurvivors& alive) {
    stages.emplace_back(alive.stage);
    if (alive.stage == "maxima") {
      EXPECT_FALSE(alive.maxima_mm.empty());
      return;
    }
    double least = 1e9;
    for (const auto& T : alive.poses) {
      const PoseDistance d = pose_distance(T.iso, truth, bracket_base().symmetry(), 60);
      least = std::min(least, d.centroid_mm + 60 * d.angle_rad);
    }
    EXPECT_LT(least, 0.15 * bracket_base().diameter_mm()) << alive.stage;
  };
  const DetectionReport report = detect(image, kSupply, bracket_base(), options);
  for (const auto& [stage, ms] : report.stages_ms)
    EXPECT_TRUE(stage == "surface" || std::ranges::find(stages, stage) != stages.end()) << stage;
  ASSERT_TRUE(report.first);
  EXPECT_GT(report.first->hypotheses, 0U);
  EXPECT_LE(report.first->time_ms, report.time_ms);
  EXPECT_LT((report.first->T_supply_object.iso.translation() - truth.translation()).norm(), 5);
  EXPECT_EQ(report.detections.size(), detect_in(image).detections.size());
}

TEST(Detector, AnyAdditionMayBeLeftOut) {
  const Eigen::Isometry3d truth = pose(40, -30, 0, 0.3);
  const DepthImage image = scenes::image_of(bracket_base().mesh(), {truth}, 6);
  for (const std::string_view addition : detector_additions()) {
    DetectorOptions options = scenes::options();
    options.without = {std::string{addition}};
    const DetectionReport report = detect(image, kSupply, bracket_base(), options);
    EXPECT_GT(report.hypotheses, 0U) << "without " << addition;
    if (addition == "edges") continue;  // nothing holds the bracket in the plane then
    EXPECT_LT(error_of(report, truth).mm, 3) << "without " << addition;
  }
}

TEST(Detector, ADeadlineInThePastStillReturns) {
  DetectorOptions options = scenes::options();
  options.deadline = std::chrono::milliseconds{0};
  const DetectionReport report =
      detect(scenes::image_of(bracket_base().mesh(), {pose(0, 0, 0, 0)}, 2), kSupply, bracket_base(), options);
  EXPECT_TRUE(report.detections.empty());
  EXPECT_TRUE(report.cut_short);
}

TEST(Detector, MaxLimitsTheList) {
  DetectorOptions options = scenes::options();
  options.detections_max = 1;
  const DetectionReport report =
      detect(scenes::image_of(bracket_base().mesh(), {pose(-150, 0, 0, 0), pose(150, 0, 0, 1)}, 2), kSupply,
             bracket_base(), options);
  EXPECT_EQ(report.detections.size(), 1U);
}
}  // namespace
}  // namespace binpick::vision
