#include <gtest/gtest.h>

#include "tests/emulators/scanner/lps36_device.hpp"
#include "tests/unit/lps36/pair.hpp"

/// The emulated device by itself: what a host sees that speaks to it by telegrams.
namespace binpick::drivers::lps36 {
namespace {
using namespace std::chrono_literals;

struct Host {
  emulators::Lps36 device;
  TimePoint now = TimePoint{} + 1h;

  explicit Host(const emulators::Lps36::Options& options = {}) : device{Pair::flat, options} {}

  std::vector<Telegram> wait(Duration time) {
    std::vector<Telegram> got;
    for (const TimePoint end = now + time; now < end;) {
      now = std::min(end, device.deadline() ? std::max(now, *device.deadline()) : end);
      device.on_deadline(now);
      for (const Bytes& frame : device.take_frames()) got.push_back(decode(frame).value());
    }
    return got;
  }
  /// The answer to `telegram`, which comes within 5 ms.
  std::optional<Telegram> ask(const Telegram& telegram) {
    device.on_frame(encode(telegram), now);
    for (const Telegram& got : wait(5ms))
      if (got.transaction == static_cast<std::uint16_t>(telegram.id)) return got;
    return std::nullopt;
  }
  Id answer_to(const Telegram& telegram) {
    const auto got = ask(telegram);
    return got ? got->id : Id{};
  }
};

TEST(Lps36Device, ConnectsOnceAndStreamsZThenX) {
  Host host;
  EXPECT_TRUE(host.wait(100ms).empty()) << "not before a connect";
  const auto connected = host.ask(connect(false));
  ASSERT_TRUE(connected.has_value());
  EXPECT_EQ(*connected, answer(Id::Ack, Id::Connect, {0x0110})) << "its own answer does not show the connection yet";
  const auto stream = host.wait(1s);
  ASSERT_GE(stream.size(), 198U);
  for (std::size_t i = 0; i + 1 < stream.size(); i += 2) {
    EXPECT_EQ(stream[i].id, Id::MeasuredZ);
    EXPECT_EQ(stream[i + 1].id, Id::MeasuredX);
    EXPECT_EQ(stream[i].scan, stream[i + 1].scan);
    EXPECT_EQ(stream[i].scan, i / 2);
    EXPECT_EQ(stream[i].status.bits, 0x0111);
    EXPECT_EQ(stream[i].transaction, 0);
  }
  EXPECT_EQ(stream[0].words.at(0), 4123);
  EXPECT_EQ(stream[0].words.at(3), 0) << "nothing measured";
  EXPECT_EQ(stream[1].words.at(0), 0x10000 - 1500);
  EXPECT_EQ(stream[1].words.at(3), 0);
  EXPECT_EQ(host.answer_to(connect(false)), Id::Nack);
  EXPECT_EQ(host.answer_to(command(Id::Disconnect)), Id::Ack);
  EXPECT_TRUE(host.wait(100ms).empty());
  EXPECT_EQ(host.answer_to(command(Id::Disconnect)), Id::Nack);
}

TEST(Lps36Device, ModesAreRefusedWhenItIsInThem) {
  Host host;
  EXPECT_EQ(host.answer_to(command(Id::EnterCommandMode)), Id::Nack) << "not connected";
  EXPECT_EQ(host.answer_to(connect(false)), Id::Ack);
  EXPECT_EQ(host.answer_to(command(Id::ExitCommandMode)), Id::Nack);
  EXPECT_EQ(host.answer_to(command(Id::GetTask)), Id::Nack) << "in command mode only";
  EXPECT_EQ(host.ask(command(Id::EnterCommandMode)), answer(Id::Ack, Id::EnterCommandMode, {0x0141}));
  EXPECT_TRUE(host.wait(100ms).empty()) << "no data in command mode";
  EXPECT_EQ(host.answer_to(command(Id::EnterCommandMode)), Id::Nack);
  EXPECT_EQ(host.ask(command(Id::ExitCommandMode)), answer(Id::Ack, Id::ExitCommandMode, {0x0111}));
  EXPECT_FALSE(host.wait(100ms).empty());
  host.device.in_menu = true;
  EXPECT_EQ(host.answer_to(command(Id::EnterCommandMode)), Id::Nack);
  EXPECT_TRUE(host.wait(100ms).empty());
}

TEST(Lps36Device, CommandModeKnowsItsCommands) {
  Host host;
  (void)host.ask(connect(false));
  (void)host.ask(command(Id::EnterCommandMode));
  EXPECT_EQ(host.answer_to(set_laser(true)), Id::Ack);
  EXPECT_EQ(host.answer_to(command(Id::GetZ)), Id::Nack) << "nothing measured yet";
  EXPECT_EQ(host.answer_to(command(Id::MeasureOnce)), Id::Ack);
  const auto z = host.ask(command(Id::GetZ));
  ASSERT_TRUE(z && z->id == Id::Z);
  ASSERT_EQ(z->words.size(), 376U);
  EXPECT_EQ(z->words[0], 4123);
  const auto x = host.ask(command(Id::GetX));
  ASSERT_TRUE(x && x->id == Id::X);
  EXPECT_EQ(x->words.at(375), 1500);
  EXPECT_EQ(host.answer_to(command(Id::GetZx)), Id::Nack) << "after an HI connect only";
  EXPECT_EQ(host.answer_to(set_task(15, true)), Id::Ack);
  EXPECT_EQ(host.ask(command(Id::GetTask)), answer(Id::Task, Id::GetTask, {0x0141}, {15}));
  EXPECT_EQ(host.answer_to(set_task(16, true)), Id::Nack);
  EXPECT_EQ(host.answer_to(set_user_parameter(false, user::kPause, 9)), Id::Ack);
  EXPECT_EQ(host.ask(get_user_parameter(user::kPause)), answer(Id::UserParameter, Id::GetUserParameter, {0x0141}, {9}));
  EXPECT_EQ(host.answer_to(set_user_parameter(false, user::kPause, 10)), Id::Nack);
  EXPECT_EQ(host.answer_to(get_user_parameter(1)), Id::Nack);
  EXPECT_EQ(host.answer_to(set_task_parameter(false, task::kFieldX, {0x10000 - 3001, 3000})), Id::Nack);
  EXPECT_EQ(host.answer_to(set_task_parameter(false, task::kFieldX, {3000})), Id::Nack) << "two values";
  EXPECT_EQ(host.answer_to(set_task_parameter(false, task::kOperationMode, {1})), Id::Ack);
  const auto mode = host.ask(get_task_parameter(task::kOperationMode));
  ASSERT_TRUE(mode.has_value());
  EXPECT_EQ(parameter_of(*mode).value(), (Parameter{task::kOperationMode, 1, 0, 1, 0, {1}}));
  EXPECT_EQ(host.answer_to(command(static_cast<Id>(0x0075))), Id::Nack) << "another model's command";
}

TEST(Lps36Device, TriggersAreAnsweredByDataAlone) {
  Host host;
  (void)host.ask(connect(false));
  (void)host.ask(command(Id::EnterCommandMode));
  (void)host.ask(set_task_parameter(false, task::kOperationMode, {1}));
  (void)host.ask(set_scan_number(65535));
  (void)host.ask(command(Id::ExitCommandMode));
  EXPECT_TRUE(host.wait(100ms).empty());
  for (const unsigned scan : {65535U, 0U}) {
    host.device.on_frame(encode(command(Id::Trigger)), host.now);
    host.device.on_frame(encode(command(Id::Trigger)), host.now);  // too soon
    const auto got = host.wait(50ms);
    ASSERT_EQ(got.size(), 2U);
    EXPECT_EQ(got[0].scan, scan);
    EXPECT_EQ(got[0].status.bits, 0x0511);
  }
  EXPECT_EQ(host.device.triggers_ignored(), 2U);
}

TEST(Lps36Device, ActivationSwitchesTheDataOffAndOn) {
  Host host;
  (void)host.ask(connect(false));
  (void)host.ask(command(Id::EnterCommandMode));
  (void)host.ask(set_task_parameter(false, task::kActivation, {1}));
  (void)host.ask(command(Id::ExitCommandMode));
  EXPECT_FALSE(host.wait(50ms).empty());
  EXPECT_EQ(host.ask(activate(false)), std::nullopt) << "not acknowledged";
  EXPECT_TRUE(host.wait(50ms).empty());
  EXPECT_EQ(host.ask(activate(true)), std::nullopt);
  EXPECT_FALSE(host.wait(50ms).empty());
}

TEST(Lps36Device, EncoderCountsFromWhereItIsSet) {
  emulators::Lps36::Options options;
  options.encoder_per_s = 1000;
  Host host{options};
  (void)host.ask(connect(false));
  (void)host.ask(command(Id::EnterCommandMode));
  EXPECT_EQ(host.answer_to(set_encoder(0x0001FFF0)), Id::Ack);
  (void)host.ask(command(Id::ExitCommandMode));
  const auto got = host.wait(100ms);
  ASSERT_GE(got.size(), 10U);
  EXPECT_EQ(got[0].encoder, got[1].encoder);
  EXPECT_GE(got[0].encoder, 0x0001FFF0U);
  EXPECT_NEAR(got[2].encoder - got[0].encoder, 10, 1);
  EXPECT_GT(got.back().encoder, 0x00020000U) << "carried into the high word";
}

TEST(Lps36Device, WhatIsNoTelegramIsDroppedWithoutAWord) {
  Host host;
  host.device.on_frame({}, host.now);
  host.device.on_frame(Bytes(30), host.now);
  EXPECT_TRUE(host.wait(100ms).empty());
  EXPECT_EQ(host.device.commands_dropped(), 2U);
}
}  // namespace
}  // namespace binpick::drivers::lps36
