#include "vision/candidates.hpp"

#include <chrono>
#include <cmath>
#include <functional>
#include <gtest/gtest.h>
#include <numbers>
#include <optional>
#include <vector>

#include "tests/unit/detect/scenes.hpp"

namespace binpick::vision {
namespace {
using scenes::pose;
constexpr double kDegree = std::numbers::pi / 180;

const KnowledgeBase& dial_base() {
  static const KnowledgeBase base = [] {
    PartOptions options;
    options.name = "dial";
    options.scanner = ScannerClass::Lms400;
    options.pixel_mm = scenes::bracket_base().pixel_mm();
    options.rotations = 200;
    return *train(shapes::dial(), options, {}, nullptr);
  }();
  return base;
}

struct Setting {
  std::vector<Eigen::Isometry3d> objects;
  std::optional<std::chrono::steady_clock::time_point> deadline = std::nullopt;
  int threads = 1;
  std::function<bool(const Pose&)> possible = [](const Pose&) { return true; };
};

/// Candidates refined from `starts` among the objects, their turns weighed, or not.
std::vector<Candidate> candidates(const Setting& setting, const std::vector<Eigen::Isometry3d>& starts,
                                  bool weighed = true) {
  const KnowledgeBase& dial = dial_base();
  const Scene scene = prepare_scene(scenes::image_of(dial.mesh(), setting.objects, 7), scenes::kNoiseMm, 1);
  const Deadline deadline{setting.deadline};
  FinishOptions options;
  options.threads = setting.threads;
  Finisher finisher{scene, dial.impl(), deadline, options};
  finisher.begin({});
  Template drawn;
  std::vector<Candidate> all;
  for (const Eigen::Isometry3d& start : starts)
    all.push_back(finisher.finished({start.linear().cast<float>(), start.translation().cast<float>()}, drawn));
  std::vector<Candidate*> those;
  for (Candidate& candidate : all) those.push_back(&candidate);
  if (weighed) finisher.weigh_turns(those, setting.possible);
  for (const Candidate& candidate : all)
    EXPECT_NEAR(finisher.covariance_of(candidate)(5, 5), candidate.loose_turn_rad2(2, 2), std::pow(kDegree, 2));
  return all;
}

Candidate weighed(const std::vector<Eigen::Isometry3d>& objects, const Eigen::Isometry3d& start) {
  return candidates({.objects = objects}, {start}).front();
}

double loose_deg(const Candidate& candidate) { return std::sqrt(candidate.loose_turn_rad2.trace()) / kDegree; }

double off_deg(const Candidate& candidate, const Eigen::Isometry3d& truth) {
  return pose_distance(candidate.pose.iso(), truth, dial_base().symmetry(), 60).angle_rad / kDegree;
}

TEST(Candidates, ATurnThatShowsIsTight) {
  ASSERT_EQ(dial_base().symmetry().kind, Symmetry::Kind::None);
  const Eigen::Isometry3d truth = pose(-150, -100, 0, 1.0);
  const Candidate candidate = weighed({truth}, truth);
  EXPECT_LT(loose_deg(candidate), 2);
  EXPECT_GT(loose_deg(candidate), 0);
  EXPECT_LT(off_deg(candidate, truth), 1);
}

// The other one covers the lower one's ridge but for its foot: where it lies is sure, how it is turned is not.
TEST(Candidates, ATurnThatIsHiddenIsLoose) {
  const Eigen::Isometry3d below = pose(0, 0, 0, 0.4), above = pose(95, 20, 60, 2.0);
  const Candidate candidate = weighed({below, above}, below);
  EXPECT_GT(loose_deg(candidate), 4);
  EXPECT_LT(std::sqrt(candidate.loose_turn_rad2.topLeftCorner<2, 2>().trace()) / kDegree,
            0.5);  // about the vertical only
  EXPECT_LT(loose_deg(weighed({below, above}, above)), 2);
}

// Refinement does not find home where the ridge lies beside its place.
TEST(Candidates, ABetterTurnIsTaken) {
  const Eigen::Isometry3d truth = pose(-150, -100, 0, 1.0);
  for (const double off : {-16, -12, 12, 16}) {
    const Eigen::Isometry3d start = pose(-150, -100, 0, 1.0 + off * kDegree);
    EXPECT_GT(off_deg(candidates({.objects = {truth}}, {start}, false).front(), truth), 3) << off;
    const Candidate candidate = weighed({truth}, start);
    EXPECT_LT(off_deg(candidate, truth), 1.5) << off;
    EXPECT_LT(loose_deg(candidate), 3) << off;
    // Unless the part cannot be there.
    const auto nowhere = [](const Pose&) { return false; };
    EXPECT_GT(off_deg(candidates({.objects = {truth}, .possible = nowhere}, {start}).front(), truth), 3);
  }
}

TEST(Candidates, WhatTheDeadlineLeavesUnweighedMayBeTurnedAnyhow) {
  const Eigen::Isometry3d truth = pose(-150, -100, 0, 1.0);
  const auto over = std::chrono::steady_clock::now() - std::chrono::seconds{1};
  for (const Candidate& candidate : candidates({.objects = {truth}, .deadline = over}, {truth, truth}))
    EXPECT_NEAR(loose_deg(candidate), 180 / std::sqrt(3.0), 1);
}

TEST(Candidates, WeighedAlikeByAnyNumberOfThreads) {
  const std::vector<Eigen::Isometry3d> starts{pose(0, 0, 0, 0.4), pose(95, 20, 60, 2.0), pose(-150, -100, 0, 1.2)};
  Setting setting{.objects = {starts[0], starts[1], pose(-150, -100, 0, 1.0)}};
  const std::vector<Candidate> one = candidates(setting, starts);
  setting.threads = 3;
  const std::vector<Candidate> three = candidates(setting, starts);
  for (std::size_t k = 0; k < starts.size(); ++k) {
    EXPECT_EQ(one[k].pose.R, three[k].pose.R);
    EXPECT_EQ(one[k].loose_turn_rad2, three[k].loose_turn_rad2);
  }
}

// The bracket is not round about any axis: nothing to weigh.
TEST(Candidates, APartThatIsNotRoundIsLeftAsItIs) {
  const KnowledgeBase& bracket = scenes::bracket_base();
  const Eigen::Isometry3d truth = pose(0, 0, 0, 0.3);
  const Scene scene = prepare_scene(scenes::image_of(bracket.mesh(), {truth}, 2), scenes::kNoiseMm, 1);
  const Deadline none;
  Finisher finisher{scene, bracket.impl(), none, {}};
  finisher.begin({});
  Template drawn;
  Candidate candidate = finisher.finished({truth.linear().cast<float>(), truth.translation().cast<float>()}, drawn);
  finisher.weigh_turns({&candidate}, [](const Pose&) { return true; });
  EXPECT_EQ(candidate.loose_turn_rad2, Eigen::Matrix3d::Zero());
}
}  // namespace
}  // namespace binpick::vision
