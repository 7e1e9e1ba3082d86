#include "drivers/pivot/ramp.hpp"

#include <cmath>
#include <gtest/gtest.h>
#include <random>

#include "drivers/pivot/setpoints.hpp"

namespace binpick::drivers::pivot {
namespace {
using namespace std::chrono_literals;

TEST(Ramp, RunsUpSteadyAndDown) {
  const Ramp ramp = Ramp::plan(1.0, 0.0, 3.0, 0.5, 1.0);
  EXPECT_NEAR(ramp.duration_s(), 4.5, 1e-9);  // 0.5 s up, 3.5 s steady, 0.5 s down
  EXPECT_NEAR(ramp.position(0.5), 1.125, 1e-9);
  EXPECT_NEAR(ramp.speed(2.0), 0.5, 1e-12);
  EXPECT_NEAR(ramp.position(4.0), 2.875, 1e-9);
  EXPECT_EQ(ramp.position(-1), 1.0);
  EXPECT_EQ(ramp.position(9), 3.0);
}

TEST(Ramp, TooShortForTheSpeedIsATriangle) {
  const Ramp ramp = Ramp::plan(0, 0, -0.01, 5, 1);
  EXPECT_NEAR(ramp.duration_s(), 0.2, 1e-9);
  EXPECT_NEAR(ramp.speed(0.1), -0.1, 1e-9);
}

TEST(Ramp, KeepsItsLimitsFromAnyStart) {
  std::mt19937 random{3};
  std::uniform_real_distribution<double> place{-2, 2}, speed{0.05, 3}, acceleration{0.2, 10};
  for (int round = 0; round < 2000; ++round) {
    const double from = place(random), v0 = place(random), target = place(random), v = speed(random),
                 a = acceleration(random);
    const Ramp ramp = Ramp::plan(from, v0, target, v, a);
    const double end = ramp.duration_s();
    EXPECT_NEAR(ramp.position(end - 1e-9), target, 1e-6);
    EXPECT_NEAR(ramp.speed(end - 1e-9), 0, 1e-6);
    const double dt = end / 400;
    for (int i = 0; i < 400 && end > 0; ++i) {
      const double t = i * dt;
      EXPECT_LE(std::abs(ramp.speed(t)), std::max(v, std::abs(v0)) + 1e-9);
      EXPECT_LE(std::abs(ramp.speed(t + dt) - ramp.speed(t)), a * dt + 1e-6);
      EXPECT_NEAR(ramp.position(t + dt) - ramp.position(t), 0.5 * (ramp.speed(t) + ramp.speed(t + dt)) * dt,
                  a * dt * dt + 1e-9);
    }
  }
}

TEST(Setpoints, NeverReachFurtherThanOneHorizonNorPastTheTarget) {
  const TimePoint start{1h};
  for (const Duration horizon : {Duration{30ms}, Duration{200ms}, Duration{1s}}) {
    const SetpointStream stream{Ramp::plan(0, 0, 1, 0.6, 4), start, 20ms, horizon};
    for (TimePoint now = start; now < stream.end() + 100ms; now += 7ms) {
      const Setpoint next = stream.at(now);
      EXPECT_LE(next.time_ms, in_ms(horizon));
      EXPECT_GE(next.time_ms, std::min(30.0, in_ms(horizon)));  // outlasts the wait for the next one
      EXPECT_LE(next.position_rad, 1.0 + 1e-12);
      EXPECT_GE(next.position_rad, stream.position(now) - 1e-12);
      const double speed = (next.position_rad - stream.position(now)) / (next.time_ms * 1e-3);
      EXPECT_LE(speed, 0.6 + 1e-9);
    }
    EXPECT_EQ(stream.at(stream.end() + 1s).position_rad, 1.0);
  }
}
}  // namespace
}  // namespace binpick::drivers::pivot
