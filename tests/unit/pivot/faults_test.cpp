#include <cstdio>
#include <functional>
#include <gtest/gtest.h>
#include <string>
#include <vector>

#include "drivers/pivot/codec.hpp"
#include "drivers/pivot/state_word.hpp"
#include "tests/unit/pivot/bench.hpp"

/// Every fault of the pivot in every state: it is told with its cause, the axis stands, and once the cause has gone the
/// session is ready again within three seconds, without anybody's help.
namespace binpick::drivers::pivot {
namespace {
using namespace std::chrono_literals;
using State = Session::State;
using Why = Failed::Why;
using emulators::PivotOptions;

struct Fault {
  const char* name;
  std::function<void(Bench&)> begin, end;
  std::vector<Why> whys;   ///< Any of them is a fair description.
  const char* words = "";  ///< Must stand in the text.
};

const std::vector<Fault>& faults() {
  static const std::vector<Fault> kFaults{
      {"Silence",
       [](Bench& b) { b.module.faults.silent = true; },
       [](Bench& b) { b.module.faults.silent = false; },
       {Why::NoReply},
       "24 V"},
      {"Unplugged",
       [](Bench& b) { b.module.faults.unplugged = true; },
       [](Bench& b) { b.module.faults.unplugged = false; },
       {Why::NoReply},
       "CAN cable"},
      {"WrongId",
       [](Bench& b) { b.module.faults.wrong_id = true; },
       [](Bench& b) { b.module.faults.wrong_id = false; },
       {Why::NoReply},
       "module 13"},
      {"Garbage",
       [](Bench& b) { b.module.faults.garbage = true; },
       [](Bench& b) { b.module.faults.garbage = false; },
       {Why::NoReply, Why::ModuleError, Why::PowerFault, Why::ReferenceFailed, Why::MoveRefused},
       ""},
      {"Late30ms",
       [](Bench& b) { b.module.faults.delay = 30ms; },
       [](Bench& b) { b.module.faults.delay = 0ms; },
       {Why::NoReply},
       "too late"},
      {"Late150ms",
       [](Bench& b) { b.module.faults.delay = 150ms; },
       [](Bench& b) { b.module.faults.delay = 0ms; },
       {Why::NoReply},
       ""},
      {"Late500ms",
       [](Bench& b) { b.module.faults.delay = 500ms; },
       [](Bench& b) { b.module.faults.delay = 0ms; },
       {Why::NoReply},
       ""},
      {"EmergencyStop",
       [](Bench& b) { b.module.faults.emergency_stop = true; },
       [](Bench& b) { b.module.faults.emergency_stop = false; },
       {Why::PowerFault},
       "emergency stop"},
      {"TowError",
       [](Bench& b) { b.module.faults.error_code = b.protocol == Protocol::Motion ? 0xDA : state::kTow; },
       [](Bench& b) { b.module.faults.error_code.reset(); },
       {Why::ModuleError, Why::ReferenceFailed},
       "following error"},
      {"Overheated",
       [](Bench& b) { b.module.faults.error_code = b.protocol == Protocol::Motion ? 0x71 : state::kStageTemperature; },
       [](Bench& b) { b.module.faults.error_code.reset(); },
       {Why::ModuleError, Why::ReferenceFailed},
       "too hot"},
      {"BusOff",
       [](Bench& b) { b.module.faults.bus_off = true; },
       [](Bench& b) { b.module.faults.bus_off = false; },
       {Why::BusOff},
       "bus-off"},
      {"LinkDown",
       [](Bench& b) { b.session.on_link_down("can0: Network is down", b.now); },
       [](Bench& b) { b.session.on_link_up(b.now); },
       {Why::BusDown},
       "Network is down"},
      {"LooseConnector",
       [](Bench& b) { b.module.faults.disconnect_after_bytes = 40; },
       [](Bench&) {},
       {Why::NoReply},
       "CAN cable"},
  };
  return kFaults;
}

class PivotFaults : public testing::TestWithParam<std::tuple<Protocol, std::size_t, State>> {};

TEST_P(PivotFaults, AreToldAndOvercome) {
  const auto& [protocol, index, phase] = GetParam();
  const Fault& fault = faults()[index];
  PivotOptions options;
  options.protocol = protocol;
  options.start = Angle::deg(60);
  options.referenced = phase == State::Standing || phase == State::Moving;
  Bench bench{options};
  ASSERT_TRUE(bench.run_until_state(phase == State::Moving ? State::Standing : phase, 1s));
  if (phase == State::Moving) bench.session.move_to(Angle::deg(-60), 0.6, bench.now);
  if (phase != State::Identifying) bench.run_for(400ms);
  ASSERT_EQ(bench.session.state(), phase);
  bench.events.clear();
  fault.begin(bench);
  bench.pump();
  bench.run_for(3s);
  ASSERT_NE(bench.last_failed(), nullptr) << "not told";
  const Failed& told = *bench.last_failed();
  EXPECT_NE(std::find(fault.whys.begin(), fault.whys.end(), told.why), fault.whys.end())
      << static_cast<int>(told.why) << ": " << told.text;
  EXPECT_NE(told.text.find(fault.words), std::string::npos) << told.text;
  EXPECT_LE(bench.count<Failed>(), std::string_view(fault.name) == "Garbage" ? 30 : 2) << "a fault is told once";
  EXPECT_LT(bench.sent.size(), 2500U) << "no flood on the bus";
  EXPECT_FALSE(bench.busy) << "busy loop";
  EXPECT_EQ(bench.count<MoveDone>(), 0);

  bench.events.clear();
  const bool was_ready = bench.session.state() == State::Standing;  // a connector that healed by itself
  const std::uint64_t references = bench.module.reference_runs();
  const TimePoint gone = bench.now;
  fault.end(bench);
  bench.pump();
  // The device itself is ready when its reference run is over, where it needs one.
  ASSERT_TRUE(bench.run_until(
      [&] { return bench.session.state() == State::Standing || bench.session.state() == State::Referencing; }, 3s))
      << "stays " << static_cast<int>(bench.session.state());
  EXPECT_TRUE(bench.run_until_state(State::Standing, options.referenced ? Duration{3s} : Duration{8s}));
  if (options.referenced) {
    EXPECT_LE(bench.now - gone, 3s);
    EXPECT_EQ(bench.module.reference_runs(), references) << "it had not lost its reference";
  }
  EXPECT_TRUE(was_ready || bench.count<Ready>() >= 1);
  bench.session.move_to(Angle::deg(5), 1.0, bench.now);
  EXPECT_TRUE(bench.run_until([&] { return bench.count<MoveDone>() >= 1; }, 4s));
  EXPECT_NEAR(bench.module.angle_at(bench.now).in_deg(), 5, 0.1);
}

std::string phase_name(State state) {
  switch (state) {
    case State::Identifying:
      return "Identifying";
    case State::Referencing:
      return "Referencing";
    case State::Standing:
      return "Standing";
    case State::Moving:
      return "Moving";
    default:
      return "Other";
  }
}

INSTANTIATE_TEST_SUITE_P(EachInEachState, PivotFaults,
                         testing::Combine(kBothProtocols, testing::Range<std::size_t>(0, 13),
                                          testing::Values(State::Identifying, State::Referencing, State::Standing,
                                                          State::Moving)),
                         [](const auto& row) {
                           return protocol_name(std::get<0>(row.param)) + faults()[std::get<1>(row.param)].name +
                                  phase_name(std::get<2>(row.param));
                         });

class PivotEmergencyStop : public BothProtocols {};
BOTH_PROTOCOLS(PivotEmergencyStop);

TEST_P(PivotEmergencyStop, TheAxisStandsAndDoesNotGoOnByItself) {
  Bench bench{referenced()};
  ASSERT_TRUE(bench.run_until_state(State::Standing, 1s));
  bench.session.move_to(Angle::deg(60), 0.6, bench.now);
  bench.run_for(500ms);
  bench.module.faults.emergency_stop = true;
  bench.run_for(200ms);
  EXPECT_FALSE(bench.module.moving(bench.now));
  EXPECT_EQ(bench.session.state(), State::Faulted);
  EXPECT_EQ(bench.last_failed()->state_word & state::kMotorSupply, state::kMotorSupply);
  const Angle there = bench.module.angle_at(bench.now);
  bench.run_for(2s);
  bench.module.faults.emergency_stop = false;
  ASSERT_TRUE(bench.run_until_state(State::Standing, 3s));
  bench.run_for(2s);
  EXPECT_EQ(bench.module.angle_at(bench.now), there) << "ready again, but nobody asked for a move";
  EXPECT_EQ(bench.module.reference_runs(), 0U);
}

class PivotPowerCycle : public BothProtocols {};
BOTH_PROTOCOLS(PivotPowerCycle);

TEST_P(PivotPowerCycle, TheReferenceIsFoundAgain) {
  for (const bool moving : {false, true}) {
    Bench bench{referenced()};
    ASSERT_TRUE(bench.run_until_state(State::Standing, 1s));
    if (moving) bench.session.move_to(Angle::deg(30), 0.6, bench.now);
    bench.run_for(500ms);
    bench.module.power_cycle(bench.now);
    EXPECT_TRUE(bench.run_until([&] { return bench.count<Failed>() == 1; }, 1s));
    ASSERT_TRUE(bench.run_until([&] { return bench.count<Ready>() == 2; }, 5s));
    EXPECT_EQ(bench.module.reference_runs(), 1U);
    EXPECT_NEAR(bench.module.angle_at(bench.now).in_deg(), 0, 0.01);
  }
}

TEST_P(PivotPowerCycle, SoShortThatNoReplyIsMissingIsNoticedToo) {
  PivotOptions options = referenced();
  options.boot = 0ms;
  options.start = Angle::deg(20);
  Bench bench{options};
  ASSERT_TRUE(bench.run_until_state(State::Standing, 1s));
  bench.run_for(300ms);
  bench.module.power_cycle(bench.now, 5ms);
  ASSERT_TRUE(bench.run_until([&] { return bench.count<Failed>() == 1; }, 1s));
  EXPECT_NE(bench.last_failed()->text.find("reference"), std::string::npos) << bench.last_failed()->text;
  EXPECT_TRUE(bench.run_until([&] { return bench.count<Ready>() == 2; }, 5s));
}

class PivotReference : public BothProtocols {};
BOTH_PROTOCOLS(PivotReference);

TEST_P(PivotReference, ABrokenHomeSwitchIsToldAndNotTriedWithoutPause) {
  PivotOptions options = fresh();
  Bench bench{options};
  bench.module.home_switch_broken = true;
  bench.run_for(60s);
  ASSERT_NE(bench.last_failed(), nullptr);
  EXPECT_EQ(bench.last_failed()->why, Why::ReferenceFailed);
  EXPECT_NE(bench.last_failed()->text.find("hard limit"), std::string::npos) << bench.last_failed()->text;
  EXPECT_LE(bench.module.reference_runs(), 5U);
  bench.module.home_switch_broken = false;
  EXPECT_TRUE(bench.run_until_state(State::Standing, 40s));
}

TEST_P(PivotReference, ThatNeverEndsIsGivenUp) {
  PivotOptions options = fresh();
  options.start = Angle::deg(150);
  options.home_velocity_rad_s = 0.01;
  Options session;
  session.reference_timeout = 2s;
  Bench bench{options, session};
  ASSERT_TRUE(bench.run_until([&] { return bench.count<Failed>() == 1; }, 4s));
  EXPECT_EQ(bench.last_failed()->why, Why::ReferenceFailed);
  bench.run_for(100ms);
  EXPECT_FALSE(bench.module.moving(bench.now));
}

TEST_P(PivotReference, AMotionThatAnEarlierProgramLeftIsStoppedFirst) {
  PivotOptions options = referenced();
  Bench first{options};
  ASSERT_TRUE(first.run_until_state(State::Standing, 1s));
  if (GetParam() == Protocol::PowerCube) {  // a velocity that another program asked for goes on for ever
    first.module.on_frame(encode(12, Request{Move{Motion::Velocity, 0.3F, 0}}), first.now);
  } else {
    for (const CanFrame& frame : motion::frames_of(
             0x50C, encode(motion::Request{motion::MovePosition{2.5, 0.3, 1.0}}, motion::UnitSystem::Degree)))
      first.module.on_frame(frame, first.now += 2ms);
  }
  first.session.on_link_down("restart", first.now);
  first.now += 5ms;
  Options again;
  again.protocol = GetParam();
  first.session = Session{again};
  first.session.on_link_up(first.now);
  first.pump();
  ASSERT_TRUE(first.run_until_state(State::Standing, 3s));
  EXPECT_FALSE(first.module.moving(first.now));
}

class PivotMove : public BothProtocols {};
BOTH_PROTOCOLS(PivotMove);

TEST_P(PivotMove, RefusedIsTold) {
  PivotOptions options = referenced();
  Bench bench{options};
  ASSERT_TRUE(bench.run_until_state(State::Standing, 1s));
  bench.session.move_to(Angle::deg(20), 0.6, bench.now);
  bench.lose_steps = true;  // the module acknowledges, and stands
  ASSERT_TRUE(bench.run_until([&] { return bench.count<Failed>() == 1; }, 4s));
  EXPECT_EQ(bench.last_failed()->why, Why::MoveRefused);
  EXPECT_NE(bench.last_failed()->text.find("instead of 20.00"), std::string::npos) << bench.last_failed()->text;
  bench.lose_steps = false;
  EXPECT_TRUE(bench.run_until_state(State::Standing, 3s));
}

class PivotBus : public BothProtocols {};
BOTH_PROTOCOLS(PivotBus);

TEST_P(PivotBus, ErrorPassiveIsToldApartFromSilence) {
  PivotOptions options = fresh();
  Bench bench{options};
  bench.module.faults.unplugged = true;
  CanFrame passive;  // controller problem, TX passive, counters 128 and 0: nobody acknowledges
  passive.error = true;
  passive.id = 0x204;
  passive.length = 8;
  passive.payload = {0x00, 0x20, 0, 0, 0, 0, 0x80, 0x00};
  bench.session.on_frame(passive, bench.now);
  bench.run_for(1s);
  ASSERT_EQ(bench.count<Failed>(), 1);
  EXPECT_EQ(bench.last_failed()->why, Why::BusDown);
  EXPECT_NE(bench.last_failed()->text.find("error-passive"), std::string::npos);
  bench.module.faults.unplugged = false;
  EXPECT_TRUE(bench.run_until_state(State::Standing, 5s));
}

TEST_P(PivotBus, BusOffByTheLinkIsBusOff) {
  Bench bench{referenced()};
  ASSERT_TRUE(bench.run_until_state(State::Standing, 1s));
  bench.session.on_link_down("bus-off on can0: short circuit, …", bench.now);
  bench.pump();
  ASSERT_NE(bench.last_failed(), nullptr);
  EXPECT_EQ(bench.last_failed()->why, Why::BusOff);
  EXPECT_EQ(bench.session.state(), State::Offline);
  EXPECT_FALSE(bench.session.deadline());
  bench.session.on_link_up(bench.now);
  bench.pump();
  EXPECT_TRUE(bench.run_until_state(State::Standing, 1s));
}

class PivotFaultsAtRandom : public BothProtocols {};
BOTH_PROTOCOLS(PivotFaultsAtRandom);

/// Faults that come and go at random for an hour: at the end the pivot is ready and does what it is told.
TEST_P(PivotFaultsAtRandom, AlwaysEndReady) {
  for (unsigned seed = 1; seed <= 20; ++seed) {
    std::mt19937 random{seed};
    Bench bench{referenced()};
    for (int round = 0; round < 60; ++round) {
      const Fault& fault = faults()[random() % faults().size()];
      if (bench.session.state() == State::Standing)
        bench.session.move_to(Angle::deg(static_cast<double>(random() % 120) - 60),
                              0.1 + 0.01 * static_cast<double>(random() % 100), bench.now);
      bench.run_for(std::chrono::milliseconds(random() % 1500));
      fault.begin(bench);
      bench.pump();
      bench.run_for(std::chrono::milliseconds(random() % 1500));
      fault.end(bench);
      bench.pump();
      if (random() % 8 == 0) bench.session.stop(bench.now);
      if (random() % 8 == 0) bench.module.power_cycle(bench.now);
      ASSERT_FALSE(bench.busy) << "seed " << seed << ", round " << round << ", " << fault.name;
    }
    bench.run_for(2s);  // what was done last may not have shown yet
    ASSERT_TRUE(bench.run_until_state(State::Standing, 45s)) << "seed " << seed;
    bench.events.clear();
    bench.session.move_to(Angle::deg(1), 1.0, bench.now);
    ASSERT_TRUE(bench.run_until([&] { return bench.count<MoveDone>() == 1; }, 10s)) << "seed " << seed;
  }
}
}  // namespace
}  // namespace binpick::drivers::pivot
