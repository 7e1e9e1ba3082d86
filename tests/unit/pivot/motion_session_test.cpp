#include <cmath>
#include <gtest/gtest.h>

#include "drivers/pivot/motion_codec.hpp"
#include "drivers/pivot/probe.hpp"
#include "drivers/pivot/state_word.hpp"
#include "tests/unit/pivot/bench.hpp"
#include "tests/unit/pivot/frame_text.hpp"

/// What only the Motion Protocol has: unit systems, reports that are left on, refusals, impulses, frames that must not
/// follow at once. What both have is in session_test.cpp and faults_test.cpp.
namespace binpick::drivers::pivot {
namespace {
using namespace std::chrono_literals;
using State = Session::State;
using Why = Failed::Why;
using emulators::PivotOptions;

PivotOptions module70() {
  PivotOptions options;
  options.protocol = Protocol::Motion;
  options.referenced = true;
  options.start = Angle::deg(0);
  options.hurry = 1ms;
  return options;
}

class MotionUnits : public testing::TestWithParam<motion::UnitSystem> {};

TEST_P(MotionUnits, AreRadiansInside) {
  PivotOptions options = module70();
  options.units = GetParam();
  Bench bench{options};
  ASSERT_TRUE(bench.run_until_state(State::Standing, 200ms));
  const ModuleInfo& info = std::get<Ready>(bench.events.back()).module;
  EXPECT_EQ(info.type, "PR-70");
  EXPECT_NEAR(info.position_min.in_deg(), -160, 1e-3);
  EXPECT_NEAR(info.acceleration_max_rad_s2, 4.0, 1e-3);
  bench.session.move_to(Angle::deg(-16), 1.0, bench.now);
  ASSERT_TRUE(bench.run_until([&] { return bench.count<MoveDone>() == 1; }, 3s));
  bench.samples.clear();
  bench.session.move_to(Angle::deg(16), Angle::deg(34).in_rad(), bench.now);
  ASSERT_TRUE(bench.run_until([&] { return bench.count<MoveDone>() == 2; }, 3s));
  EXPECT_NEAR(bench.module.angle_at(bench.now).in_deg(), 16, 0.01);
  ASSERT_GE(bench.samples.size(), 90U);
  for (const Sample& sample : bench.samples)  // angle and time, at 34 deg/s
    EXPECT_NEAR(sample.angle.in_deg(), bench.module.angle_at(sample.at).in_deg(), 0.002);
}
INSTANTIATE_TEST_SUITE_P(All, MotionUnits,
                         testing::Values(motion::UnitSystem::Radian, motion::UnitSystem::Degree,
                                         motion::UnitSystem::Microdegree, motion::UnitSystem::Millidegree));

TEST(MotionSession, AModuleThatCountsInMillimetresIsNoPivot) {
  PivotOptions options = module70();
  options.units = motion::UnitSystem::Millimetre;
  Bench bench{options};
  bench.run_for(2s);
  ASSERT_EQ(bench.count<Failed>(), 1);
  EXPECT_EQ(bench.last_failed()->why, Why::ModuleError);
  EXPECT_NE(bench.last_failed()->text.find("counts in mm"), std::string::npos) << bench.last_failed()->text;
  EXPECT_EQ(bench.count<Ready>(), 0);
}

TEST(MotionSession, ReportsThatAnEarlierProgramLeftOnAreEnded) {
  using Bytes8 = std::initializer_list<std::uint8_t>;
  for (const std::uint8_t mode : Bytes8{1, 3, 7}) {
    PivotOptions options = module70();
    options.cyclic = motion::GetState::Cyclic{0.01, mode};
    Bench bench{options};
    ASSERT_TRUE(bench.run_until_state(State::Standing, 3s)) << int{mode};
    bench.run_for(100ms);
    bench.sent.clear();
    bench.samples.clear();
    bench.run_for(1s);
    EXPECT_NEAR(static_cast<double>(bench.samples.size()), 100, 6) << "one for each of our own asks";
    EXPECT_EQ(bench.count<Failed>(), 0);
  }
}

TEST(MotionSession, AnOkInPlaceOfAReportIsAskedAgain) {
  PivotOptions options = module70();
  options.ok_before_report = 7;
  Bench bench{options};
  ASSERT_TRUE(bench.run_until_state(State::Standing, 1s));
  bench.session.move_to(Angle::deg(30), 0.6, bench.now);
  ASSERT_TRUE(bench.run_until([&] { return bench.count<MoveDone>() == 1; }, 3s));
  EXPECT_EQ(bench.count<Failed>(), 0) << bench.last_failed()->text;
}

TEST(MotionSession, AFastStopThatLeavesNoErrorIsAsGood) {
  PivotOptions options = module70();
  options.fast_stop_is_error = false;
  Bench bench{options};
  ASSERT_TRUE(bench.run_until_state(State::Standing, 1s));
  bench.session.move_to(Angle::deg(60), 0.6, bench.now);
  bench.run_for(500ms);
  bench.session.stop(bench.now);
  bench.pump();
  ASSERT_TRUE(bench.run_until_state(State::Standing, 1s));
  EXPECT_FALSE(bench.module.moving(bench.now));
  bench.session.move_to(Angle::deg(0), 0.6, bench.now);
  ASSERT_TRUE(bench.run_until([&] { return bench.count<MoveDone>() == 1; }, 3s));
  EXPECT_EQ(bench.count<Failed>(), 0);
}

TEST(MotionSession, ARefusedMoveIsToldWithTheModulesReason) {
  Bench bench{module70()};
  ASSERT_TRUE(bench.run_until_state(State::Standing, 1s));
  bench.module.limit_to(Angle::deg(-10), Angle::deg(10));  // somebody narrows its limits after it was identified
  bench.session.move_to(Angle::deg(40), 0.6, bench.now);
  ASSERT_TRUE(bench.run_until([&] { return bench.count<Failed>() == 1; }, 3s));
  EXPECT_EQ(bench.last_failed()->why, Why::MoveRefused);
  EXPECT_NE(bench.last_failed()->text.find("wrong parameter [1E]"), std::string::npos) << bench.last_failed()->text;
  EXPECT_TRUE(bench.run_until_state(State::Standing, 3s));
}

TEST(MotionSession, ABlockedAxisIsTold) {
  Bench bench{module70()};
  ASSERT_TRUE(bench.run_until_state(State::Standing, 1s));
  bench.session.move_to(Angle::deg(40), 0.6, bench.now);
  bench.run_for(400ms);
  bench.session.on_frame(frame("70C [6] 05 93 00 00 48 41"), bench.now);
  bench.pump();
  ASSERT_EQ(bench.count<Failed>(), 1);
  EXPECT_NE(bench.last_failed()->text.find("blocked at 12.50 deg"), std::string::npos) << bench.last_failed()->text;
  bench.run_for(200ms);
  EXPECT_FALSE(bench.module.moving(bench.now));
  EXPECT_TRUE(bench.run_until_state(State::Standing, 3s));
}

TEST(MotionSession, EveryErrorIsToldByNameWithWhatToDo) {
  using Bytes8 = std::initializer_list<std::uint8_t>;
  for (const std::uint8_t code :
       Bytes8{0x70, 0x71, 0x72, 0x74, 0x76, 0x82, 0xD2, 0xD5, 0xDA, 0xDC, 0xDE, 0xDF, 0xE2, 0xE4, 0xFE}) {
    Bench bench{module70()};
    ASSERT_TRUE(bench.run_until_state(State::Standing, 1s));
    bench.module.faults.error_code = code;
    bench.run_for(500ms);
    ASSERT_EQ(bench.count<Failed>(), 1) << int{code};
    char number[8];
    std::snprintf(number, sizeof number, "[%02X]", unsigned{code});
    EXPECT_NE(bench.last_failed()->text.find(number), std::string::npos) << bench.last_failed()->text;
    EXPECT_NE(bench.last_failed()->text.find('('), std::string::npos) << bench.last_failed()->text;
    EXPECT_EQ(bench.last_failed()->why, code == 0x74 ? Why::PowerFault : Why::ModuleError);
    bench.module.faults.error_code.reset();
    EXPECT_TRUE(bench.run_until_state(State::Standing, 1s)) << int{code};
  }
}

TEST(MotionSession, FramesNeverFollowWithinAMillisecond) {
  Bench bench{module70()};
  ASSERT_TRUE(bench.run_until_state(State::Standing, 1s));
  TimePoint last = bench.now - 1s;
  std::size_t seen = bench.sent.size();
  for (int i = 0; i < 4000; ++i) {
    if (i % 500 == 0) bench.session.move_to(Angle::deg(i % 1000 == 0 ? 30 : -30), 0.6, bench.now);
    if (i % 700 == 699) bench.session.stop(bench.now);
    bench.pump();
    bench.step(bench.now + 3ms);
    if (bench.sent.size() == seen) continue;
    EXPECT_EQ(bench.sent.size(), seen + 1);
    EXPECT_GE(bench.now - last, 1ms);
    last = bench.now;
    seen = bench.sent.size();
  }
}

TEST(MotionSession, SendsOnlyMessagesThatFitOneFrame) {
  Bench bench{module70()};
  ASSERT_TRUE(bench.run_until_state(State::Standing, 1s));
  bench.session.move_to(Angle::deg(30), 0.6, bench.now);
  bench.run_for(3s);
  for (const CanFrame& f : bench.sent) EXPECT_EQ(f.payload[0] + 1, f.length) << "a lost fragment would be an error";
}

// --- another master, either protocol --------------------------------------------------------------------------------

class PivotOtherMaster : public BothProtocols {};
BOTH_PROTOCOLS(PivotOtherMaster);

TEST_P(PivotOtherMaster, IsToldAndTheAxisStands) {
  Bench bench{referenced()};
  ASSERT_TRUE(bench.run_until_state(State::Standing, 1s));
  bench.session.move_to(Angle::deg(40), 0.6, bench.now);
  bench.run_for(400ms);
  const bool motion = GetParam() == Protocol::Motion;
  bench.session.on_frame(frame(motion ? "50C [2] 01 95" : "0CC [2] 0A 27"), bench.now);
  EXPECT_EQ(bench.session.state(), State::Moving) << "somebody looks on";
  bench.session.on_frame(frame(motion ? "50C [6] 05 B0 00 00 20 41" : "0EC [6] 0B 04 DA 0F C9 3F"), bench.now);
  bench.pump();
  ASSERT_EQ(bench.count<Failed>(), 1);
  EXPECT_NE(bench.last_failed()->text.find("another master"), std::string::npos) << bench.last_failed()->text;
  bench.run_for(200ms);
  EXPECT_FALSE(bench.module.moving(bench.now));
  EXPECT_TRUE(bench.run_until_state(State::Standing, 2s));
}

// --- which protocol? ------------------------------------------------------------------------------------------------

class PivotProbe : public testing::TestWithParam<std::tuple<Protocol, Protocol>> {};

TEST_P(PivotProbe, TellsWhatTheModuleSpeaksAndTouchesNothing) {
  const auto [configured, spoken] = GetParam();
  PivotOptions module_options;
  module_options.protocol = spoken;
  module_options.hurry = 1ms;
  emulators::Pivot module{module_options};
  Options options;
  options.protocol = configured;
  options.identify_only = true;
  Probe probe{options};
  TimePoint now{1h};
  const TimePoint until = now + 3s;
  probe.on_link_up(now);
  std::size_t sent = 0;
  while (now < until) {
    for (bool quiet = false; !quiet;) {
      quiet = true;
      for (const CanFrame& f : probe.take_frames()) {
        ++sent;
        quiet = false;
        const bool powercube_read = f.id == 0x0CC && f.payload[0] == 0x0A;
        const bool motion_read = f.id == 0x50C && (f.payload[1] == 0x80 || (f.payload[1] == 0x95 && f.length == 2));
        EXPECT_TRUE(powercube_read || motion_read) << text_of(f);
        module.on_frame(f, now);
      }
      for (const CanFrame& f : module.take_frames()) quiet = false, probe.on_frame(f, now);
    }
    now = std::max(now, std::min(earlier(probe.deadline(), module.deadline()).value_or(until), until));
    if (probe.deadline() && *probe.deadline() <= now) probe.on_deadline(now);
    if (module.deadline() && *module.deadline() <= now) module.on_deadline(now);
  }
  EXPECT_EQ(probe.session().module().has_value(), configured == spoken);
  EXPECT_EQ(probe.answers_in_other(), configured == spoken ? std::nullopt : std::optional{spoken});
  EXPECT_EQ(module.reference_runs(), 0U);
  EXPECT_EQ(module.angle_at(now).in_deg(), 25) << "nothing has moved";
  EXPECT_LT(sent, 60U);
  const auto filters = probe.filters();
  for (const std::uint32_t id : {0x0ACU, 0x70CU})
    EXPECT_TRUE(std::any_of(filters.begin(), filters.end(), [&](const auto& f) { return f.id == id; })) << id;
}
INSTANTIATE_TEST_SUITE_P(All, PivotProbe, testing::Combine(kBothProtocols, kBothProtocols), [](const auto& row) {
  return protocol_name(std::get<0>(row.param)) + "In" + protocol_name(std::get<1>(row.param));
});

TEST(PivotSweepLinks, DoNotAskInTheOtherProtocol) {
  Options options;
  Probe probe{options};
  TimePoint now{1h};
  probe.on_link_up(now);
  for (int i = 0; i < 200; ++i) {
    now += 20ms;
    probe.on_deadline(now);
    for (const CanFrame& f : probe.take_frames()) EXPECT_NE(f.id, 0x50CU);
  }
}
}  // namespace
}  // namespace binpick::drivers::pivot
