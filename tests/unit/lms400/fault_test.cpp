#include <gtest/gtest.h>

#include "tests/unit/lms400/pair.hpp"

namespace binpick::drivers::lms400 {
namespace {
using namespace std::chrono_literals;
using State = Session::State;
using emulators::Faults;

enum class Phase { Connecting, Configuring, Idle, Starting, Measuring, Stopping };
constexpr const char* kPhases[] = {"connecting", "configuring", "idle", "starting", "measuring", "stopping"};

struct Fault {
  const char* name;
  std::function<void(Faults&)> set;
  Duration noticed_within;
};
std::vector<Fault> faults() {
  return {{"unplugged", [](Faults& f) { f.unplugged = true; }, 1ms},
          {"silent", [](Faults& f) { f.silent = true; }, 2100ms},
          {"delayed by 3 s", [](Faults& f) { f.delay = 3s; }, 2100ms},
          {"garbage", [](Faults& f) { f.garbage = true; }, 2100ms},
          {"cut after 10 bytes", [](Faults& f) { f.disconnect_after_bytes = 10; }, 1100ms},
          {"error 5", [](Faults& f) { f.error_code = 5; }, 1100ms}};
}

class FaultInPhase : public testing::TestWithParam<std::tuple<std::size_t, Phase>> {};
INSTANTIATE_TEST_SUITE_P(Each, FaultInPhase,
                         testing::Combine(testing::Range<std::size_t>(0, 6),
                                          testing::Values(Phase::Connecting, Phase::Configuring, Phase::Idle,
                                                          Phase::Starting, Phase::Measuring, Phase::Stopping)));

TEST_P(FaultInPhase, IsNoticedAndGotOver) {
  const auto [index, phase] = GetParam();
  const Fault fault = faults()[index];
  SCOPED_TRACE(std::string{fault.name} + " while " + kPhases[static_cast<int>(phase)]);
  Pair pair;
  if (phase == Phase::Connecting) fault.set(pair.device.faults);
  pair.connect();
  if (phase == Phase::Configuring) pair.run_for(15ms);
  if (phase >= Phase::Idle) {
    ASSERT_TRUE(pair.run_until(State::Idle));
  }
  if (phase >= Phase::Starting) pair.session.start_measuring(pair.now);
  if (phase >= Phase::Measuring) pair.run_for(100ms);
  if (phase >= Phase::Stopping) {
    pair.session.stop_measuring(pair.now);
    if (std::string_view{fault.name} == "error 5") pair.now += 1ms;
  }
  if (phase != Phase::Connecting) fault.set(pair.device.faults);

  const bool is_plugged_out_before = phase == Phase::Connecting && pair.device.faults.unplugged;
  const bool measures_on = phase == Phase::Measuring && pair.device.faults.error_code;
  const bool noticed = pair.run_until([&] { return !pair.failures.empty(); }, fault.noticed_within);
  if (is_plugged_out_before) {
    EXPECT_FALSE(pair.connected);
  } else if (measures_on) {
    EXPECT_FALSE(noticed) << "nothing is asked while it measures";
  } else {
    ASSERT_TRUE(noticed);
    EXPECT_EQ(pair.session.state(), State::Offline);
    EXPECT_FALSE(pair.failures[0].text.empty());
    EXPECT_NE(pair.failures[0].text.find("scanner"), std::string::npos);
  }

  pair.run_for(5s);  // it stays so for a while: failures keep coming, nothing grows
  pair.device.faults = {};
  ASSERT_TRUE(pair.run_until([&] { return pair.session.state() == State::Idle || measures_on; }, 3s))
      << "ready again within 3 s after the device is";
  pair.profiles.clear();
  if (!measures_on) pair.session.start_measuring(pair.now);
  pair.run_for(500ms);
  EXPECT_GT(pair.profiles.size(), 150U);
  for (const auto& profile : pair.profiles) ASSERT_NEAR(std::hypot(profile.x_mm[0], profile.z_mm[0]), 1800, 1e-3);
}

TEST(Lms400Fault, SilenceWhileMeasuringIsNoticedWithinASecond) {
  Pair pair;
  pair.connect();
  ASSERT_TRUE(pair.run_until(State::Idle));
  pair.session.start_measuring(pair.now);
  pair.run_for(300ms);
  pair.device.faults.silent = true;
  const TimePoint began = pair.now;
  ASSERT_TRUE(pair.run_until([&] { return !pair.failures.empty(); }, 2s));
  EXPECT_LT(pair.now - began, 1s);
  EXPECT_EQ(pair.failures[0].why, Failed::Why::NoProfiles);
  EXPECT_EQ(pair.failures[0].text,
            "scanner measures but sends no profiles for 500 ms; check its cable and window, switch it off and on");
}

TEST(Lms400Fault, CausesAreToldApart) {
  const auto first_failure = [](const std::function<void(Pair&)>& spoil) {
    Pair pair;
    pair.connect();
    EXPECT_TRUE(pair.run_until(State::Idle));
    spoil(pair);
    pair.session.start_measuring(pair.now);
    EXPECT_TRUE(pair.run_until([&] { return !pair.failures.empty(); }, 15s));
    return pair.failures.at(0);
  };
  EXPECT_EQ(first_failure([](Pair& p) { p.device.faults.silent = true; }).why, Failed::Why::NoReply);
  EXPECT_EQ(first_failure([](Pair& p) { p.device.faults.garbage = true; }).why, Failed::Why::BadTelegram);
  EXPECT_EQ(first_failure([](Pair& p) { p.device.faults.error_code = 1; }).why, Failed::Why::Refused);
  EXPECT_EQ(first_failure([](Pair& p) { p.device.faults.disconnect_after_bytes = 5; }).why, Failed::Why::LinkLost);
}

TEST(Lms400Fault, AnotherDeviceAtItsAddressIsNoCableFault) {
  const std::string words = "HTTP/1.0 400 Bad Request\r\n\r\n";
  for (const bool closes : {true, false}) {
    const TimePoint now{1h};
    Session session{Options{}};
    session.on_connected(now);
    session.on_bytes(std::as_bytes(std::span{words}), now);
    if (closes)
      session.on_disconnected(now);
    else
      session.on_deadline(now + 2s);
    const auto event = session.take_event();
    ASSERT_TRUE(event.has_value());
    const auto& failed = std::get<Failed>(*event);
    EXPECT_EQ(failed.why, Failed::Why::BadTelegram) << "alarm 201, not 200";
    EXPECT_NE(failed.text.find("is no LMS 400 (28 bytes of no telegram): a wrong device or port"), std::string::npos)
        << failed.text;
    EXPECT_EQ(session.take_reopen(), !closes);
  }
}

TEST(Lms400Fault, ByteByByteIsSlowButRight) {
  Pair pair;
  pair.device.faults.split_every_byte = true;
  pair.connect();
  ASSERT_TRUE(pair.run_until(State::Idle));
  pair.session.start_measuring(pair.now);
  pair.run_for(500ms);
  EXPECT_GT(pair.profiles.size(), 170U);
  EXPECT_EQ(pair.session.profiles_lost(), 0U);
  EXPECT_EQ(pair.session.bytes_skipped(), 0U);
}

TEST(Lms400Fault, CutComesAfterTheStatedNumberOfBytesAndOnce) {
  Pair pair;
  pair.connect();
  ASSERT_TRUE(pair.run_until(State::Idle));
  pair.session.start_measuring(pair.now);
  pair.run_for(100ms);
  const auto before = pair.profiles.size();
  pair.device.faults.disconnect_after_bytes = 20'000;  // 22 telegrams of 887 bytes and a part of one
  ASSERT_TRUE(pair.run_until([&] { return !pair.failures.empty(); }, 1s));
  EXPECT_EQ(pair.profiles.size() - before, 22U);
  ASSERT_TRUE(pair.run_until(State::Idle, 2s));
  EXPECT_EQ(pair.failures.size(), 1U);
}
}  // namespace
}  // namespace binpick::drivers::lms400
