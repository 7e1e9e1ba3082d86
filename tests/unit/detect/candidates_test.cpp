#include "vision/candidates.hpp"

#include <cmath>
#include <gtest/gtest.h>
#include <numbers>

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

/// The candidate refined from `start` among `objects`, its turns weighed.
Candidate weighed(const std::vector<Eigen::Isometry3d>& objects, const Eigen::Isometry3d& start, int threads = 1) {
  const KnowledgeBase& dial = dial_base();
  const Scene scene = prepare_scene(scenes::image_of(dial.mesh(), objects, 7), scenes::kNoiseMm, 1);
  const Deadline none;
  FinishOptions options;
  options.threads = threads;
  Finisher finisher{scene, dial.impl(), none, options};
  finisher.begin();
  Template drawn;
  Candidate candidate = finisher.finished({start.linear().cast<float>(), start.translation().cast<float>()}, drawn);
  finisher.weigh_turns({&candidate});
  const Matrix6 covariance = finisher.covariance_of(candidate);
  EXPECT_NEAR(covariance(5, 5), candidate.loose_turn_rad.z() * candidate.loose_turn_rad.z(), std::pow(kDegree, 2));
  return candidate;
}

double off_deg(const Candidate& candidate, const Eigen::Isometry3d& truth) {
  return pose_distance(candidate.pose.iso(), truth, dial_base().symmetry(), 60).angle_rad / kDegree;
}

TEST(Candidates, ATurnThatShowsIsTight) {
  ASSERT_EQ(dial_base().symmetry().kind, Symmetry::Kind::None);
  const Eigen::Isometry3d truth = pose(-150, -100, 0, 1.0);
  const Candidate candidate = weighed({truth}, truth);
  EXPECT_LT(candidate.loose_turn_rad.norm() / kDegree, 2);
  EXPECT_LT(off_deg(candidate, truth), 1);
}

// The other one covers the lower one's ridge but for its foot: where it lies is sure, how it is turned is not.
TEST(Candidates, ATurnThatIsHiddenIsLoose) {
  const Eigen::Isometry3d below = pose(0, 0, 0, 0.4), above = pose(95, 20, 60, 2.0);
  const Candidate candidate = weighed({below, above}, below);
  EXPECT_GT(candidate.loose_turn_rad.norm() / kDegree, 4);
  EXPECT_LT(candidate.loose_turn_rad.head<2>().norm() / kDegree, 0.5);  // about the vertical only
  EXPECT_LT(weighed({below, above}, above).loose_turn_rad.norm() / kDegree, 2);
}

// Refinement does not find home where the ridge lies beside its place.
TEST(Candidates, ABetterTurnIsTaken) {
  const Eigen::Isometry3d truth = pose(-150, -100, 0, 1.0);
  for (const double off : {-14, -8, 5, 16}) {
    const Candidate candidate = weighed({truth}, pose(-150, -100, 0, 1.0 + off * kDegree));
    EXPECT_LT(off_deg(candidate, truth), 1.5) << off;
    EXPECT_LT(candidate.loose_turn_rad.norm() / kDegree, 3) << off;
  }
}

// The bracket is not round about any axis: nothing to weigh.
TEST(Candidates, APartThatIsNotRoundIsLeftAsItIs) {
  const KnowledgeBase& bracket = scenes::bracket_base();
  const Eigen::Isometry3d truth = pose(0, 0, 0, 0.3);
  const Scene scene = prepare_scene(scenes::image_of(bracket.mesh(), {truth}, 2), scenes::kNoiseMm, 1);
  const Deadline none;
  Finisher finisher{scene, bracket.impl(), none, {}};
  finisher.begin();
  Template drawn;
  Candidate candidate = finisher.finished({truth.linear().cast<float>(), truth.translation().cast<float>()}, drawn);
  finisher.weigh_turns({&candidate});
  EXPECT_EQ(candidate.loose_turn_rad, Eigen::Vector3d::Zero());
}
}  // namespace
}  // namespace binpick::vision
