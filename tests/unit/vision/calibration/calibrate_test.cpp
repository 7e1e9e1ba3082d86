#include "vision/calibration/calibrate.hpp"

#include <algorithm>
#include <cstdio>
#include <gtest/gtest.h>

#include "tests/support/sphere_scans.hpp"

/// What calibration says of its own error, against what the emulator knows; bench/calibration has more seeds.
namespace binpick::vision::calibration {
namespace {
using support::SphereCarrier;
using support::SphereScanner;
using support::SphereScans;

struct Calibrated : testing::TestWithParam<std::tuple<SphereScanner, SphereCarrier>> {
  SphereScans wanted{.scanner = std::get<0>(GetParam()), .carrier = std::get<1>(GetParam())};
  double must_mm = wanted.scanner == SphereScanner::Lms400 ? 2 : 0.5;

  std::string refusal() const {
    const auto answer = calibrate(support::scan_spheres(wanted).question);
    return answer ? "not refused" : answer.error();
  }
};
}  // namespace

TEST_P(Calibrated, WithoutNoiseTheMountIsTheTrueOne) {
  wanted.quiet = true;
  wanted.scans = 8;
  const auto emulated = support::scan_spheres(wanted);
  const auto answer = calibrate(emulated.question);
  ASSERT_TRUE(answer.has_value()) << answer.error();
  EXPECT_LT(support::true_error_mm(emulated, *answer), 0.02 * must_mm);
  EXPECT_LT(answer->hold_out_95_mm, 0.05 * must_mm);
}

TEST_P(Calibrated, TheHoldOutErrorIsSmallAndTellsTheTruth) {
  double told = 0, truth = 0;
  constexpr int kSeeds = 2;
  for (int seed = 1; seed <= kSeeds; ++seed) {
    wanted.seed = static_cast<std::uint64_t>(seed) + 100;
    const auto emulated = support::scan_spheres(wanted);
    const auto answer = calibrate(emulated.question);
    ASSERT_TRUE(answer.has_value()) << answer.error();
    const double error = support::true_error_mm(emulated, *answer);
    std::printf("seed %d: true %.3f mm, hold-out %.3f ± %.3f mm, below %.3f mm; left out %.3f mm\n", seed, error,
                answer->hold_out_mm, answer->hold_out_se_mm, answer->hold_out_95_mm, answer->left_out_mm);
    EXPECT_LT(answer->hold_out_mm, must_mm);
    EXPECT_LT(error, 1.3 * answer->hold_out_95_mm);
    EXPECT_LT(answer->turn_95_rad, 0.01);
    EXPECT_EQ(answer->poses.size(), emulated.question.scans.size());
    told += answer->hold_out_mm / kSeeds;
    truth += error / kSeeds;
  }
  // The errors of single calibrations scatter by a third.
  EXPECT_GT(told / truth, 0.5);
  EXPECT_LT(told / truth, 2);
}

TEST_P(Calibrated, PosesThatDoNotTellAreRefusedAndTheMissingKindIsNamed) {
  wanted.scans = 8;
  wanted.turned = false;
  const std::string not_turned = refusal();
  EXPECT_NE(not_turned.find("do not determine the mount"), std::string::npos) << not_turned;
  EXPECT_NE(not_turned.find("with it turned by 30 deg about two axes"), std::string::npos) << not_turned;
  EXPECT_EQ(not_turned.find("the sphere's distance"), std::string::npos) << not_turned;
  wanted.turned = true;
  wanted.spread_out = false;
  const std::string in_one_place = refusal();
  EXPECT_NE(in_one_place.find("do not determine the mount"), std::string::npos) << in_one_place;
  EXPECT_NE(in_one_place.find("add scans with it near both ends of the line"), std::string::npos) << in_one_place;
  EXPECT_EQ(in_one_place.find("turned by"), std::string::npos) << in_one_place;
}

INSTANTIATE_TEST_SUITE_P(Scanners, Calibrated,
                         testing::Combine(testing::Values(SphereScanner::Lms400, SphereScanner::Lps36),
                                          testing::Values(SphereCarrier::Pivot, SphereCarrier::Robot)),
                         [](const auto& one) {
                           return std::string{std::get<0>(one.param) == SphereScanner::Lms400 ? "lms400" : "lps36"} +
                                  (std::get<1>(one.param) == SphereCarrier::Pivot ? "_pivot" : "_robot");
                         });

TEST(Calibration, AMountSixtyMillimetresAndSixDegreesOffIsFound) {
  const auto emulated = support::scan_spheres({.scanner = SphereScanner::Lps36,
                                               .carrier = SphereCarrier::Robot,
                                               .seed = 5,
                                               .mount_shift_mm = 35,
                                               .mount_turn_deg = 3.5});
  const auto answer = calibrate(emulated.question);
  ASSERT_TRUE(answer.has_value()) << answer.error();
  EXPECT_LT(support::true_error_mm(emulated, *answer), 0.5);
}

TEST(Calibration, ASphereOfAnotherDiameterIsNamed) {
  auto emulated = support::scan_spheres({.scanner = SphereScanner::Lms400});
  const double true_radius = emulated.question.sphere_radius_mm;
  emulated.question.sphere_radius_mm = 1.06 * true_radius;
  const auto answer = calibrate(emulated.question);
  ASSERT_FALSE(answer.has_value());
  double told = 0;
  ASSERT_EQ(std::sscanf(answer.error().c_str(), "the sphere in the scans has a diameter of %lf mm", &told), 1)
      << answer.error();
  EXPECT_NEAR(told, 2 * true_radius, 0.02 * true_radius);
}

TEST(Calibration, TooFewScansAreRefused) {
  Question question;
  question.scans.resize(5);
  const auto answer = calibrate(question);
  ASSERT_FALSE(answer.has_value());
  EXPECT_EQ(answer.error(), "5 scans are too few: 6 at least, twelve are good");
}

TEST(Calibration, AWrongPoseShowsInItsRow) {
  auto emulated = support::scan_spheres({.scanner = SphereScanner::Lms400});
  // The robot's display was read wrongly.
  auto& scan = emulated.question.scans[4];
  scan.T_base_holder.translation().x() += 30;
  const auto answer = calibrate(emulated.question);
  ASSERT_TRUE(answer.has_value()) << answer.error();
  const auto worst = std::ranges::max_element(answer->poses, {}, &Pose::error_mm);
  EXPECT_EQ(worst->name, scan.name);
  EXPECT_GT(answer->hold_out_mm, 2);
}

TEST(Calibration, WherePlacesAreKnownTheFlangeNeedNotTurn) {
  auto emulated = support::scan_spheres(
      {.scanner = SphereScanner::Lps36, .carrier = SphereCarrier::Pivot, .seed = 3, .turned = false});
  auto& question = emulated.question;
  const Eigen::Vector3d on_flange{8, -5, 5 * question.sphere_radius_mm + 20};
  for (SphereScan& scan : question.scans)
    scan.T_base_holder = Eigen::Isometry3d{Eigen::Translation3d{scan.T_base_holder * on_flange}};
  question.present.sphere_known = true;
  const auto answer = calibrate(question);
  ASSERT_TRUE(answer.has_value()) << answer.error();
  EXPECT_LT(support::true_error_mm(emulated, *answer), 0.5);
  EXPECT_EQ(answer->p_holder_sphere_mm, Eigen::Vector3d::Zero());
}
}  // namespace binpick::vision::calibration
