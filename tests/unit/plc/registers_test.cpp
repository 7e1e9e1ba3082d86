#include "plc/registers.hpp"

#include <gtest/gtest.h>
#include <set>

#include "plc/alarms.hpp"
#include "plc/result_codes.hpp"
#include "tests/unit/plc/rig.hpp"

namespace binpick::plc {
using test::Rig;

TEST(Words, TheTestVectorInBothOrders) {
  using Pair = std::array<std::uint16_t, 2>;
  EXPECT_EQ(to_words(123456.0F, WordOrder::HighWordFirst), (Pair{0x47F1, 0x2000}));
  EXPECT_EQ(to_words(123456.0F, WordOrder::LowWordFirst), (Pair{0x2000, 0x47F1}));
  EXPECT_EQ(to_words(std::uint32_t{0x01020304}, WordOrder::HighWordFirst), (Pair{0x0102, 0x0304}));
  EXPECT_EQ(to_words(std::uint32_t{0x01020304}, WordOrder::LowWordFirst), (Pair{0x0304, 0x0102}));
  EXPECT_EQ(to_words(-0.5F, WordOrder::HighWordFirst), (Pair{0xBF00, 0x0000}));
}

TEST(Words, RoundTrip) {
  for (const auto order : {WordOrder::HighWordFirst, WordOrder::LowWordFirst}) {
    for (const float value : {0.0F, -0.0F, 1.0F, -123.456F, 1e-30F, 3.4e38F}) {
      const auto words = to_words(value, order);
      EXPECT_EQ(f32_from_words(words[0], words[1], order), value);
    }
  }
}

TEST(Registers, TestWordsFollowTheConfiguredOrder) {
  Options logix = test::options();
  logix.word_order = WordOrder::LowWordFirst;
  const Rig s7;
  const Rig l{logix};
  EXPECT_EQ(s7.word(10), 0x47F1);
  EXPECT_EQ(s7.word(11), 0x2000);
  EXPECT_EQ(s7.word(12), 0x0102);
  EXPECT_EQ(s7.word(13), 0x0304);
  EXPECT_EQ(l.word(10), 0x2000);
  EXPECT_EQ(l.word(11), 0x47F1);
  EXPECT_EQ(l.word(12), 0x0304);
  EXPECT_EQ(l.word(13), 0x0102);
  EXPECT_EQ(s7.word(at("word_order")), 0);
  EXPECT_EQ(l.word(at("word_order")), 1);
  EXPECT_EQ(s7.word(at("map_version")), kMapVersion);
  EXPECT_EQ(s7.word(at("map_length")), kMapLength);
}

TEST(Registers, BitTablesNameEachBitOnce) {
  const auto check = [](const auto& bits) {
    std::set<int> seen;
    for (const Bit& bit : bits) {
      EXPECT_TRUE(seen.insert(bit.bit).second) << bit.name;
      EXPECT_LT(bit.bit, 16);
      EXPECT_FALSE(bit.help.empty());
    }
  };
  check(kControlBits);
  check(kStatusBits);
  check(kNotReadyBits);
  EXPECT_EQ(kNotReadyBits.size(), 10U);
  EXPECT_EQ(1 << kNotReadyBits[8].bit, static_cast<int>(NotReady::Starting));
  EXPECT_EQ(1 << kStatusBits[3].bit, int{status::kResultValid});
  EXPECT_EQ(1 << kControlBits[3].bit, int{control::kRobotClear});
}

TEST(Tables, EveryCodeHasNameCauseAndCure) {
  std::set<std::string_view> names;
  for (const AlarmText& text : alarm_table()) {
    EXPECT_TRUE(names.insert(text.name).second) << text.name;
    EXPECT_FALSE(text.cause.empty());
    EXPECT_FALSE(text.cure.empty());
    EXPECT_EQ(to_string(text.alarm), text.name);
  }
  EXPECT_EQ(alarm_table().size(), 26U);
  for (const ResultText& text : result_table()) {
    EXPECT_TRUE(names.insert(text.name).second) << text.name;
    EXPECT_FALSE(text.cause.empty());
    EXPECT_FALSE(text.cure.empty());
    EXPECT_EQ(to_string(text.code), text.name);
  }
  EXPECT_EQ(result_table().size(), 11U);
  for (const UnreachableText& text : unreachable_table()) {
    EXPECT_FALSE(text.name.empty() || text.cure.empty());
    EXPECT_NE(text.reason, Unreachable::None);
  }
  EXPECT_EQ(to_string(Alarm::None), "none");
  EXPECT_EQ(to_string(static_cast<Alarm>(9999)), "unknown alarm");
  EXPECT_EQ(to_string(ResultCode::None), "none");
  EXPECT_EQ(to_string(static_cast<ResultCode>(9999)), "unknown result code");
}
}  // namespace binpick::plc
