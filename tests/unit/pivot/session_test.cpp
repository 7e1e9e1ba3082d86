#include <cmath>
#include <gtest/gtest.h>
#include <string>

#include "base/log.hpp"
#include "drivers/pivot/codec.hpp"
#include "drivers/pivot/state_word.hpp"
#include "tests/unit/pivot/bench.hpp"

namespace binpick::drivers::pivot {
namespace {
using namespace std::chrono_literals;
using State = Session::State;
using emulators::PivotOptions;

class PivotSession : public BothProtocols {};
BOTH_PROTOCOLS(PivotSession);

TEST_P(PivotSession, IsIdentifiedReferencedAndReady) {
  Bench bench{fresh()};
  EXPECT_EQ(bench.session.state(), State::Identifying);
  ASSERT_TRUE(bench.run_until_state(State::Referencing, 100ms));
  ASSERT_TRUE(bench.run_until_state(State::Standing, 5s));
  ASSERT_EQ(bench.count<Ready>(), 1);
  EXPECT_EQ(bench.count<Failed>(), 0);
  const ModuleInfo& info = std::get<Ready>(bench.events.back()).module;
  EXPECT_EQ(info.firmware, 0x3518);
  EXPECT_EQ(info.serial, 12345678U);
  EXPECT_NEAR(info.position_max.in_deg(), 160, 1e-4);
  EXPECT_NEAR(info.velocity_max_rad_s, 2.6, 1e-6);
  EXPECT_NEAR(bench.module.angle_at(bench.now).in_deg(), 0, 0.01);
}

TEST_P(PivotSession, DoesNotReferenceAModuleThatIs) {
  PivotOptions options = fresh();
  options.referenced = true;
  Bench bench{options};
  ASSERT_TRUE(bench.run_until_state(State::Standing, 100ms));
  EXPECT_EQ(bench.module.reference_runs(), 0U);
  EXPECT_NEAR(bench.module.angle_at(bench.now).in_deg(), 25, 1e-9);
}

PivotOptions referenced() {
  PivotOptions options;
  options.referenced = true;
  options.start = Angle::deg(0);
  return options;
}

TEST_P(PivotSession, MovesToATargetAndStandsThere) {
  Bench bench{referenced()};
  ASSERT_TRUE(bench.run_until_state(State::Standing, 100ms));
  bench.session.move_to(Angle::deg(-20), 0.6, bench.now);
  ASSERT_TRUE(bench.run_until([&] { return bench.count<MoveDone>() == 1; }, 3s));
  EXPECT_EQ(bench.session.state(), State::Standing);
  EXPECT_NEAR(bench.module.angle_at(bench.now).in_deg(), -20, 0.05);
  EXPECT_FALSE(bench.module.moving(bench.now));
  EXPECT_EQ(bench.count<Failed>(), 0);
}

// --- the stream of positions ---------------------------------------------------------------------------------------

/// Position at `at` between the samples around it; nullopt outside.
std::optional<double> interpolated(const std::vector<Sample>& samples, TimePoint at) {
  for (std::size_t i = 1; i < samples.size(); ++i)
    if (samples[i - 1].at <= at && at <= samples[i].at) {
      const double f = in_s(at - samples[i - 1].at) / in_s(samples[i].at - samples[i - 1].at);
      return samples[i - 1].angle.in_rad() + f * (samples[i].angle - samples[i - 1].angle).in_rad();
    }
  return std::nullopt;
}

class PivotStream : public testing::TestWithParam<std::uint16_t> {};  // firmware

TEST_P(PivotStream, IsTrueToAHundredthOfADegree) {
  PivotOptions options = referenced();
  options.firmware = GetParam();
  Bench bench{options};
  ASSERT_TRUE(bench.run_until_state(State::Standing, 200ms));
  bench.session.move_to(Angle::deg(-16), 1.0, bench.now);
  ASSERT_TRUE(bench.run_until_state(State::Standing, 3s));
  bench.samples.clear();
  const TimePoint start = bench.now;
  bench.session.move_to(Angle::deg(16), Angle::deg(34).in_rad(), bench.now);
  ASSERT_TRUE(bench.run_until_state(State::Standing, 3s));
  ASSERT_GE(bench.samples.size(), 90U);
  double worst = 0;
  int compared = 0;
  for (TimePoint at = start; at < bench.now; at += 777us)
    if (const auto angle = interpolated(bench.samples, at)) {
      worst = std::max(worst, std::abs(Angle::rad(*angle).in_deg() - bench.module.angle_at(at).in_deg()));
      ++compared;
    }
  EXPECT_GT(compared, 1000);
  EXPECT_LT(worst, 0.01);
  RecordProperty("worst_deg", std::to_string(worst));
  for (std::size_t i = 1; i < bench.samples.size(); ++i) {
    EXPECT_LE(bench.samples[i].at - bench.samples[i - 1].at, 15ms);
    EXPECT_GT(bench.samples[i].at, bench.samples[i - 1].at);
  }
}

INSTANTIATE_TEST_SUITE_P(Firmware, PivotStream, testing::Values(0x3518, 0x2518, 0x3500, 0x2000));

TEST(PivotPowerCube, ReadsPositionAndStateApartWhereTheFirmwareIsOld) {
  PivotOptions options = referenced();
  options.firmware = 0x3500;
  Bench bench{options};
  ASSERT_TRUE(bench.run_until_state(State::Standing, 200ms));
  bench.run_for(100ms);
  for (const CanFrame& frame : bench.sent) EXPECT_FALSE(frame.length == 2 && frame.payload[1] == 0x62);
  EXPECT_GE(bench.samples.size(), 9U);
}

TEST_P(PivotSession, IdentifyOnlyLooksAndDoesNotTouch) {
  PivotOptions module = fresh();
  Options options;
  options.identify_only = true;
  Bench bench{module, options};
  bench.run_for(300ms);
  ASSERT_TRUE(bench.session.module());
  EXPECT_EQ(bench.session.module()->serial, 12345678U);
  bench.module.faults.emergency_stop = true;
  bench.run_for(1s);
  EXPECT_EQ(bench.session.state_word() & state::kMotorSupply, state::kMotorSupply);
  EXPECT_NE(bench.session.state_in_words().find("not referenced"), std::string::npos);
  EXPECT_EQ(bench.session.state(), State::Identifying);
  EXPECT_EQ(bench.count<Ready>(), 1);
  bench.session.move_to(Angle::deg(10), 0.5, bench.now);
  bench.module.faults.silent = true;
  bench.run_for(1s);
  EXPECT_EQ(bench.count<Failed>(), 1);
  bench.module.faults.silent = false;
  bench.run_for(1s);
  EXPECT_EQ(bench.count<Ready>(), 2);
  for (const CanFrame& frame : bench.sent) {  // reads alone
    if (GetParam() == Protocol::PowerCube) {
      EXPECT_EQ(frame.id, 0x0CCU);
    } else {
      EXPECT_EQ(frame.id, 0x50CU);
      const bool state = frame.payload[1] == 0x95 && frame.length == 2;
      const bool config = frame.payload[1] == 0x80 && frame.length <= 3;
      EXPECT_TRUE(state || config) << int{frame.payload[1]};
    }
  }
}

// --- motion --------------------------------------------------------------------------------------------------------

TEST_P(PivotSession, SweepsAtASteadySpeed) {
  Bench bench{referenced()};
  ASSERT_TRUE(bench.run_until_state(State::Standing, 200ms));
  bench.session.move_to(Angle::deg(-20), 1.0, bench.now);
  ASSERT_TRUE(bench.run_until_state(State::Standing, 3s));
  const double speed = 0.6;
  bench.session.move_to(Angle::deg(20), speed, bench.now);
  ASSERT_TRUE(bench.run_until([&] { return bench.module.speed_at(bench.now) > 0.99 * speed; }, 1s));
  bench.run_for(40ms);
  while (bench.module.angle_at(bench.now) < Angle::deg(16)) {
    ASSERT_TRUE(bench.step(bench.now + 5ms) || true);
    EXPECT_NEAR(bench.module.speed_at(bench.now), speed, 0.02 * speed);
  }
  ASSERT_TRUE(bench.run_until([&] { return bench.count<MoveDone>() == 2; }, 1s));
}

class PivotSteps : public testing::TestWithParam<PivotOptions::Steps> {};

TEST_P(PivotSteps, ArrivesWhateverTheModuleDoesWithAnEarlyStep) {
  PivotOptions options = referenced();
  options.steps = GetParam();
  Bench bench{options};
  ASSERT_TRUE(bench.run_until_state(State::Standing, 200ms));
  bench.session.move_to(Angle::deg(-20), 0.6, bench.now);
  ASSERT_TRUE(bench.run_until([&] { return bench.count<MoveDone>() == 1; }, 3s));
  const TimePoint start = bench.now;
  bench.session.move_to(Angle::deg(20), 0.6, bench.now);
  ASSERT_TRUE(bench.run_until([&] { return bench.count<MoveDone>() == 2; }, 4s));
  EXPECT_NEAR(bench.module.angle_at(bench.now).in_deg(), 20, 0.1);
  const double ideal_s = 2 * Angle::deg(20).in_rad() / 0.6 + 0.6 / 4;
  EXPECT_LT(in_s(bench.now - start), ideal_s + 0.6);
  EXPECT_EQ(bench.count<Failed>(), 0);
}
INSTANTIATE_TEST_SUITE_P(Both, PivotSteps, testing::Values(PivotOptions::Steps::Replace, PivotOptions::Steps::Queue));

TEST_P(PivotSession, TurnsRoundWithoutAJump) {
  Bench bench{referenced()};
  ASSERT_TRUE(bench.run_until_state(State::Standing, 200ms));
  bench.session.move_to(Angle::deg(40), 1.0, bench.now);
  bench.run_for(400ms);
  bench.session.move_to(Angle::deg(-10), 1.0, bench.now);
  ASSERT_TRUE(bench.run_until([&] { return bench.count<MoveDone>() == 1; }, 4s));
  EXPECT_NEAR(bench.module.angle_at(bench.now).in_deg(), -10, 0.1);
  EXPECT_EQ(bench.count<Failed>(), 0) << bench.last_failed()->text;
}

TEST_P(PivotSession, ClampsTargetAndSpeedToTheModulesLimits) {
  PivotOptions options = referenced();
  options.position_max = Angle::deg(30);
  options.velocity_max_rad_s = 0.5;
  Bench bench{options};
  ASSERT_TRUE(bench.run_until_state(State::Standing, 200ms));
  bench.session.move_to(Angle::deg(90), 50, bench.now);
  double fastest = 0;
  while (bench.count<MoveDone>() == 0 && bench.now < TimePoint{1h} + 10s) {
    bench.step(bench.now + 3ms);
    fastest = std::max(fastest, bench.module.speed_at(bench.now));
  }
  EXPECT_NEAR(bench.module.angle_at(bench.now).in_deg(), 30, 0.1);
  EXPECT_LT(fastest, 0.52);
}

TEST_P(PivotSession, IgnoresTargetsThatAreNoneAndMovesWhenNotReady) {
  Bench bench{referenced()};
  bench.session.move_to(Angle::deg(10), 0.5, bench.now);  // still identifying
  ASSERT_TRUE(bench.run_until_state(State::Standing, 200ms));
  bench.session.move_to(Angle::rad(NAN), 0.5, bench.now);
  bench.session.move_to(Angle::deg(10), NAN, bench.now);
  bench.session.move_to(Angle::deg(10), 0, bench.now);
  bench.run_for(500ms);
  EXPECT_EQ(bench.session.state(), State::Standing);
  EXPECT_NEAR(bench.module.angle_at(bench.now).in_deg(), 0, 1e-9);
}

TEST_P(PivotSession, StopsAtOnceAndMovesAgain) {
  Bench bench{referenced()};
  ASSERT_TRUE(bench.run_until_state(State::Standing, 200ms));
  bench.session.move_to(Angle::deg(60), 0.8, bench.now);
  bench.run_for(600ms);
  const double before = bench.module.angle_at(bench.now).in_rad();
  bench.session.stop(bench.now);
  bench.pump();
  bench.run_for(100ms);
  EXPECT_FALSE(bench.module.moving(bench.now));
  const double gap_s = GetParam() == Protocol::Motion ? 0.002 : 0;  // after the frame before, which it must keep
  EXPECT_LT(bench.module.angle_at(bench.now).in_rad() - before, 0.8 * gap_s + 0.8 * 0.8 / (2 * 20) + 0.001)
      << "HALT brakes hard";
  bench.session.move_to(Angle::deg(0), 0.8, bench.now);  // HALT needs a RESET first: the session sees to it
  ASSERT_TRUE(bench.run_until([&] { return bench.count<MoveDone>() == 1; }, 3s));
  EXPECT_NEAR(bench.module.angle_at(bench.now).in_deg(), 0, 0.1);
  EXPECT_EQ(bench.count<Failed>(), 0);
  EXPECT_EQ(bench.count<Ready>(), 1);
}

TEST_P(PivotSession, StopWhileStandingChangesNothing) {
  Bench bench{referenced()};
  ASSERT_TRUE(bench.run_until_state(State::Standing, 200ms));
  bench.sent.clear();
  bench.session.stop(bench.now);
  bench.run_for(500ms);
  EXPECT_EQ(bench.session.state(), State::Standing);
  for (const CanFrame& frame : bench.sent) {  // neither HALT nor RESET
    EXPECT_NE(frame.length, 1);
    if (GetParam() == Protocol::Motion) {
      EXPECT_EQ(frame.payload[1], 0x95);
    }
  }
}

TEST_P(PivotSession, StopEndsAReferenceRunAndItIsNotTriedAgainAtOnce) {
  PivotOptions options = fresh();
  options.start = Angle::deg(90);
  Bench bench{options};
  ASSERT_TRUE(bench.run_until_state(State::Referencing, 200ms));
  bench.run_for(300ms);
  ASSERT_TRUE(bench.module.moving(bench.now));
  bench.session.stop(bench.now);
  bench.pump();
  bench.run_for(200ms);
  const Angle there = bench.module.angle_at(bench.now);
  bench.run_for(2s);
  EXPECT_EQ(bench.module.angle_at(bench.now), there);
  EXPECT_TRUE(bench.run_until_state(State::Standing, 10s));
}

/// The point of streaming set-points: nobody is left to send a HALT.
class PivotAlone : public testing::TestWithParam<std::tuple<Protocol, int>> {};

TEST_P(PivotAlone, StandsWithinOneHorizonAfterTheDaemonVanished) {
  const auto [protocol, horizon_ms] = GetParam();
  Options options;
  options.setpoint_horizon = std::chrono::milliseconds(horizon_ms);
  PivotOptions module = referenced();
  module.protocol = protocol;
  for (const double speed : {0.2, 0.6, 1.5}) {
    // A module that makes its own ramps needs speed / acceleration to stand, however short the horizon is.
    const double cycle_s = std::min(20e-3, horizon_ms * 1e-3 / 4);
    const double own_ramp_s = protocol == Protocol::Motion ? speed / module.acceleration_max_rad_s2 + 3 * cycle_s : 0;
    const double within_s = std::max(horizon_ms * 1e-3, own_ramp_s) + 0.005;
    for (int vanished_ms = 601; vanished_ms < 625; ++vanished_ms) {
      Bench bench{module, options};
      ASSERT_TRUE(bench.run_until_state(State::Standing, 200ms));
      bench.session.move_to(Angle::deg(120), speed, bench.now);
      bench.run_for(std::chrono::milliseconds(vanished_ms));
      ASSERT_TRUE(bench.module.moving(bench.now));
      const TimePoint dead = bench.now;
      const double before = bench.module.angle_at(dead).in_rad();
      bench.driver_alive = false;
      bench.run_for(2s);
      EXPECT_FALSE(bench.module.moving(dead + from_s(within_s))) << speed;
      EXPECT_LE(bench.module.angle_at(bench.now).in_rad() - before, speed * within_s) << speed;
    }
  }
}
INSTANTIATE_TEST_SUITE_P(Horizons, PivotAlone, testing::Combine(kBothProtocols, testing::Values(40, 200, 500)));

TEST(PivotPowerCube, AModuleWithAWatchdogIsFedAndHaltsWithoutUs) {
  PivotOptions options = referenced();
  options.config_word |= config_bit::kWatchdog;
  options.watchdog = 120ms;
  Options slow;
  slow.setpoint_horizon = 2s;  // so that it is the watchdog that stops it
  Bench bench{options, slow};
  ASSERT_TRUE(bench.run_until_state(State::Standing, 200ms));
  bench.session.move_to(Angle::deg(60), 0.5, bench.now);
  bench.run_for(1s);
  EXPECT_EQ(bench.count<Failed>(), 0);
  ASSERT_TRUE(bench.module.moving(bench.now));
  bench.driver_alive = false;
  bench.run_for(250ms);
  EXPECT_FALSE(bench.module.moving(bench.now));
}

TEST_P(PivotSession, GoesOnAfterTheLoopWasHeldUp) {
  Bench bench{referenced()};
  ASSERT_TRUE(bench.run_until_state(State::Standing, 200ms));
  bench.session.move_to(Angle::deg(60), 0.6, bench.now);
  bench.run_for(500ms);
  bench.driver_alive = false;  // as if the machine had been suspended
  bench.run_for(900ms);
  bench.driver_alive = true;
  ASSERT_TRUE(bench.run_until([&] { return bench.count<MoveDone>() == 1 || bench.count<Failed>() == 1; }, 5s));
  EXPECT_TRUE(bench.run_until_state(State::Standing, 3s));
  EXPECT_EQ(bench.module.state_word(bench.now) & state::kTow, 0U) << "no jump of the set position";
}

TEST_P(PivotSession, OneLostFrameCostsNothing) {
  for (int lost = 0; lost < 60; ++lost) {
    Bench bench{referenced()};
    ASSERT_TRUE(bench.run_until_state(State::Standing, 200ms));
    bench.session.move_to(Angle::deg(30), 0.6, bench.now);
    bench.run_for(300ms);
    bench.lose_frame_in = lost;
    ASSERT_TRUE(bench.run_until([&] { return bench.count<MoveDone>() == 1; }, 4s)) << lost;
    EXPECT_EQ(bench.count<Failed>(), 0) << lost << ": " << bench.last_failed()->text;
  }
}

TEST(PivotPowerCube, OddConfigurationsAreServed) {
  for (const std::uint32_t bits : {config_bit::kSuppressAcknowledge, config_bit::kSynchronousMotion}) {
    PivotOptions options;
    options.config_word |= bits;
    Bench bench{options};
    ASSERT_TRUE(bench.run_until_state(State::Standing, 5s)) << bits;
    bench.session.move_to(Angle::deg(10), 0.6, bench.now);
    ASSERT_TRUE(bench.run_until([&] { return bench.count<MoveDone>() == 1; }, 3s)) << bits;
    bench.session.move_to(Angle::deg(60), 0.6, bench.now);
    bench.run_for(300ms);
    bench.session.stop(bench.now);
    bench.pump();
    ASSERT_TRUE(bench.run_until_state(State::Standing, 1s));
    bench.session.move_to(Angle::deg(0), 0.6, bench.now);
    ASSERT_TRUE(bench.run_until([&] { return bench.count<MoveDone>() == 2; }, 3s)) << bits;
  }
}

TEST(PivotPowerCube, RefusesALinearAxisAndLimitsWithoutSense) {
  PivotOptions linear = referenced();
  linear.config_word |= config_bit::kLinear;
  PivotOptions senseless = referenced();
  senseless.position_max = Angle::deg(-170);
  PivotOptions creeping = referenced();
  creeping.velocity_max_rad_s = 1e-30;
  for (const PivotOptions& options : {linear, senseless, creeping}) {
    Bench bench{options};
    bench.run_for(2s);
    ASSERT_EQ(bench.count<Failed>(), 1);
    EXPECT_EQ(bench.last_failed()->why, Failed::Why::ModuleError);
    EXPECT_EQ(bench.count<Ready>(), 0);
    EXPECT_FALSE(bench.busy);
  }
}
}  // namespace
}  // namespace binpick::drivers::pivot
