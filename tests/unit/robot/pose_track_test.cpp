#include "drivers/robot/pose_track.hpp"

#include <gtest/gtest.h>

#include "base/rotation.hpp"

namespace binpick::drivers::robot {
namespace {
using namespace std::chrono_literals;
constexpr TimePoint kStart = TimePoint{} + 1h;

PoseSample sample(Duration at, const Eigen::Vector3d& p_mm, const Eigen::Vector3d& turn_rad) {
  PoseSample s{kStart + at, {}};
  s.T_base_flange.iso.translation() = p_mm;
  s.T_base_flange.iso.linear() = from_rotation_vector(turn_rad);
  return s;
}
}  // namespace

TEST(PoseTrack, InterpolatesBetweenSamplesAndNowhereElse) {
  PoseTrack track;
  EXPECT_FALSE(track.at(kStart).has_value());
  EXPECT_FALSE(track.newest().has_value());
  track.add(sample(10ms, {100, 0, 0}, {0, 0, 0.1}));
  track.add(sample(18ms, {108, 4, -8}, {0, 0, 0.5}));
  EXPECT_FALSE(track.at(kStart + 9ms).has_value());
  EXPECT_FALSE(track.at(kStart + 19ms).has_value());
  EXPECT_EQ(*track.newest(), kStart + 18ms);
  const auto pose = track.at(kStart + 12ms);
  ASSERT_TRUE(pose.has_value());
  EXPECT_TRUE(pose->iso.translation().isApprox(Eigen::Vector3d(102, 1, -2), 1e-12));
  EXPECT_TRUE(pose->iso.linear().isApprox(from_rotation_vector({0, 0, 0.2}), 1e-12));
  EXPECT_TRUE(track.at(kStart + 18ms)->iso.linear().isApprox(from_rotation_vector({0, 0, 0.5}), 1e-12));
}

TEST(PoseTrack, TurnsTheShortWayRoundAndStaysARotation) {
  PoseTrack track;
  track.add(sample(0ms, {0, 0, 0}, {0, 0, 3.0}));
  track.add(sample(10ms, {0, 0, 0}, {0, 0, -3.0}));  // over half a turn: 0.28 rad further, not 6 rad back
  const auto pose = track.at(kStart + 5ms);
  ASSERT_TRUE(pose.has_value());
  EXPECT_TRUE(pose->iso.linear().isApprox(from_rotation_vector({0, 0, 3.14159265358979}), 1e-9));
  for (int i = 1; i < 10; ++i) {
    const Eigen::Matrix3d R = track.at(kStart + i * 1ms)->iso.linear();
    EXPECT_TRUE((R * R.transpose()).isIdentity(1e-12));
  }
}

TEST(PoseTrack, AGapIsNotBridged) {
  PoseTrack track;
  track.add(sample(0ms, {0, 0, 0}, {0, 0, 0}));
  track.add(sample(100ms, {1, 0, 0}, {0, 0, 0}));
  track.add(sample(201ms, {2, 0, 0}, {0, 0, 0}));
  EXPECT_TRUE(track.at(kStart + 50ms).has_value());
  EXPECT_FALSE(track.at(kStart + 150ms).has_value());
  EXPECT_TRUE(track.at(kStart + 201ms).has_value());
}

TEST(PoseTrack, TimeThatGoesBackIsIgnoredAndTheOldestGo) {
  PoseTrack track;
  track.add(sample(10ms, {1, 0, 0}, {0, 0, 0}));
  track.add(sample(9ms, {9, 9, 9}, {0, 0, 0}));
  track.add(sample(12ms, {3, 0, 0}, {0, 0, 0}));
  EXPECT_NEAR(track.at(kStart + 11ms)->iso.translation().x(), 2, 1e-12);
  for (int i = 0; i < 40'000; ++i) track.add(sample(20ms + i * 2ms, {1.0 * i, 0, 0}, {0, 0, 0}));
  EXPECT_GT(*track.oldest(), kStart + 50s);
  track.clear();
  EXPECT_FALSE(track.newest().has_value());
}
}  // namespace binpick::drivers::robot
