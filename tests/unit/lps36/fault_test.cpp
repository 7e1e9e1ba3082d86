#include <gtest/gtest.h>

#include "tests/unit/lps36/pair.hpp"

namespace binpick::drivers::lps36 {
namespace {
using namespace std::chrono_literals;
using State = Session::State;
using emulators::Lps36;

enum class Phase { Connecting, Configuring, Idle, Starting, Measuring, Stopping };
constexpr const char* kPhases[] = {"connecting", "configuring", "idle", "starting", "measuring", "stopping"};

struct Fault {
  const char* name;
  std::function<void(Lps36&)> set, clear;
  bool stops_data;          ///< Noticed while measuring as well.
  Duration noticed_within;  ///< Retries included.
};
std::vector<Fault> faults() {
  const auto none = [](Lps36& d) { d.faults = {}, d.datagrams = {}; };
  return {{"unplugged", [](Lps36& d) { d.faults.unplugged = true; }, none, true, 3600ms},
          {"silent", [](Lps36& d) { d.faults.silent = true; }, none, true, 3600ms},
          {"delayed by 30 s", [](Lps36& d) { d.faults.delay = 30s; }, none, true, 3600ms},
          {"garbage", [](Lps36& d) { d.faults.garbage = true; }, none, true, 3600ms},
          {"wrong transaction", [](Lps36& d) { d.faults.wrong_id = true; }, none, false, 3600ms},
          {"refuses all", [](Lps36& d) { d.faults.error_code = 1; }, none, false, 11s},
          {"menu", [](Lps36& d) { d.in_menu = true; }, [](Lps36& d) { d.in_menu = false; }, true, 11s},
          {"permanent fault", [](Lps36& d) { d.permanent_fault = true; }, [](Lps36& d) { d.permanent_fault = false; },
           true, 3600ms}};
}

class Lps36FaultInPhase : public testing::TestWithParam<std::tuple<std::size_t, Phase>> {};
INSTANTIATE_TEST_SUITE_P(Each, Lps36FaultInPhase,
                         testing::Combine(testing::Range<std::size_t>(0, 8),
                                          testing::Values(Phase::Connecting, Phase::Configuring, Phase::Idle,
                                                          Phase::Starting, Phase::Measuring, Phase::Stopping)));

TEST_P(Lps36FaultInPhase, IsNoticedAndGotOver) {
  const auto [index, phase] = GetParam();
  const Fault fault = faults().at(index);
  SCOPED_TRACE(std::string{fault.name} + " while " + kPhases[static_cast<int>(phase)]);
  Pair pair;
  if (phase == Phase::Connecting) fault.set(pair.device);
  pair.connect();
  if (phase == Phase::Configuring) pair.run_for(13ms);
  if (phase >= Phase::Idle) {
    ASSERT_TRUE(pair.run_until(State::Idle));
  }
  if (phase >= Phase::Starting) pair.session.start_measuring(pair.now);
  if (phase >= Phase::Measuring) pair.run_for(100ms);
  if (phase >= Phase::Stopping) pair.session.stop_measuring(pair.now);
  if (phase != Phase::Connecting) fault.set(pair.device);

  // A device that refuses a mode which it is in already is no fault; one that refuses all while idle shows its mode.
  const std::string_view name = fault.name;
  const bool measures_on = phase == Phase::Measuring && !fault.stops_data;
  const bool is_no_fault = name == "refuses all" && (phase == Phase::Idle || phase == Phase::Measuring);
  const bool noticed = pair.run_until([&] { return !pair.failures.empty(); }, fault.noticed_within);
  if (measures_on || is_no_fault) {
    EXPECT_FALSE(noticed) << "nothing is asked while it measures";
  } else {
    ASSERT_TRUE(noticed);
    EXPECT_EQ(pair.session.state(), State::Offline);
    EXPECT_NE(pair.failures[0].text.find("scanner"), std::string::npos);
    EXPECT_NE(pair.failures[0].text.find(';'), std::string::npos) << "what to do: " << pair.failures[0].text;
  }

  pair.run_for(5s);  // it stays so for a while: failures keep coming, nothing grows
  EXPECT_LT(pair.log.size(), 100U) << "no storm of log lines";
  fault.clear(pair.device);
  if (!measures_on) {
    ASSERT_TRUE(pair.run_until(State::Idle, 8s)) << "ready again soon after the device is";
    pair.session.start_measuring(pair.now);
  }
  pair.profiles.clear();
  pair.run_for(1s);
  EXPECT_GT(pair.profiles.size(), 90U);
  for (const Profile& profile : pair.profiles) ASSERT_NEAR(profile.z_mm.at(0), 412.3, 1e-3);
}

Failed first_failure(const std::function<void(Pair&)>& spoil, bool starts = true) {
  Pair pair;
  pair.connect();
  EXPECT_TRUE(pair.run_until(State::Idle));
  if (starts) {
    pair.session.start_measuring(pair.now);
    pair.run_for(300ms);
  }
  spoil(pair);
  EXPECT_TRUE(pair.run_until([&] { return !pair.failures.empty(); }, 15s));
  return pair.failures.empty() ? Failed{} : pair.failures[0];
}

TEST(Lps36Fault, CausesAreToldApart) {
  using Why = Failed::Why;
  const auto silent = first_failure([](Pair& p) { p.device.faults.silent = true; });
  EXPECT_EQ(silent.why, Why::NoProfiles);
  EXPECT_EQ(silent.text,
            "scanner measures but sends no profiles for 500 ms; check its cable and window and that nobody is in its "
            "menu, switch it off and on");
  const auto garbled = first_failure([](Pair& p) { p.device.datagrams.wrong_start = true; });
  EXPECT_EQ(garbled.why, Why::BadTelegram);
  EXPECT_EQ(first_failure([](Pair& p) { p.device.datagrams.truncated = true; }).why, Why::BadTelegram);
  const auto no_x = first_failure([](Pair& p) { p.device.datagrams.no_x = true; });
  EXPECT_EQ(no_x.why, Why::NoProfiles);
  EXPECT_EQ(no_x.text,
            "scanner sends Z but no X telegrams for 500 ms; check that it sends X (parameter 0x07D4), and the network "
            "for losses");
  const auto no_z = first_failure([](Pair& p) { p.device.datagrams.no_z = true; });
  EXPECT_EQ(no_z.text.find("scanner sends X but no Z telegrams"), 0U) << no_z.text;
  const auto gone = first_failure([](Pair& p) { p.session.on_disconnected(p.now); });
  EXPECT_EQ(gone.why, Why::LinkLost);
}

TEST(Lps36Fault, WhileIdleCausesAreToldApartToo) {
  using Why = Failed::Why;
  const auto silent = first_failure([](Pair& p) { p.device.faults.silent = true; }, false);
  EXPECT_EQ(silent.why, Why::NoReply);
  EXPECT_EQ(silent.text,
            "scanner does not answer the idle check; check its power, its cable, its address and the port that it "
            "sends to");
  const auto restarted = first_failure([](Pair& p) { p.device.power_cycle(p.now); }, false);
  EXPECT_EQ(restarted.why, Why::NoReply) << "it refuses nothing: the alarm's cure is about its supply";
  EXPECT_EQ(restarted.text,
            "scanner has left command mode (status 0x0110): it was switched off and on, or another program uses it; "
            "check its power if it comes again");
  const auto menu = first_failure([](Pair& p) { p.device.in_menu = true; }, false);
  EXPECT_EQ(menu.text,
            "scanner refused the idle check (status 0x0121): someone is in the menu of its display; leave the menu");
  const auto broken = first_failure([](Pair& p) { p.device.permanent_fault = true; }, false);
  EXPECT_EQ(broken.text,
            "scanner refused the idle check (status 0x2181): it has a permanent fault; switch it off and on; if it "
            "comes again, have it serviced");
  const auto garbled = first_failure([](Pair& p) { p.device.faults.garbage = true; }, false);
  EXPECT_TRUE(garbled.why == Why::BadTelegram || garbled.why == Why::NoReply) << garbled.text;
}

TEST(Lps36Fault, MenuThatIsLeftInTimeIsWaitedFor) {
  Pair pair;
  pair.device.in_menu = true;
  pair.connect();
  pair.run_for(5s);
  EXPECT_EQ(pair.session.state(), State::Starting);
  EXPECT_TRUE(pair.failures.empty());
  pair.device.in_menu = false;
  EXPECT_TRUE(pair.run_until(State::Idle, 1s));
}

TEST(Lps36Fault, AnotherProgramThatHoldsItIsNamed) {
  Pair pair;
  pair.loses = [](const Telegram& telegram) { return telegram.id == Id::Disconnect; };
  pair.device.on_frame(encode(connect(false)), pair.now);
  pair.connect();
  ASSERT_TRUE(pair.run_until([&] { return !pair.failures.empty(); }, 20s));
  EXPECT_EQ(pair.failures[0].why, Failed::Why::Refused);
  EXPECT_EQ(pair.failures[0].text,
            "scanner refused the connect (status 0x0111): another program holds it; end that program, or switch the "
            "scanner off and on");
}

TEST(Lps36Fault, AnswerThatFitsNoQuestionIsNamed) {
  Pair pair;
  pair.connect();
  ASSERT_TRUE(pair.run_until([&] { return pair.sent.back() == connect(false); }, 1s));
  pair.session.on_frame(encode(answer(Id::Task, Id::Connect, {0x0111}, {3, 4})), pair.now);
  pair.pump();
  ASSERT_EQ(pair.failures.size(), 1U);
  EXPECT_EQ(pair.failures[0].why, Failed::Why::BadTelegram);
  EXPECT_EQ(pair.failures[0].text,
            "scanner answers the connect with telegram 0x004A of 2 words, which does not fit; check that the device is "
            "an LPS 36 and that its address belongs to no other device");
}

TEST(Lps36Fault, ADeviceThatMeasuresNothingAtAllIsAlive) {
  // Nothing in front of it: points, but none valid.
  emulators::Lps36 device{[](TimePoint, std::size_t) { return emulators::PointLine{}; }};
  Pair pair;
  pair.device = device;
  pair.connect();
  ASSERT_TRUE(pair.run_until(State::Idle));
  pair.session.start_measuring(pair.now);
  pair.run_for(2s);
  EXPECT_GT(pair.profiles.size(), 190U);
  for (const float z : pair.profiles.back().z_mm) EXPECT_TRUE(std::isnan(z));
  EXPECT_TRUE(pair.failures.empty());
}

TEST(Lps36Fault, HealthIsLoggedOnChange) {
  Pair pair;
  pair.connect();
  ASSERT_TRUE(pair.run_until(State::Idle));
  pair.session.start_measuring(pair.now);
  pair.run_for(100ms);
  pair.device.warning = true;
  pair.run_for(2s);
  EXPECT_TRUE(pair.session.status().warning());
  EXPECT_EQ(std::ranges::count_if(pair.log, [](const auto& line) { return line.find("temporary fault") != line.npos; }),
            1);
  pair.device.warning = false;
  pair.run_for(100ms);
  EXPECT_TRUE(pair.logged("its fault is gone"));
  EXPECT_TRUE(pair.failures.empty());
}

TEST(Lps36Fault, TypeZeroIsNoFault) {
  Pair pair;
  pair.device.datagrams.type_zero = true;
  pair.connect();
  ASSERT_TRUE(pair.run_until(State::Idle));
  pair.session.start_measuring(pair.now);
  pair.run_for(200ms);
  EXPECT_GT(pair.profiles.size(), 15U);
}

TEST(Lps36Fault, AFloodOfForeignDatagramsIsCountedAndSurvived) {
  Pair pair;
  pair.connect();
  ASSERT_TRUE(pair.run_until(State::Idle));
  pair.session.start_measuring(pair.now);
  for (int i = 0; i < 1000; ++i) {
    pair.session.on_frame(Bytes(static_cast<std::size_t>(i), std::byte{0xFF}), pair.now);
    pair.run_for(1ms);
  }
  EXPECT_EQ(pair.session.frames_discarded(), 1000U);
  EXPECT_GT(pair.profiles.size(), 95U);
  EXPECT_LT(pair.log.size(), 20U);
  EXPECT_TRUE(pair.failures.empty());
}
}  // namespace
}  // namespace binpick::drivers::lps36
