#include "drivers/sweep/angle_track.hpp"

#include <gtest/gtest.h>

namespace binpick::drivers::sweep {
namespace {
using std::chrono::milliseconds;
TimePoint at_ms(int ms) { return TimePoint{milliseconds(ms)}; }
}  // namespace

TEST(AngleTrack, InterpolatesBetweenSamplesAndNowhereElse) {
  AngleTrack track;
  EXPECT_FALSE(track.at(at_ms(5)).has_value());
  track.add(at_ms(10), Angle::deg(1));
  track.add(at_ms(20), Angle::deg(2));
  EXPECT_FALSE(track.at(at_ms(9)).has_value()) << "nothing is known before the first sample";
  EXPECT_FALSE(track.at(at_ms(21)).has_value()) << "nor after the last";
  EXPECT_NEAR(track.at(at_ms(10))->in_deg(), 1.0, 1e-12);
  EXPECT_NEAR(track.at(at_ms(13))->in_deg(), 1.3, 1e-12);
  EXPECT_NEAR(track.at(at_ms(20))->in_deg(), 2.0, 1e-12);
}

TEST(AngleTrack, AGapInTheSamplesIsNotBridged) {
  AngleTrack track;
  track.add(at_ms(0), Angle::deg(0));
  track.add(at_ms(300), Angle::deg(3));
  EXPECT_FALSE(track.at(at_ms(150)).has_value());
}

TEST(AngleTrack, TimeThatGoesBackIsIgnored) {
  AngleTrack track;
  track.add(at_ms(10), Angle::deg(1));
  track.add(at_ms(5), Angle::deg(9));
  track.add(at_ms(10), Angle::deg(9));
  track.add(at_ms(20), Angle::deg(2));
  EXPECT_NEAR(track.at(at_ms(15))->in_deg(), 1.5, 1e-12);
}

TEST(AngleTrack, IsBounded) {
  AngleTrack track;
  for (int i = 0; i < 20'000; ++i) track.add(at_ms(10 * i), Angle::deg(i));
  EXPECT_GT(*track.oldest(), at_ms(0));
  EXPECT_NEAR(track.at(*track.newest())->in_deg(), 19'999, 1e-6);
}
}  // namespace binpick::drivers::sweep
