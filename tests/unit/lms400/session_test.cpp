#include "drivers/scanner/lms400/session.hpp"

#include <cmath>
#include <gtest/gtest.h>
#include <random>

#include "tests/unit/lms400/pair.hpp"

namespace binpick::drivers::lms400 {
namespace {
using namespace std::chrono_literals;
using State = Session::State;

TEST(Lms400Session, StartsInTheKnownOrderAndIsReady) {
  Options options;
  options.filter_mask = 13;
  options.extended_remission = true;
  Pair pair{options};
  pair.connect();
  EXPECT_EQ(pair.session.state(), State::Starting);
  ASSERT_TRUE(pair.run_until(State::Idle, 1s));
  EXPECT_EQ(pair.sent, (std::vector<std::string>{"sMN mLRstopdata", "sMN SetAccessMode 4 81BE23AA", "sWN FLsel +13",
                                                 "sWN MDblex 1", "sMN mSCsetscanconfig +360.00 +0.25 +55.00 +70.00"}));
  ASSERT_EQ(pair.ready.size(), 1U);
  EXPECT_DOUBLE_EQ(pair.ready[0].frequency_hz, 360);
  EXPECT_DOUBLE_EQ(pair.ready[0].resolution.value().in_deg(), 0.25);
  EXPECT_TRUE(pair.device.logged_in());
}

TEST(Lms400Session, MeasuresOneProfilePerPeriodAndStops) {
  Pair pair;
  pair.connect();
  ASSERT_TRUE(pair.run_until(State::Idle));
  pair.session.start_measuring(pair.now);
  EXPECT_EQ(pair.session.state(), State::Measuring);
  pair.run_for(1s);
  EXPECT_NEAR(static_cast<double>(pair.profiles.size()), 360, 8);
  const Profile& profile = pair.profiles.back();
  ASSERT_EQ(profile.x_mm.size(), 280U);
  ASSERT_EQ(profile.z_mm.size(), 280U);
  for (const std::size_t i : {0U, 7U, 279U}) {
    const double angle = Angle::deg(55 + 0.25 * static_cast<double>(i)).in_rad();
    EXPECT_NEAR(profile.x_mm[i], 1800 * std::cos(angle), 1e-3);
    EXPECT_NEAR(profile.z_mm[i], 1800 * std::sin(angle), 1e-3);
  }
  for (std::size_t i = 1; i < pair.profiles.size(); ++i) {
    EXPECT_EQ(pair.profiles[i].counter, static_cast<std::uint16_t>(pair.profiles[i - 1].counter + 1));
    EXPECT_NEAR(in_ms(pair.profiles[i].measured_at - pair.profiles[i - 1].measured_at), 1000 / 360.0, 0.01);
  }
  pair.session.stop_measuring(pair.now);
  ASSERT_TRUE(pair.run_until(State::Idle, 1s));
  EXPECT_EQ(pair.stopped, 1);
  EXPECT_FALSE(pair.device.measuring());
  const auto count = pair.profiles.size();
  pair.run_for(1s);
  EXPECT_EQ(pair.profiles.size(), count);
  EXPECT_EQ(pair.session.profiles_lost(), 0U);
  EXPECT_TRUE(pair.failures.empty());
}

TEST(Lms400Session, WaitsForTheMotorAfterAChangeOfFrequency) {
  Options options;
  options.frequency_hz = 250;
  emulators::Lms400::Options device;
  device.spin_up = 4s;
  Pair pair{options, device};
  pair.connect();
  pair.run_for(3s);
  EXPECT_EQ(pair.session.state(), State::Starting);
  EXPECT_TRUE(pair.failures.empty());
  ASSERT_TRUE(pair.run_until(State::Idle, 2s));
  EXPECT_DOUBLE_EQ(pair.ready.at(0).frequency_hz, 250);
}

TEST(Lms400Session, SaysWhatTheDeviceReallySet) {
  Options options;
  options.resolution = Angle::deg(0.23);
  Pair pair{options};
  pair.connect();
  ASSERT_TRUE(pair.run_until(State::Idle));
  EXPECT_NEAR(pair.ready.at(0).resolution.value().in_deg(), 0.25, 1e-6);
  EXPECT_TRUE(
      pair.logged("set to 360.0 Hz and 0.250 deg instead of 360.0 Hz and 0.230 deg (quality 00000008); write these"));
}

TEST(Lms400Session, PairThatTheDeviceRefusesIsNamed) {
  Options options;
  options.frequency_hz = 500;
  options.resolution = Angle::deg(0.1);
  Pair pair{options};
  pair.connect();
  ASSERT_TRUE(pair.run_until([&] { return !pair.failures.empty(); }, 5s));
  EXPECT_EQ(pair.failures[0].why, Failed::Why::Refused);
  EXPECT_EQ(pair.failures[0].text,
            "scanner refused 'sMN mSCsetscanconfig +500.00 +0.10 +55.00 +70.00' with error 1; choose another pair of "
            "frequency_hz and resolution_deg in [scanner]");
  EXPECT_EQ(pair.session.state(), State::Offline);
}

TEST(Lms400Session, ArgumentOutOfRangeIsRefusedInWords) {
  Options options;
  options.start = Angle::deg(80);
  Pair pair{options};
  pair.connect();
  ASSERT_TRUE(pair.run_until([&] { return !pair.failures.empty(); }, 5s));
  EXPECT_EQ(pair.failures[0].text,
            "scanner refused the scan configuration: error 5, invalid argument; check frequency_hz, resolution_deg, "
            "start_deg and range_deg in [scanner]");
}

TEST(Lms400Session, StopsADeviceThatStillMeasuresForSomeoneElse) {
  emulators::Lms400::Options device;
  device.streams_on_after_close = true;
  Pair pair{{}, device};
  pair.connect();
  ASSERT_TRUE(pair.run_until(State::Idle));
  pair.session.start_measuring(pair.now);
  pair.run_for(200ms);
  pair.disconnect();
  ASSERT_TRUE(pair.device.measuring());
  pair.profiles.clear();
  pair.connect();
  ASSERT_TRUE(pair.run_until(State::Idle));
  EXPECT_TRUE(pair.profiles.empty()) << "what was not asked for is thrown away";
  EXPECT_FALSE(pair.device.measuring());
}

TEST(Lms400Session, TelegramsBetweenAcceptedAndResultAreTaken) {
  Pair pair;
  pair.connect();
  ASSERT_TRUE(pair.run_until(State::Idle));
  pair.session.start_measuring(pair.now);
  (void)pair.session.take_output();
  Measured m;
  m.distance = {1000};
  m.remission = {50};
  const auto say = [&](const Message& message) { pair.session.on_bytes(encode(message), pair.now); };
  say(m);  // before the device has accepted: from earlier
  say(Text{"sMA mLRreqdata"});
  say(m);
  say(Text{"sAN mLRreqdata 00000000"});
  say(m);
  int profiles = 0;
  while (auto event = pair.session.take_event()) profiles += std::holds_alternative<ProfileReceived>(*event);
  EXPECT_EQ(profiles, 2);
}

TEST(Lms400Session, StartThatTheDeviceCannotDoYetIsAskedAgain) {
  Pair pair;
  pair.connect();
  ASSERT_TRUE(pair.run_until(State::Idle));
  pair.device.faults.error_code = 4;  // the motor settles
  pair.session.start_measuring(pair.now);
  pair.run_for(2s);
  EXPECT_TRUE(pair.failures.empty());
  pair.device.faults.error_code.reset();
  ASSERT_TRUE(pair.run_until([&] { return !pair.profiles.empty(); }, 1s));
}

TEST(Lms400Session, BusyDeviceIsGivenUpAfterItsTime) {
  Pair pair;
  pair.device.faults.error_code = 0xD;
  pair.connect();
  const TimePoint began = pair.now;
  ASSERT_TRUE(pair.run_until([&] { return !pair.failures.empty(); }, 20s));
  EXPECT_GT(pair.now - began, 9s);
  EXPECT_LT(pair.now - began, 11s);
  EXPECT_EQ(pair.failures[0].text,
            "scanner refused the stop command before start-up: error D, method busy, an earlier call still runs; leave "
            "the scanner to one program; switch it off and on");
}

TEST(Lms400Session, CounterGapsAreCounted) {
  emulators::Lms400::Options device;
  device.first_counter = 65500;  // wraps on the way
  Pair pair{{}, device};
  pair.connect();
  ASSERT_TRUE(pair.run_until(State::Idle));
  pair.session.start_measuring(pair.now);
  pair.run_for(300ms);
  EXPECT_EQ(pair.session.profiles_lost(), 0U);
  pair.device.skip_counter(5);
  pair.run_for(300ms);
  EXPECT_EQ(pair.session.profiles_lost(), 5U);
  pair.device.faults.silent = true;
  pair.run_for(100ms);
  pair.device.faults.silent = false;
  pair.run_for(100ms);
  EXPECT_NEAR(static_cast<double>(pair.session.profiles_lost()), 5 + 36, 2);
  pair.session.stop_measuring(pair.now);
  pair.run_for(100ms);
  pair.session.start_measuring(pair.now);
  pair.run_for(100ms);
  EXPECT_EQ(pair.session.profiles_lost(), 0U) << "since start_measuring";
}

TEST(Lms400Session, GarbageBetweenTheFramesIsSkippedAndCounted) {
  Pair pair;
  pair.connect();
  ASSERT_TRUE(pair.run_until(State::Idle));
  pair.session.start_measuring(pair.now);
  pair.run_for(100ms);
  const auto before = pair.profiles.size();
  Bytes garbage(1000, std::byte{2});  // nothing but frame starts
  pair.session.on_bytes(garbage, pair.now);
  pair.run_for(100ms);
  EXPECT_GE(pair.profiles.size(), before + 34);
  EXPECT_GE(pair.session.bytes_skipped(), 1000U);
  EXPECT_TRUE(pair.failures.empty());
}

TEST(Lms400Session, EverySplitGivesTheSame) {
  // The device's whole side of a start and a few profiles, cut at each byte once, and byte by byte.
  Bytes said;
  for (const char* text :
       {"sMA mLRstopdata", "sAN mLRstopdata 00000000", "sMA SetAccessMode", "sAN SetAccessMode 1", "sWA FLsel",
        "sWA MDblex", "sMA mSCsetscanconfig", "sAN mSCsetscanconfig 00000000 43B40000 3E800000 00000008"})
    append(said, encode(Text{text}));
  const TimePoint now = TimePoint{} + 5s;
  for (std::size_t cut = 0; cut <= said.size(); ++cut) {
    Session session{Options{}};
    session.on_connected(now);
    session.on_bytes(ByteView{said}.first(cut), now);
    session.on_bytes(ByteView{said}.subspan(cut), now);
    ASSERT_EQ(session.state(), State::Idle) << cut;
  }
  Session session{Options{}};
  session.on_connected(now);
  for (const std::byte b : said) session.on_bytes({&b, 1}, now);
  EXPECT_EQ(session.state(), State::Idle);
}

TEST(Lms400Session, StopWhileTheMotorSettlesIsNotHeldUp) {
  emulators::Lms400::Options device;
  Pair pair{{}, device};
  pair.connect();
  ASSERT_TRUE(pair.run_until(State::Idle));
  pair.device.faults.delay = 400ms;
  pair.session.start_measuring(pair.now);
  pair.run_for(10ms);
  pair.session.stop_measuring(pair.now);
  ASSERT_TRUE(pair.run_until(State::Idle, 2s));
  EXPECT_EQ(pair.stopped, 1);
  EXPECT_TRUE(pair.failures.empty());
}

TEST(Lms400Session, StartRightAfterStopFollows) {
  Pair pair;
  pair.connect();
  ASSERT_TRUE(pair.run_until(State::Idle));
  pair.session.start_measuring(pair.now);
  pair.run_for(100ms);
  pair.session.stop_measuring(pair.now);
  pair.session.start_measuring(pair.now);
  pair.run_for(200ms);
  EXPECT_EQ(pair.stopped, 1);
  EXPECT_EQ(pair.session.state(), State::Measuring);
  EXPECT_TRUE(pair.device.measuring());
}

TEST(Lms400Session, CommandsAtTheWrongTimeAreIgnoredAndLogged) {
  Pair pair;
  pair.session.start_measuring(pair.now);
  pair.session.stop_measuring(pair.now);
  EXPECT_TRUE(pair.session.take_output().empty());
  EXPECT_TRUE(pair.logged("not ready to measure"));
  EXPECT_TRUE(pair.logged("nothing to stop"));
}

TEST(Lms400Session, JitterOfTheNetworkIsSmoothedAway) {
  // The emulated device measures on its own beat; every third telegram and what follows it come 0 … 20 ms late.
  Pair pair;
  pair.connect();
  ASSERT_TRUE(pair.run_until(State::Idle));
  pair.session.start_measuring(pair.now);
  pair.run_for(50ms);
  pair.profiles.clear();
  std::mt19937_64 random{3};
  std::uniform_real_distribution<double> late_s{0, 0.020};
  TimePoint previous = pair.now;
  const TimePoint began = pair.now;
  double worst_ms = 0;
  while (pair.now < began + 5s) {
    pair.now = *pair.device.deadline();
    pair.device.on_deadline(pair.now);
    const Bytes telegram = pair.device.take_output();
    const TimePoint received =
        std::max(previous, pair.now + (random() % 3 == 0 ? from_s(late_s(random)) : Duration{0}));
    previous = received;
    pair.session.on_bytes(telegram, received);
    while (auto event = pair.session.take_event())
      if (auto* got = std::get_if<ProfileReceived>(&*event); got && pair.now > began + 500ms)
        worst_ms = std::max(worst_ms, std::abs(in_ms(got->profile.measured_at - pair.now)));
  }
  EXPECT_LT(worst_ms, 1.0);
}
}  // namespace
}  // namespace binpick::drivers::lms400
