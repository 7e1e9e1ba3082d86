#include "drivers/scanner/lps36/session.hpp"

#include <cmath>
#include <gtest/gtest.h>
#include <map>
#include <random>

#include "tests/unit/lps36/pair.hpp"

namespace binpick::drivers::lps36 {
namespace {
using namespace std::chrono_literals;
using State = Session::State;

TEST(Lps36Session, StartsInTheKnownOrderAndIsReady) {
  Pair pair;
  pair.connect();
  EXPECT_EQ(pair.session.state(), State::Starting);
  ASSERT_TRUE(pair.run_until(State::Idle, 1s));
  EXPECT_EQ(pair.sent,
            (std::vector<Telegram>{
                command(Id::Disconnect), connect(false), command(Id::EnterCommandMode),
                set_user_parameter(false, user::kXDisabled, 0), get_user_parameter(user::kXDisabled),
                set_user_parameter(false, user::kPause, 0), get_user_parameter(user::kPause),
                set_task_parameter(false, task::kOperationMode, {0}), get_task_parameter(task::kOperationMode),
                set_task_parameter(false, task::kActivation, {0}), get_task_parameter(task::kActivation)}));
  ASSERT_EQ(pair.ready.size(), 1U);
  EXPECT_DOUBLE_EQ(pair.ready[0].frequency_hz, 100);
  EXPECT_TRUE(pair.device.connected());
  EXPECT_TRUE(pair.device.in_command_mode());
  EXPECT_TRUE(pair.failures.empty());
  EXPECT_TRUE(pair.profiles.empty()) << "what flows between connect and command mode is not asked for";
}

TEST(Lps36Session, SetsWhatIsGivenAndNothingElse) {
  Options options;
  options.exposure = Exposure::Manual;
  options.manual_exposure = 250us;
  options.field_of_view = FieldOfView{Length::mm(-120.5), Length::mm(130), Length::mm(200), Length::mm(600)};
  options.pause_steps = 4;
  Pair pair{options};
  pair.connect();
  ASSERT_TRUE(pair.run_until(State::Idle, 1s));
  using Words = std::vector<std::uint16_t>;
  EXPECT_EQ(pair.device.parameter(task::kManualExposure), Words{2500});
  EXPECT_EQ(pair.device.parameter(task::kExposure), Words{4});
  EXPECT_EQ(pair.device.parameter(task::kFieldX), (Words{0x10000 - 1205, 1300}));
  EXPECT_EQ(pair.device.parameter(task::kFieldZ), (Words{2000, 6000}));
  EXPECT_EQ(pair.device.parameter(user::kPause), Words{4});
}

TEST(Lps36Session, MeasuresOneProfilePerPeriodAndStops) {
  emulators::Lps36::Options device;
  device.first_scan = 65500;  // wraps on the way
  device.encoder_per_s = 5000;
  Pair pair{{}, device};
  pair.connect();
  ASSERT_TRUE(pair.run_until(State::Idle));
  pair.session.start_measuring(pair.now);
  EXPECT_EQ(pair.session.state(), State::Measuring);
  pair.run_for(1s);
  EXPECT_NEAR(static_cast<double>(pair.profiles.size()), 99, 2);
  const Profile& profile = pair.profiles.back();
  ASSERT_EQ(profile.x_mm.size(), 376U);
  ASSERT_EQ(profile.z_mm.size(), 376U);
  EXPECT_NEAR(profile.x_mm[0], -150, 1e-4);
  EXPECT_NEAR(profile.x_mm[375], 150, 1e-4);
  EXPECT_NEAR(profile.z_mm[7], 412.3, 1e-4);
  EXPECT_TRUE(std::isnan(profile.x_mm[3]) && std::isnan(profile.z_mm[3]));
  for (std::size_t i = 1; i < pair.profiles.size(); ++i) {
    EXPECT_EQ(pair.profiles[i].counter, static_cast<std::uint16_t>(pair.profiles[i - 1].counter + 1));
    EXPECT_NEAR(in_ms(pair.profiles[i].measured_at - pair.profiles[i - 1].measured_at), 10, 0.01);
    EXPECT_NEAR(pair.profiles[i].encoder - pair.profiles[i - 1].encoder, 50, 1);
  }
  pair.session.stop_measuring(pair.now);
  ASSERT_TRUE(pair.run_until(State::Idle, 1s));
  EXPECT_EQ(pair.stopped, 1);
  EXPECT_FALSE(pair.device.measuring());
  const auto count = pair.profiles.size();
  pair.run_for(5s);
  EXPECT_EQ(pair.profiles.size(), count);
  EXPECT_EQ(pair.session.profiles_lost(), 0U);
  EXPECT_EQ(pair.session.telegrams(), (Pairing::Counts{.lines = count}));
  EXPECT_EQ(pair.session.frames_discarded(), 0U);
  EXPECT_TRUE(pair.failures.empty());
}

TEST(Lps36Session, AnHiSendsFinerPoints) {
  Options options;
  options.hi = true;
  emulators::Lps36::Options device;
  device.hi = true;
  Pair pair{options, device};
  pair.connect();
  ASSERT_TRUE(pair.run_until(State::Idle));
  EXPECT_EQ(pair.sent.at(1), connect(true));
  pair.session.start_measuring(pair.now);
  pair.run_for(200ms);
  ASSERT_GT(pair.profiles.size(), 15U);
  const Profile& profile = pair.profiles.back();
  ASSERT_EQ(profile.z_mm.size(), 240U);
  EXPECT_NEAR(profile.z_mm[0], 412.3, 1e-4);
  EXPECT_NEAR(profile.x_mm[239], -150 + 0.8 * 239, 1e-4);
  EXPECT_FALSE(pair.logged("other model"));
}

TEST(Lps36Session, TheWrongModelMeasuresAndIsNamed) {
  Options options;
  options.hi = true;
  Pair pair{options};  // a standard LPS 36 answers an HI connect as if it were the standard one
  pair.connect();
  ASSERT_TRUE(pair.run_until(State::Idle));
  pair.session.start_measuring(pair.now);
  pair.run_for(200ms);
  ASSERT_GT(pair.profiles.size(), 15U);
  EXPECT_NEAR(pair.profiles.back().z_mm.at(0), 412.3, 1e-4) << "the unit is the telegram's, not the configured one";
  EXPECT_TRUE(pair.logged("is configured as an LPS 36 HI, but measures as the other model; correct the model"));
}

TEST(Lps36Session, AnHiInTheStandardWayHasItsLastPointsEmpty) {
  emulators::Lps36::Options device;
  device.hi = true;
  Pair pair{{}, device};
  pair.connect();
  ASSERT_TRUE(pair.run_until(State::Idle));
  pair.session.start_measuring(pair.now);
  pair.run_for(100ms);
  ASSERT_FALSE(pair.profiles.empty());
  EXPECT_NEAR(pair.profiles[0].z_mm.at(239), 412.3, 1e-4);
  for (std::size_t i = 240; i < 376; ++i) EXPECT_TRUE(std::isnan(pair.profiles[0].z_mm.at(i)));
}

TEST(Lps36Session, EachTriggerGivesOneProfile) {
  Options options;
  options.trigger = Options::Trigger::Ethernet;
  Pair pair{options};
  pair.connect();
  ASSERT_TRUE(pair.run_until(State::Idle));
  EXPECT_DOUBLE_EQ(pair.ready.at(0).frequency_hz, 0);
  EXPECT_FALSE(pair.session.trigger(pair.now)) << "not measuring";
  pair.session.start_measuring(pair.now);
  pair.run_for(5s);
  EXPECT_TRUE(pair.profiles.empty());
  EXPECT_TRUE(pair.failures.empty()) << "without a trigger silence is right";
  for (int i = 0; i < 50; ++i) {
    ASSERT_TRUE(pair.session.trigger(pair.now));
    EXPECT_FALSE(pair.session.trigger(pair.now)) << "too soon";
    pair.run_for(20ms);
  }
  pair.run_for(2s);
  EXPECT_EQ(pair.profiles.size(), 50U);
  EXPECT_EQ(pair.device.triggers_ignored(), 0U);
  EXPECT_EQ(pair.profiles.back().measured_at, pair.profiles.back().received_at);
  EXPECT_TRUE(pair.failures.empty());
  pair.device.faults.silent = true;
  ASSERT_TRUE(pair.session.trigger(pair.now));
  ASSERT_TRUE(pair.run_until([&] { return !pair.failures.empty(); }, 600ms));
  EXPECT_EQ(pair.failures[0].why, Failed::Why::NoProfiles);
}

TEST(Lps36Session, PulsesOnTheInputAreWaitedForWithoutEnd) {
  Options options;
  options.trigger = Options::Trigger::Input;
  Pair pair{options};
  pair.connect();
  ASSERT_TRUE(pair.run_until(State::Idle));
  pair.session.start_measuring(pair.now);
  pair.run_for(60s);
  EXPECT_EQ(pair.session.state(), State::Measuring);
  EXPECT_FALSE(pair.session.trigger(pair.now));
  pair.device.on_frame(encode(command(Id::Trigger)), pair.now);  // stands for a pulse
  pair.run_for(1s);
  EXPECT_EQ(pair.profiles.size(), 1U);
  pair.session.stop_measuring(pair.now);
  EXPECT_TRUE(pair.run_until(State::Idle, 1s));
}

/// Arrivals as the session sees them, counted by themselves: what came twice, and what came after a newer one.
struct Arrivals {
  std::map<std::pair<std::uint16_t, Id>, int> seen;
  std::uint64_t duplicates = 0, overtaken = 0;
  std::int64_t newest = -1;
  void operator()(const Telegram& telegram) {
    if (!is_measured(telegram.id)) return;
    if (seen[{telegram.scan, telegram.id}]++ > 0) {
      ++duplicates;
      return;
    }
    const std::int64_t order = 2 * std::int64_t{telegram.scan} + (telegram.id == Id::MeasuredX ? 1 : 0);
    if (order < newest) ++overtaken;
    newest = std::max(newest, order);
  }
};

class Lps36Network : public testing::TestWithParam<std::tuple<bool, std::uint64_t>> {};
INSTANTIATE_TEST_SUITE_P(Seeds, Lps36Network,
                         testing::Combine(testing::Bool(), testing::Values<std::uint64_t>(1, 2, 3)));

TEST_P(Lps36Network, LossesAreCountedExactlyAndSurvived) {
  const auto [hi, seed] = GetParam();
  Options options;
  options.hi = hi;
  emulators::Lps36::Options device;
  device.hi = hi;
  device.seed = seed;
  Pair pair{options, device};
  pair.connect();
  ASSERT_TRUE(pair.run_until(State::Idle));
  pair.session.start_measuring(pair.now);
  pair.run_for(100ms);  // a quiet beginning and end, so that first and last line are known
  Arrivals arrivals;
  pair.on_arrival = [&](const Telegram& telegram) { arrivals(telegram); };
  const std::uint64_t before = pair.device.scans_measured();
  pair.device.datagrams = {.lost = 0.10, .late = 0.05, .duplicated = 0.01};
  pair.run_for(100s);
  pair.device.datagrams = {};
  pair.run_for(200ms);
  const std::uint64_t scans = pair.device.scans_measured() - before;
  EXPECT_GT(scans, 10'000U);

  const Pairing::Counts counts = pair.session.telegrams();
  EXPECT_EQ(counts.lost, pair.device.scans_spoiled());
  EXPECT_EQ(counts.halves, pair.device.scans_halved());
  EXPECT_EQ(counts.duplicates, pair.device.copies_sent());
  EXPECT_EQ(counts.duplicates, arrivals.duplicates);
  EXPECT_EQ(counts.overtaken, arrivals.overtaken);
  EXPECT_EQ(counts.late + counts.strays + counts.jumps, 0U);
  EXPECT_EQ(counts.lines, pair.profiles.size());
  EXPECT_EQ(pair.session.profiles_lost(), counts.lost);
  EXPECT_EQ(counts.lines + counts.lost,
            static_cast<std::uint64_t>(pair.profiles.back().counter - pair.profiles.front().counter) + 1);
  // It was as bad as it was meant to be.
  const double lost = static_cast<double>(counts.lost) / static_cast<double>(scans);
  EXPECT_NEAR(lost, hi ? 0.10 : 0.19, 0.015);
  EXPECT_GT(counts.overtaken, scans / 30);
  EXPECT_GT(counts.duplicates, scans / 200);

  for (std::size_t i = 1; i < pair.profiles.size(); ++i)
    ASSERT_GT(pair.profiles[i].counter, pair.profiles[i - 1].counter) << "in order, none twice";
  EXPECT_TRUE(pair.failures.empty());
  pair.session.stop_measuring(pair.now);
  EXPECT_TRUE(pair.run_until(State::Idle, 1s));
}

TEST(Lps36Session, TimesStayRightWhereTelegramsAreLateOrLost) {
  Pair pair;
  pair.connect();
  ASSERT_TRUE(pair.run_until(State::Idle));
  pair.session.start_measuring(pair.now);
  pair.run_for(1s);
  pair.profiles.clear();
  pair.device.datagrams = {.lost = 0.10, .late = 0.3, .duplicated = 0.01};
  pair.run_for(20s);
  ASSERT_GT(pair.profiles.size(), 1000U);
  const Profile& first = pair.profiles.front();
  for (const Profile& profile : pair.profiles) {
    const double should_ms = 10.0 * (profile.counter - first.counter);
    EXPECT_NEAR(in_ms(profile.measured_at - first.measured_at), should_ms, 0.5);
    EXPECT_LE(profile.measured_at, profile.received_at);
  }
}

TEST(Lps36Session, LateHalvesAndARestartOfTheNumberAreCounted) {
  Pair pair;
  pair.connect();
  ASSERT_TRUE(pair.run_until(State::Idle));
  pair.session.start_measuring(pair.now);
  pair.run_for(500ms);
  pair.device.datagrams = {.late = 0.05, .late_by = 80ms};
  pair.run_for(20s);
  pair.device.datagrams = {};
  pair.run_for(500ms);
  const Pairing::Counts counts = pair.session.telegrams();
  EXPECT_GT(counts.late, 100U);
  EXPECT_GT(counts.lost, 100U);
  EXPECT_EQ(counts.duplicates, 0U);
  const std::size_t before = pair.profiles.size();
  pair.device.skip_scans(30'000);
  pair.run_for(500ms);
  EXPECT_EQ(pair.session.telegrams().jumps, 1U);
  EXPECT_EQ(pair.profiles.size(), before + 50);
  EXPECT_TRUE(pair.logged("the scan number jumped"));
  EXPECT_EQ(pair.session.profiles_lost(), counts.lost) << "a new count is no loss";
}

TEST(Lps36Session, LostCommandsAreSentAgain) {
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    SCOPED_TRACE(seed);
    std::mt19937_64 random{seed};
    Options options;
    options.field_of_view = FieldOfView{Length::mm(-100), Length::mm(100), Length::mm(200), Length::mm(500)};
    options.exposure = Exposure::Dark;
    Pair pair{options};
    pair.loses = [&](const Telegram&) { return random() % 10 == 0; };
    pair.device.datagrams.answers_lost = 0.1;
    pair.connect();
    ASSERT_TRUE(pair.run_until(State::Idle, 60s));
    EXPECT_EQ(pair.device.parameter(task::kFieldX), (std::vector<std::uint16_t>{0x10000 - 1000, 1000}));
    EXPECT_EQ(pair.device.parameter(task::kExposure), (std::vector<std::uint16_t>{2}));
    pair.session.start_measuring(pair.now);
    ASSERT_TRUE(pair.run_until([&] { return pair.profiles.size() > 20; }, 20s));
    pair.session.stop_measuring(pair.now);
    ASSERT_TRUE(pair.run_until([&] { return pair.stopped > 0; }, 20s));
  }
}

TEST(Lps36Session, ASettingTakenForAnotherIsFoundAndSetAgain) {
  // The answer to "operation mode" comes twice, late; the second is taken for the answer to "activation", which is
  // lost.
  Pair pair;
  pair.connect();
  ASSERT_TRUE(pair.run_until([&] { return pair.sent.back() == get_task_parameter(task::kOperationMode); }, 1s));
  bool is_lost = false;
  pair.loses = [&](const Telegram& telegram) {
    if (is_lost || telegram != set_task_parameter(false, task::kActivation, {0})) return false;
    is_lost = true;
    pair.session.on_frame(encode(answer(Id::Ack, Id::SetTaskParameter, {0x0141})), pair.now);
    return true;
  };
  // Somebody had set it otherwise before.
  pair.device.on_frame(encode(set_task_parameter(false, task::kActivation, {1})), pair.now);
  ASSERT_TRUE(pair.run_until(State::Idle, 5s));
  EXPECT_TRUE(is_lost);
  EXPECT_EQ(pair.device.parameter(task::kActivation), (std::vector<std::uint16_t>{0}));
}

TEST(Lps36Session, AValueThatDoesNotStayIsReported) {
  Options options;
  options.exposure = Exposure::Bright;
  Pair pair{options};
  pair.device.ignores_settings = true;
  pair.connect();
  ASSERT_TRUE(pair.run_until(State::Idle, 5s));
  EXPECT_TRUE(pair.logged("the exposure is 0x0000 after it was set to 0x0001; set it in the device's menu"));
}

TEST(Lps36Session, AValueOutOfRangeIsRefusedInWords) {
  Options options;
  options.field_of_view = FieldOfView{Length::mm(-400), Length::mm(400), Length::mm(200), Length::mm(600)};
  Pair pair{options};
  pair.connect();
  ASSERT_TRUE(pair.run_until([&] { return !pair.failures.empty(); }, 5s));
  EXPECT_EQ(pair.failures[0].why, Failed::Why::Refused);
  EXPECT_EQ(pair.failures[0].text,
            "scanner refused the setting of the field of view in X (status 0x0141); choose a value in the range that "
            "its menu allows");
}

TEST(Lps36Session, TakesOverFromAProgramThatNeverDisconnected) {
  Pair pair;
  pair.device.on_frame(encode(connect(false)), pair.now);
  pair.run_for(200ms);
  ASSERT_TRUE(pair.device.measuring());
  pair.connect();
  ASSERT_TRUE(pair.run_until(State::Idle, 1s));
  EXPECT_TRUE(pair.profiles.empty()) << "what was not asked for is thrown away";
  EXPECT_TRUE(pair.failures.empty());
}

TEST(Lps36Session, StopWhileTheStartIsNotAnsweredIsNotHeldUp) {
  Pair pair;
  pair.connect();
  ASSERT_TRUE(pair.run_until(State::Idle));
  pair.device.faults.delay = 100ms;
  pair.session.start_measuring(pair.now);
  pair.run_for(10ms);
  pair.session.stop_measuring(pair.now);
  ASSERT_TRUE(pair.run_until(State::Idle, 2s));
  EXPECT_EQ(pair.stopped, 1);
  EXPECT_TRUE(pair.failures.empty());
  EXPECT_TRUE(pair.profiles.empty());
}

TEST(Lps36Session, StartRightAfterStopFollows) {
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

TEST(Lps36Session, CommandsAtTheWrongTimeAreIgnoredAndLogged) {
  Pair pair;
  pair.session.start_measuring(pair.now);
  pair.session.stop_measuring(pair.now);
  EXPECT_FALSE(pair.session.trigger(pair.now));
  EXPECT_TRUE(pair.session.take_frames().empty());
  EXPECT_TRUE(pair.logged("not ready to measure"));
  EXPECT_TRUE(pair.logged("nothing to stop"));
}
}  // namespace
}  // namespace binpick::drivers::lps36
