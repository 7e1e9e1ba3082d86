#include "drivers/pivot/motion_codec.hpp"

#include <cmath>
#include <gtest/gtest.h>
#include <numbers>
#include <string>
#include <vector>

#include "drivers/pivot/motion_errors.hpp"
#include "drivers/pivot/state_word.hpp"
#include "tests/unit/pivot/frame_text.hpp"

/// Byte tables for module 12, worked out by hand from the layouts of the Schunk Motion Protocol manual 1.41 (docu314,
/// 315: frames, replies; docu92, 112, 113: GET STATE) and not made by our encoder. The two lines of module 1 are
/// printed in that manual. Fragments: as the scripts of ipa320/schunk_gripper_egl90 send them. GET CONFIG with its
/// sub-id in the reply: Pejman712/CRF (SchunkDevice.cpp). The block with the module's type and the longer date of a PR
/// 70: spatialaudio/schunk (schunk.py). "OK" in place of a report: Pejman712/CRF.
namespace binpick::drivers::pivot::motion {
namespace {
using Rows = std::vector<const char*>;
constexpr double kDeg = std::numbers::pi / 180;

struct RequestRow {
  const char* name;
  UnitSystem units;
  Rows frames;
  Request request;
};
const std::vector<RequestRow> kRequests{
    {"state once", UnitSystem::Degree, {"50C [2] 01 95"}, GetState{}},
    {"state every 10 ms, all values",
     UnitSystem::Degree,
     {"50C [7] 06 95 0A D7 23 3C 07"},
     GetState{GetState::Cyclic{double{0.01F}, 7}}},
    {"no more states", UnitSystem::Degree, {"50C [7] 06 95 00 00 00 00 07"}, GetState{GetState::Cyclic{0, 7}}},
    {"state every 40 ms, whole numbers, position and velocity",
     UnitSystem::Millidegree,
     {"50C [7] 06 95 28 00 00 00 03"},
     GetState{GetState::Cyclic{0.04, 3}}},
    {"go to 10 degrees",
     UnitSystem::Degree,
     {"50C [6] 05 B0 00 00 20 41"},
     MovePosition{10 * kDeg, std::nullopt, std::nullopt}},
    {"go to 90 degrees, whole numbers",
     UnitSystem::Millidegree,
     {"50C [6] 05 B0 90 5F 01 00"},
     MovePosition{90 * kDeg, std::nullopt, std::nullopt}},
    {"go to 90 degrees at 30 deg/s",
     UnitSystem::Degree,
     {"50C [8] 09 84 B0 00 00 B4 42 00", "50C [5] 03 86 00 F0 41"},
     MovePosition{90 * kDeg, 30 * kDeg, std::nullopt}},
    {"go to 90 degrees at 30 deg/s with 45 deg/s2",
     UnitSystem::Degree,
     {"50C [8] 0D 84 B0 00 00 B4 42 00", "50C [8] 07 85 00 F0 41 00 00 34", "50C [3] 01 86 42"},
     MovePosition{90 * kDeg, 30 * kDeg, 45 * kDeg}},
    {"target velocity 30 deg/s",
     UnitSystem::Degree,
     {"50C [6] 05 A0 00 00 F0 41"},
     SetTarget{Command::SetTargetVelocity, 30 * kDeg}},
    {"target acceleration 45 deg/s2",
     UnitSystem::Degree,
     {"50C [6] 05 A1 00 00 34 42"},
     SetTarget{Command::SetTargetAcceleration, 45 * kDeg}},
    {"stop", UnitSystem::Degree, {"50C [2] 01 91"}, Plain{Command::Stop}},
    {"fast stop", UnitSystem::Degree, {"50C [2] 01 90"}, Plain{Command::FastStop}},
    {"reference", UnitSystem::Degree, {"50C [2] 01 92"}, Plain{Command::Reference}},
    {"acknowledge", UnitSystem::Degree, {"50C [2] 01 8B"}, Plain{Command::Acknowledge}},
    {"reboot", UnitSystem::Degree, {"50C [2] 01 E0"}, Plain{Command::Reboot}},
    {"impulse messages on or off", UnitSystem::Degree, {"50C [2] 01 E7"}, Plain{Command::ToggleImpulses}},
    {"unit system", UnitSystem::Degree, {"50C [3] 02 80 06"}, GetConfig{ConfigItem::UnitSystem}},
    {"upper soft limit", UnitSystem::Degree, {"50C [3] 02 80 07"}, GetConfig{ConfigItem::PositionMax}},
    {"type", UnitSystem::Degree, {"50C [2] 01 80"}, GetConfig{}},
};

struct ReplyRow {
  const char* name;
  UnitSystem units;
  Rows frames;
  Reply reply;
};
StateReport report(std::optional<double> position, std::optional<double> velocity, std::optional<float> current,
                   std::uint8_t state, std::uint8_t error) {
  StateReport r;
  r.position_rad = position;
  r.velocity_rad_s = velocity;
  r.current_a = current;
  r.state = state;
  r.error = error;
  return r;
}
const std::vector<ReplyRow> kReplies{
    {"12.5 degrees, referenced, moving",
     UnitSystem::Degree,
     {"70C [8] 07 95 00 00 48 41 03 00"},
     report(12.5 * kDeg, {}, {}, 0x03, 0)},
    {"the same with 30 deg/s",
     UnitSystem::Degree,
     {"70C [8] 0B 84 95 00 00 48 41 00", "70C [7] 05 86 00 F0 41 03 00"},
     report(12.5 * kDeg, 30 * kDeg, {}, 0x03, 0)},
    {"the same with 0.5 A",
     UnitSystem::Degree,
     {"70C [8] 0F 84 95 00 00 48 41 00", "70C [8] 09 85 00 F0 41 00 00 00", "70C [5] 03 86 3F 03 00"},
     report(12.5 * kDeg, 30 * kDeg, 0.5F, 0x03, 0)},
    {"12.5 degrees as millidegrees",
     UnitSystem::Millidegree,
     {"70C [8] 07 95 D4 30 00 00 01 00"},
     report(12.5 * kDeg, {}, {}, 0x01, 0)},
    {"-0.5 rad, motor supply low",
     UnitSystem::Radian,
     {"70C [8] 07 95 00 00 00 BF 11 74"},
     report(-0.5, {}, {}, 0x11, 0x74)},
    {"no report yet", UnitSystem::Degree, {"70C [4] 03 95 4F 4B"}, Done{Command::GetState}},
    {"on its way for 8.3 s", UnitSystem::Degree, {"70C [6] 05 B0 CD CC 04 41"}, MoveTime{8.3F}},
    {"on its way", UnitSystem::Degree, {"70C [4] 03 B0 4F 4B"}, Done{Command::MovePosition}},
    {"not referenced", UnitSystem::Degree, {"70C [3] 02 B0 06"}, Refused{0xB0, 0x06}},
    {"velocity taken", UnitSystem::Degree, {"70C [4] 03 A0 4F 4B"}, Done{Command::SetTargetVelocity}},
    {"stopped", UnitSystem::Degree, {"70C [4] 03 91 4F 4B"}, Done{Command::Stop}},
    {"reference run begun", UnitSystem::Degree, {"70C [4] 03 92 4F 4B"}, Done{Command::Reference}},
    {"acknowledged", UnitSystem::Degree, {"70C [4] 03 8B 4F 4B"}, Done{Command::Acknowledge}},
    {"no error is left", UnitSystem::Degree, {"70C [4] 03 8A 08 00"}, Info{0x08}},
    {"started", UnitSystem::Degree, {"70C [4] 03 8A 01 00"}, Info{0x01}},
    {"position 10 reached",
     UnitSystem::Degree,
     {"70C [6] 05 94 00 00 20 41"},
     Impulse{Command::PositionReached, 10 * kDeg}},
    {"blocked at 12.5", UnitSystem::Degree, {"70C [6] 05 93 00 00 48 41"}, Impulse{Command::MoveBlocked, 12.5 * kDeg}},
    {"error, motor supply low", UnitSystem::Degree, {"30C [3] 02 88 74"}, Trouble{Command::Error, 0x74}},
    {"warning, too hot", UnitSystem::Degree, {"30C [3] 02 89 71"}, Trouble{Command::Warning, 0x71}},
    {"counts in degrees",
     UnitSystem::Degree,
     {"70C [4] 03 80 06 04"},
     ConfigValue{ConfigItem::UnitSystem, std::uint32_t{4}}},
    {"soft limit at 160 degrees",
     UnitSystem::Degree,
     {"70C [7] 06 80 07 00 00 20 43"},
     ConfigValue{ConfigItem::PositionMax, 160 * kDeg}},
    {"serial number 12345678",
     UnitSystem::Degree,
     {"70C [7] 06 80 15 4E 61 BC 00"},
     ConfigValue{ConfigItem::SerialNumber, std::uint32_t{12345678}}},
    //  D-Len 2D = 45: command, 8 type, 4 order number, 3 × 2 versions, 26 date
    {"type PR-70, order 307330, firmware 0x0150, protocol 0x0129, hardware 1",
     UnitSystem::Degree,
     {"70C [8] 2D 84 80 50 52 2D 37 30", "70C [8] 27 85 00 00 00 82 B0 04", "70C [8] 21 85 00 50 01 29 01 01",
      "70C [8] 1B 85 00 4D 61 79 20 32", "70C [8] 15 85 31 20 32 30 31 32", "70C [8] 0F 85 20 31 30 3A 31 31",
      "70C [8] 09 85 3A 31 32 00 00 00", "70C [5] 03 86 00 00 00"},
     ModuleType{"PR-70", 307330, 0x0150, 0x0129, 1, "May 21 2012 10:11:12"}},
};

std::vector<CanFrame> frames(const Rows& rows) {
  std::vector<CanFrame> all;
  for (const char* row : rows) all.push_back(frame(row));
  return all;
}

std::optional<Message> assembled(const std::vector<CanFrame>& all) {
  Assembler assembler;
  std::optional<Message> message;
  for (const CanFrame& f : all) {
    EXPECT_FALSE(message) << "before the last frame";
    auto taken = assembler.take(f);
    if (!taken) return std::nullopt;
    message = *taken;
  }
  return message;
}

/// Angles pass through 32-bit floats in degrees.
void expect_near(double a, double b) { EXPECT_NEAR(a, b, 2e-7 * std::max(1.0, std::abs(b))); }

void expect_same(const Reply& got, const Reply& want, const char* name) {
  ASSERT_EQ(got.index(), want.index()) << name;
  if (const auto* a = std::get_if<StateReport>(&got)) {
    const auto& b = std::get<StateReport>(want);
    EXPECT_EQ(a->position_rad.has_value(), b.position_rad.has_value()) << name;
    EXPECT_EQ(a->velocity_rad_s.has_value(), b.velocity_rad_s.has_value()) << name;
    expect_near(a->position_rad.value_or(0), b.position_rad.value_or(0));
    expect_near(a->velocity_rad_s.value_or(0), b.velocity_rad_s.value_or(0));
    EXPECT_EQ(a->current_a, b.current_a) << name;
    EXPECT_EQ(a->state, b.state) << name;
    EXPECT_EQ(a->error, b.error) << name;
  } else if (const auto* impulse = std::get_if<Impulse>(&got)) {
    EXPECT_EQ(impulse->kind, std::get<Impulse>(want).kind);
    expect_near(impulse->position_rad, std::get<Impulse>(want).position_rad);
  } else if (const auto* config = std::get_if<ConfigValue>(&got);
             config != nullptr && std::holds_alternative<double>(config->value)) {
    EXPECT_EQ(config->item, std::get<ConfigValue>(want).item);
    expect_near(std::get<double>(config->value), std::get<double>(std::get<ConfigValue>(want).value));
  } else {
    EXPECT_EQ(got, want) << name;
  }
}

void expect_same(const Request& got, const Request& want, const char* name) {
  ASSERT_EQ(got.index(), want.index()) << name;
  if (const auto* move = std::get_if<MovePosition>(&got)) {
    const auto& b = std::get<MovePosition>(want);
    expect_near(move->position_rad, b.position_rad);
    EXPECT_EQ(move->velocity_rad_s.has_value(), b.velocity_rad_s.has_value()) << name;
    EXPECT_EQ(move->acceleration_rad_s2.has_value(), b.acceleration_rad_s2.has_value()) << name;
    expect_near(move->velocity_rad_s.value_or(0), b.velocity_rad_s.value_or(0));
    expect_near(move->acceleration_rad_s2.value_or(0), b.acceleration_rad_s2.value_or(0));
  } else if (const auto* set = std::get_if<SetTarget>(&got)) {
    EXPECT_EQ(set->command, std::get<SetTarget>(want).command);
    expect_near(set->value, std::get<SetTarget>(want).value);
  } else {
    EXPECT_EQ(got, want) << name;
  }
}

bool is_finite(const Reply& reply) {
  if (const auto* r = std::get_if<StateReport>(&reply))
    return std::isfinite(r->position_rad.value_or(0)) && std::isfinite(r->velocity_rad_s.value_or(0)) &&
           std::isfinite(r->current_a.value_or(0));
  if (const auto* i = std::get_if<Impulse>(&reply)) return std::isfinite(i->position_rad);
  if (const auto* c = std::get_if<ConfigValue>(&reply)) {
    if (const auto* number = std::get_if<double>(&c->value)) return std::isfinite(*number);
    if (c->item == ConfigItem::UnitSystem) return std::get<std::uint32_t>(c->value) <= kUnitSystemMax;
  }
  return true;
}

TEST(MotionCodec, RequestsBothWays) {
  for (const RequestRow& row : kRequests) {
    const auto encoded = frames_of(kCommandBase + 12, encode(row.request, row.units));
    ASSERT_EQ(encoded.size(), row.frames.size()) << row.name;
    for (std::size_t i = 0; i < encoded.size(); ++i) EXPECT_EQ(text_of(encoded[i]), row.frames[i]) << row.name;
    const auto message = assembled(frames(row.frames));
    ASSERT_TRUE(message) << row.name;
    const auto request = decode_request(*message, row.units);
    ASSERT_TRUE(request) << row.name << ": " << to_string(request.error());
    expect_same(*request, row.request, row.name);
  }
}

TEST(MotionCodec, RepliesBothWays) {
  for (const ReplyRow& row : kReplies) {
    const std::uint32_t base = std::holds_alternative<Trouble>(row.reply) ? kErrorBase : kReplyBase;
    const auto encoded = frames_of(base + 12, encode(row.reply, row.units));
    ASSERT_EQ(encoded.size(), row.frames.size()) << row.name;
    for (std::size_t i = 0; i < encoded.size(); ++i) EXPECT_EQ(text_of(encoded[i]), row.frames[i]) << row.name;
    const auto message = assembled(frames(row.frames));
    ASSERT_TRUE(message) << row.name;
    const auto reply = decode_reply(*message, row.units);
    ASSERT_TRUE(reply) << row.name << ": " << to_string(reply.error());
    expect_same(*reply, row.reply, row.name);
  }
}

TEST(MotionCodec, AsPrintedInTheManual) {
  // get state every 1.0 s, position alone; its reply: about 1.01, moving; error: motor supply low. Module 1.
  const auto asked = decode_request(*assembled({frame("501 [7] 06 95 00 00 80 3F 01")}), UnitSystem::Degree);
  EXPECT_EQ(*asked, (Request{GetState{GetState::Cyclic{1.0, report_mode::kPosition}}}));
  const auto said = decode_reply(*assembled({frame("701 [8] 07 95 36 89 81 3F 02 00")}), UnitSystem::Radian);
  EXPECT_NEAR(*std::get<StateReport>(*said).position_rad, 1.012, 0.001);
  EXPECT_EQ(std::get<StateReport>(*said).state, state_byte::kMoving);
  EXPECT_EQ(*decode_reply(*assembled({frame("301 [3] 02 88 74")}), UnitSystem::Degree),
            (Reply{Trouble{Command::Error, 0x74}}));
}

TEST(MotionCodec, FurtherValuesOfAMoveMayFollow) {
  // 90 degrees at 30 deg/s with 45 deg/s2 and 1.5 A: three frames, the last value is not ours to know
  const auto message = assembled({frame("50C [8] 11 84 B0 00 00 B4 42 00"), frame("50C [8] 0B 85 00 F0 41 00 00 34"),
                                  frame("50C [7] 05 86 42 00 00 C0 3F")});
  ASSERT_TRUE(message);
  const auto move = decode_request(*message, UnitSystem::Degree);
  ASSERT_TRUE(move);
  expect_near(*std::get<MovePosition>(*move).acceleration_rad_s2, 45 * kDeg);
}

TEST(MotionCodec, EveryPrefixOfAFrameIsAnErrorOrANumberInRange) {
  for (const ReplyRow& row : kReplies)
    for (std::size_t cut = 0; cut < row.frames.size(); ++cut)
      for (std::uint8_t length = 0; length <= 9; ++length) {
        auto all = frames(row.frames);
        if (all[cut].length == length) continue;
        all[cut].length = length;
        EXPECT_FALSE(assembled(all)) << row.name << ", frame " << cut << " as " << int{length} << " bytes";
      }
}

TEST(MotionCodec, EveryMessageOfAnyLengthIsAnErrorOrANumberInRange) {
  for (const UnitSystem units : {UnitSystem::Degree, UnitSystem::Millidegree})
    for (int command = 0; command < 256; ++command)
      for (std::size_t length = 0; length <= 60; ++length)
        for (const int fill : {0x00, 0x4F, 0x7F, 0xFF}) {
          const Message message{static_cast<std::uint8_t>(command), Bytes(length, static_cast<std::byte>(fill))};
          if (const auto reply = decode_reply(message, units)) {
            EXPECT_TRUE(is_finite(*reply)) << command << ", " << length;
          }
          static_cast<void>(decode_request(message, units));
        }
}

TEST(MotionCodec, EveryCorruptedByteIsAnErrorOrANumberInRange) {
  for (const ReplyRow& row : kReplies)
    for (std::size_t which = 0; which < row.frames.size(); ++which)
      for (std::size_t at = 0; at < frame(row.frames[which]).length; ++at)
        for (int value = 0; value < 256; ++value) {
          auto all = frames(row.frames);
          all[which].payload[at] = static_cast<std::uint8_t>(value);
          Assembler assembler;
          for (const CanFrame& f : all) {
            const auto message = assembler.take(f);
            if (!message || !*message) continue;
            const auto reply = decode_reply(**message, row.units);
            if (reply) {
              EXPECT_TRUE(is_finite(*reply)) << row.name;
            }
          }
          // Whatever came, the next whole message is read as it is.
          EXPECT_EQ(**assembler.take(frame("70C [2] 01 95")), (Message{0x95, {}}));
        }
  for (const RequestRow& row : kRequests)
    for (std::size_t at = 0; at < frame(row.frames.front()).length; ++at)
      for (int value = 0; value < 256; ++value) {
        CanFrame f = frame(row.frames.front());
        f.payload[at] = static_cast<std::uint8_t>(value);
        Assembler assembler;
        if (const auto message = assembler.take(f); message && *message)
          static_cast<void>(decode_request(**message, row.units));
      }
}

TEST(MotionFragments, EveryOneLostTwiceOrOutOfPlaceIsNoticed) {
  for (const ReplyRow& row : kReplies) {
    if (row.frames.size() < 2) continue;
    const auto all = frames(row.frames);
    for (std::size_t which = 0; which < all.size(); ++which) {
      auto lost = all;
      lost.erase(lost.begin() + static_cast<std::ptrdiff_t>(which));
      EXPECT_FALSE(assembled(lost)) << row.name << " without frame " << which;
      auto twice = all;
      twice.insert(twice.begin() + static_cast<std::ptrdiff_t>(which), all[which]);
      Assembler assembler;
      int whole = 0, errors = 0;
      for (const CanFrame& f : twice) {
        const auto taken = assembler.take(f);
        errors += taken ? 0 : 1;
        whole += taken && *taken ? 1 : 0;
      }
      // A start that comes twice begins anew; any other frame twice is out of order.
      EXPECT_EQ(whole, which == 0 || which + 1 == all.size() ? 1 : 0) << row.name << ", frame " << which;
      EXPECT_EQ(errors > 0, which != 0) << row.name << ", frame " << which;
    }
  }
}

TEST(MotionFragments, AWholeMessageInBetweenDoesNotDisturb) {
  Assembler assembler;
  EXPECT_FALSE(assembler.take(frame("70C [8] 0B 84 95 00 00 48 41 00"))->has_value());
  EXPECT_EQ(**assembler.take(frame("70C [6] 05 94 00 00 20 41")),
            (Message{0x94, assembled({frame("70C [6] 05 94 00 00 20 41")})->parameters}));
  const auto message = assembler.take(frame("70C [7] 05 86 00 F0 41 03 00"));
  ASSERT_TRUE(message && *message);
  EXPECT_TRUE(decode_reply(**message, UnitSystem::Degree));
}

TEST(MotionFragments, EveryLengthGoesThroughFrames) {
  for (std::size_t length = 0; length <= 254; ++length) {
    Message message{0x80, {}};
    for (std::size_t i = 0; i < length; ++i) message.parameters.push_back(static_cast<std::byte>(i * 7));
    EXPECT_EQ(assembled(frames_of(0x70C, message)), message) << length;
  }
}

TEST(MotionErrors, BecomeTheSharedStateWord) {
  EXPECT_EQ(state_word(0x01, 0), state::kHomeOk | state::kRampEnd);
  EXPECT_EQ(state_word(0x03, 0), state::kHomeOk | state::kMotion);
  EXPECT_EQ(state_word(0x11, 0x74) & state::kMotorSupply, state::kMotorSupply);
  EXPECT_EQ(state_word(0x11, 0xDA) & state::kFaults, state::kError | state::kTow);
  EXPECT_EQ(state_word(0x11, 0xD9), state::kHomeOk | state::kRampEnd | state::kHalt) << "a stop is no fault";
  EXPECT_EQ(state_word(0x11, 0x00) & state::kFaults, state::kError);
  EXPECT_EQ(state_word(0x09, 0x71), state::kHomeOk | state::kRampEnd) << "a warning's code";
}

TEST(MotionErrors, EveryCodeHasWordsAndFaultsTheirCode) {
  for (int code = 1; code < 256; ++code) {
    const auto byte = static_cast<std::uint8_t>(code);
    EXPECT_FALSE(error_in_words(byte).empty());
    EXPECT_FALSE(info_in_words(byte).empty());
    if (byte != kFastStopped) {
      EXPECT_NE(error_bits(byte) & state::kFaults, 0U) << code;
    }
  }
  EXPECT_EQ(error_in_words(0x74), "motor supply gone: emergency stop open? (close it; the pivot resets itself) [74]");
  EXPECT_EQ(info_in_words(0x06), "not referenced [06]");
  EXPECT_EQ(error_code(state::kTow | state::kError), 0xDA);
  EXPECT_EQ(error_code(state::kMotorVoltage), 0x74);
}
}  // namespace
}  // namespace binpick::drivers::pivot::motion
