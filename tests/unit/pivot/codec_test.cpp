#include "drivers/pivot/codec.hpp"

#include <cmath>
#include <gtest/gtest.h>
#include <numbers>
#include <string>
#include <vector>

#include "drivers/pivot/state_word.hpp"
#include "tests/unit/pivot/frame_text.hpp"

/// Byte tables worked out by hand from the public command list (schunk_libm5api, ProtocolCommands.h) for module 12, not
/// made by our encoder.
namespace binpick::drivers::pivot {
namespace {
constexpr std::uint8_t kId = 12;

constexpr float kHalfPi = static_cast<float>(std::numbers::pi / 2);

struct RequestRow {
  const char* name;
  const char* bytes;
  Request request;
};
const std::vector<RequestRow> kRequests{
    {"read position", "0CC [2] 0A 3C", Get{Parameter::Position}},
    {"read position, state, inputs", "0CC [2] 0A 62", Get{Parameter::PositionAndState}},
    {"read state", "0CC [2] 0A 27", Get{Parameter::StateWord}},
    {"read firmware version", "0CC [2] 0A 1D", Get{Parameter::Firmware}},
    {"read serial number", "0CC [2] 0A 1A", Get{Parameter::SerialNumber}},
    {"set ramp velocity 0.2 rad/s", "0EC [6] 08 4F CD CC 4C 3E", Set{Parameter::RampVelocity, 0.2F}},
    {"set ramp acceleration 1 rad/s2", "0EC [6] 08 50 00 00 80 3F", Set{Parameter::RampAcceleration, 1.0F}},
    {"ramp to pi/2 less the last bit", "0EC [6] 0B 04 DA 0F C9 3F",
     Move{Motion::Ramp, std::nextafter(kHalfPi, 0.0F), 0}},
    {"the same, extended reply", "0EC [6] 0B 0E DA 0F C9 3F",
     Move{Motion::RampExtended, std::nextafter(kHalfPi, 0.0F), 0}},
    {"step to 0.5 rad in 500 ms", "0EC [8] 0B 06 00 00 00 3F F4 01", Move{Motion::Step, 0.5F, 500}},
    {"velocity -1 rad/s", "0EC [6] 0B 07 00 00 80 BF", Move{Motion::Velocity, -1.0F, 0}},
    {"current 1 A", "0EC [6] 0B 08 00 00 80 3F", Move{Motion::Current, 1.0F, 0}},
    {"halt", "0EC [1] 02", Plain{Command::Halt}},
    {"reset", "0EC [1] 00", Plain{Command::Reset}},
    {"home", "0EC [1] 01", Plain{Command::Home}},
    {"watchdog refresh, all", "100 [2] 07 00", Broadcast{Command::Watchdog}},
    {"start motion, all", "100 [2] 0F 00", Broadcast{Command::StartMotion}},
};

struct ReplyRow {
  const char* name;
  const char* bytes;
  Reply reply;
};
const std::vector<ReplyRow> kReplies{
    {"0.5 rad", "0AC [6] 0A 3C 00 00 00 3F", Value{Parameter::Position, 0.5F}},
    {"0.5 rad, ramp finished, inputs 00", "0AC [8] 0A 62 00 00 00 3F 20 00",
     Value{Parameter::PositionAndState, PositionReport{0.5F, short_state::kRampEnd, 0}}},
    {"referenced, ramp finished", "0AC [6] 0A 27 02 80 00 00",
     Value{Parameter::StateWord, state::kHomeOk | state::kRampEnd}},
    {"error, tow", "0AC [6] 0A 27 11 00 00 00", Value{Parameter::StateWord, state::kError | state::kTow}},
    {"firmware 3518", "0AC [4] 0A 1D 18 35", Value{Parameter::Firmware, std::uint16_t{0x3518}}},
    {"serial number 12345678", "0AC [6] 0A 1A 4E 61 BC 00", Value{Parameter::SerialNumber, std::uint32_t{12345678}}},
    {"ramp, extended: 0.5 rad, moving", "0AC [8] 0B 0E 00 00 00 3F 10 00",
     MoveAccepted{Motion::RampExtended, PositionReport{0.5F, short_state::kMotion, 0}}},
    {"step accepted", "0AC [2] 0B 06", MoveAccepted{Motion::Step, std::nullopt}},
    {"ramp velocity set", "0AC [2] 08 4F", SetDone{Parameter::RampVelocity}},
    {"halted", "0AC [1] 02", PlainDone{Command::Halt}},
    {"reset done", "0AC [1] 00", PlainDone{Command::Reset}},
    {"going home", "0AC [1] 01", PlainDone{Command::Home}},
};

TEST(PivotCodec, RequestsBothWays) {
  for (const RequestRow& row : kRequests) {
    EXPECT_EQ(text_of(encode(kId, row.request)), row.bytes) << row.name;
    const auto request = decode_request(kId, frame(row.bytes));
    ASSERT_TRUE(request) << row.name << ": " << to_string(request.error());
    EXPECT_EQ(*request, row.request) << row.name;
  }
}

TEST(PivotCodec, RepliesBothWays) {
  for (const ReplyRow& row : kReplies) {
    EXPECT_EQ(text_of(encode(kId, row.reply)), row.bytes) << row.name;
    const auto reply = decode_reply(kId, frame(row.bytes));
    ASSERT_TRUE(reply) << row.name << ": " << to_string(reply.error());
    EXPECT_EQ(*reply, row.reply) << row.name;
  }
}

TEST(PivotCodec, EchoesMayBeLongerThanTheirFirstBytes) {
  // What follows in an echo differs between firmwares; public drivers look at the first bytes alone.
  EXPECT_EQ(*decode_reply(kId, frame("0AC [3] 08 4F 64")), Reply{SetDone{Parameter::RampVelocity}});
  EXPECT_EQ(*decode_reply(kId, frame("0AC [2] 02 64")), Reply{PlainDone{Command::Halt}});
  EXPECT_EQ(*decode_reply(kId, frame("0AC [8] 0B 06 00 00 00 3F F4 01")),
            (Reply{MoveAccepted{Motion::Step, std::nullopt}}));
}

TEST(PivotCodec, UnsolicitedStateIsTakenAsAHint) {
  EXPECT_EQ(*decode_reply(kId, frame("06C [0]")), Reply{StateNews{}});
  EXPECT_EQ(*decode_reply(kId, frame("06C [4] 11 00 00 00")), Reply{StateNews{}});
}

TEST(PivotCodec, FramesOfOthersAreNotOurs) {
  using Kind = DecodeError::Kind;
  EXPECT_EQ(decode_reply(kId, frame("0AD [6] 0A 3C 00 00 00 3F")).error().kind, Kind::NotOurs);
  EXPECT_EQ(decode_reply(kId, frame("0CC [2] 0A 3C")).error().kind, Kind::NotOurs);
  EXPECT_EQ(decode_request(kId, frame("0CD [2] 0A 3C")).error().kind, Kind::NotOurs);
  for (bool CanFrame::*flag : {&CanFrame::extended, &CanFrame::rtr, &CanFrame::error}) {
    CanFrame f = frame("0AC [6] 0A 3C 00 00 00 3F");
    f.*flag = true;
    EXPECT_EQ(decode_reply(kId, f).error().kind, Kind::NotOurs);
  }
}

TEST(PivotCodec, EveryWrongLengthIsAnErrorOrTheSameValue) {
  for (const ReplyRow& row : kReplies) {
    for (std::uint8_t length = 0; length <= 8; ++length) {
      CanFrame f = frame(row.bytes);
      if (length == f.length) continue;
      f.length = length;
      const auto reply = decode_reply(kId, f);
      const bool carries_value =
          std::holds_alternative<Value>(row.reply) ||
          (std::holds_alternative<MoveAccepted>(row.reply) && std::get<MoveAccepted>(row.reply).report.has_value());
      if (carries_value || length == 0) {
        EXPECT_FALSE(reply) << row.name << " as " << int{length} << " bytes";
      } else if (reply) {
        EXPECT_EQ(*reply, row.reply) << row.name;
      }
    }
  }
  for (const RequestRow& row : kRequests) {
    for (std::uint8_t length = 0; length <= 9; ++length) {
      CanFrame f = frame(row.bytes);
      if (length == f.length || (f.id == kBroadcastId && length > 0)) continue;
      f.length = length;
      EXPECT_FALSE(decode_request(kId, f)) << row.name << " as " << int{length} << " bytes";
    }
  }
}

TEST(PivotCodec, EveryCorruptedByteIsAnErrorOrAValueInRange) {
  for (const ReplyRow& row : kReplies) {
    const CanFrame good = frame(row.bytes);
    for (std::size_t at = 0; at < good.length; ++at)
      for (int value = 0; value < 256; ++value) {
        CanFrame f = good;
        f.payload[at] = static_cast<std::uint8_t>(value);
        const auto reply = decode_reply(kId, f);
        if (!reply) continue;
        if (const auto* v = std::get_if<Value>(&*reply)) {
          const auto* number = std::get_if<float>(&v->value);
          const auto* report = std::get_if<PositionReport>(&v->value);
          EXPECT_TRUE(number == nullptr || std::isfinite(*number));
          EXPECT_TRUE(report == nullptr || std::isfinite(report->position_rad));
        }
      }
  }
}

TEST(PivotCodec, NumbersThatAreNoneAreRefused) {
  using Kind = DecodeError::Kind;
  EXPECT_EQ(decode_reply(kId, frame("0AC [6] 0A 3C 00 00 C0 7F")).error().kind, Kind::BadValue);        // NaN
  EXPECT_EQ(decode_reply(kId, frame("0AC [8] 0A 62 00 00 80 7F 20 00")).error().kind, Kind::BadValue);  // infinity
  EXPECT_EQ(decode_request(kId, frame("0EC [8] 0B 06 00 00 C0 7F F4 01")).error().kind, Kind::BadValue);
  EXPECT_EQ(decode_request(kId, frame("0EC [6] 08 4F 00 00 80 FF")).error().kind, Kind::BadValue);
}

TEST(PivotCodec, AnswersMatchTheirRequest) {
  EXPECT_TRUE(answers(Get{Parameter::Position}, Value{Parameter::Position, 0.5F}));
  EXPECT_FALSE(answers(Get{Parameter::Position}, Value{Parameter::Velocity, 0.5F}));
  EXPECT_TRUE(answers(Move{Motion::Step, 1, 1}, MoveAccepted{Motion::Step, std::nullopt}));
  EXPECT_FALSE(answers(Move{Motion::Step, 1, 1}, MoveAccepted{Motion::Ramp, std::nullopt}));
  EXPECT_FALSE(answers(Plain{Command::Reset}, PlainDone{Command::Halt}));
  EXPECT_FALSE(answers(Broadcast{Command::Watchdog}, PlainDone{Command::Halt}));
}

TEST(PivotCodec, Parameter62NeedsItsFirmware) {
  for (const int version : {0x0000, 0x2517, 0x3500, 0x3517})
    EXPECT_FALSE(has_position_and_state(static_cast<std::uint16_t>(version)));
  for (const int version : {0x2518, 0x2600, 0x34FF, 0x3518, 0x4000})
    EXPECT_TRUE(has_position_and_state(static_cast<std::uint16_t>(version)));
}

TEST(PivotStateWord, InWords) {
  EXPECT_EQ(faults_in_words(state::kHomeOk | state::kRampEnd), "");
  EXPECT_EQ(faults_in_words(0x00040009),  // error, power fault, motor voltage: what an emergency stop looks like
            "motor supply gone: emergency stop open? (close it; the pivot resets itself)");
  EXPECT_NE(faults_in_words(0x00000011).find("following error"), std::string::npos);
  EXPECT_NE(faults_in_words(0x00080001).find("switch the module off and on"), std::string::npos);
  EXPECT_NE(faults_in_words(0x00800001).find("switch the module off and on"), std::string::npos);
  EXPECT_NE(faults_in_words(0x00000001).find("does not name"), std::string::npos);
  EXPECT_EQ(state_in_words(0x00008002), "referenced, ramp finished");
  EXPECT_EQ(state_in_words(0), "not referenced, standing");
  EXPECT_EQ(short_state_in_words(0x30), "moving, ramp finished");
}

TEST(PivotStateWord, EveryDefinedBitHasAName) {
  for (int bit = 1; bit <= 27; ++bit) {
    const std::uint32_t word = 1U << bit;
    EXPECT_NE(state_in_words(word), state_in_words(0)) << bit;
    EXPECT_EQ((word & (state::kFaults | state::kSoftLimit | state::kHalt)) == 0, faults_in_words(word).empty()) << bit;
  }
}

TEST(PivotStateWord, ShortStateFollows) {
  EXPECT_EQ(to_short_state(0x00008002), 0x20);
  EXPECT_EQ(to_short_state(0x00030801), 0xD1);  // error, motion, in progress, buffer full
}
}  // namespace
}  // namespace binpick::drivers::pivot
