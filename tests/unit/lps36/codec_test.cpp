#include "drivers/scanner/lps36/codec.hpp"

#include <algorithm>
#include <cctype>
#include <gtest/gtest.h>

namespace binpick::drivers::lps36 {
namespace {
/// "FF FF …" with comments after '#' up to the line's end.
Bytes hex(std::string_view text) {
  Bytes out;
  int digit = -1;
  bool comment = false;
  for (const char c : text) {
    if (c == '#') comment = true;
    if (c == '\n') comment = false;
    if (comment || std::isxdigit(static_cast<unsigned char>(c)) == 0) continue;
    const int value = c <= '9' ? c - '0' : (c | 0x20) - 'a' + 10;
    if (digit < 0) {
      digit = value;
    } else {
      out.push_back(static_cast<std::byte>(digit * 16 + value));
      digit = -1;
    }
  }
  return out;
}

// Whole datagrams, written from the public sources named in the driver's README.md. Little-endian words.
const char* const kConnect = R"(
  FF FF FF FF                  # start
  00 00                        # fill
  4E 43                        # command 0x434E, connect
  00 00                        # fill
  00 00                        # packet number
  00 00                        # fill
  00 00                        # transaction number
  00 00                        # status
  00 00 00 00                  # encoder
  00 00                        # fill
  00 00                        # scan number
  10 00                        # type: 16-bit words
  00 00                        # no word of content: standard
)";
const char* const kConnectHi = R"(
  FF FF FF FF  00 00  4E 43  00 00  00 00  00 00  00 00  00 00  00 00 00 00  00 00  00 00  10 00
  01 00                        # one word
  01 00                        # HI
)";
const char* const kAckOfConnect = R"(
  FF FF FF FF  00 00
  41 41                        # 0x4141, acknowledged
  00 00  00 00  00 00
  4E 43                        # transaction number: the command that is answered
  11 01                        # status 0x0111: connected, measure mode, activated
  00 00 00 00  00 00  00 00  10 00  00 00
)";
const char* const kNackOfConnect = R"(
  FF FF FF FF  00 00
  4E 41                        # 0x414E, not acknowledged
  00 00  00 00  00 00
  4E 43                        # of connect
  11 01                        # status
  00 00 00 00  00 00  00 00  10 00  00 00
)";
const char* const kAckOfEnter = R"(
  FF FF FF FF  00 00  41 41  00 00  00 00  00 00
  32 31                        # of 0x3132, enter command mode
  41 01                        # status 0x0141: connected, command mode, activated
  00 00 00 00  00 00  00 00  10 00  00 00
)";
const char* const kAckOfExit = R"(
  FF FF FF FF  00 00  41 41  00 00  00 00  00 00
  33 31                        # of 0x3133, exit command mode
  11 01                        # measure mode again
  00 00 00 00  00 00  00 00  10 00  00 00
)";
const char* const kParameterReply = R"(
  FF FF FF FF  00 00
  70 00                        # 0x0070, task parameter
  00 00  00 00  00 00
  6F 00                        # of 0x006F, get task parameter
  41 01                        # status
  00 00 00 00  00 00  00 00  10 00
  09 00                        # nine words
  BA 0B                        # id 0x0BBA, operation mode
  01 00                        # type UINT8
  01 00                        # one value
  00 00 00 00                  # minimum, high word first
  00 00 01 00                  # maximum 1
  00 00                        # fields
  01 00                        # value 1: input triggered
)";
const char* const kMeasuredHead = R"(
  00 00  00 00  00 00          # fill, packet number, fill
  00 00                        # transaction number 0: measured
  11 01                        # status: connected, measure mode, activated
  01 00 02 00                  # encoder 0x00010002, high word first
  00 00                        # fill
  34 12                        # scan number 0x1234
  10 00                        # type
)";

/// Z 412.3 mm at point 0, nothing at point 1, Z 810.0 mm at the last: the rest 190.0 mm.
Bytes z_datagram() {
  Bytes bytes = hex(std::string{"FF FF FF FF 00 00  5A 5A"} + kMeasuredHead + "78 01  1B 10  00 00");
  for (std::size_t i = 2; i + 1 < kPoints; ++i) append(bytes, hex("6C 07"));
  append(bytes, hex("A4 1F"));
  return bytes;
}
/// X -150.0 mm at point 0, 0 at point 1, the rest 300.0 mm.
Bytes x_datagram() {
  Bytes bytes = hex(std::string{"FF FF FF FF 00 00  58 58"} + kMeasuredHead + "78 01  24 FA  00 00");
  for (std::size_t i = 2; i < kPoints; ++i) append(bytes, hex("B8 0B"));
  return bytes;
}
/// HI: Z 412.37 mm and X -15.00 mm at each point.
Bytes zx_datagram() {
  Bytes bytes = hex(std::string{"FF FF FF FF 00 00  58 5A"} + kMeasuredHead + "E0 01");
  for (std::size_t i = 0; i < kPointsHi; ++i) append(bytes, hex("15 A1"));
  for (std::size_t i = 0; i < kPointsHi; ++i) append(bytes, hex("24 FA"));
  return bytes;
}

Telegram decoded(ByteView datagram) {
  const auto telegram = decode(datagram);
  EXPECT_TRUE(telegram.has_value()) << (telegram ? "" : to_string(telegram.error()));
  return telegram.value_or(Telegram{});
}
std::vector<Bytes> all_datagrams() {
  std::vector<Bytes> all{z_datagram(), x_datagram(), zx_datagram()};
  for (const char* text : {kConnect, kConnectHi, kAckOfConnect, kNackOfConnect, kAckOfEnter, kParameterReply})
    all.push_back(hex(text));
  return all;
}

struct Command {
  const char* name;
  Telegram telegram;
  const char* id;       ///< Bytes 6 and 7.
  const char* content;  ///< From byte 28 on: count and words.
};
const std::vector<Command>& commands() {
  static const std::vector<Command> all{
      {"connect", connect(false), "4E 43", "00 00"},
      {"connect HI", connect(true), "4E 43", "01 00  01 00"},
      {"disconnect", command(Id::Disconnect), "43 44", "00 00"},
      {"enter command mode", command(Id::EnterCommandMode), "32 31", "00 00"},
      {"exit command mode", command(Id::ExitCommandMode), "33 31", "00 00"},
      {"trigger", command(Id::Trigger), "54 45", "00 00"},
      {"activation on", activate(true), "41 45", "01 00  01 00"},
      {"activation off", activate(false), "41 45", "01 00  00 00"},
      {"laser off", set_laser(false), "01 00", "01 00  00 00"},
      {"laser on", set_laser(true), "01 00", "01 00  01 00"},
      {"measure once", command(Id::MeasureOnce), "03 00", "00 00"},
      {"get Z", command(Id::GetZ), "13 00", "00 00"},
      {"get X", command(Id::GetX), "11 00", "00 00"},
      {"get ZX", command(Id::GetZx), "5F 00", "00 00"},
      {"scan number 0", set_scan_number(0), "53 00", "01 00  00 00"},
      {"encoder 0x00012345", set_encoder(0x00012345), "29 00", "02 00  45 23  01 00"},  // low word first
      {"get task", command(Id::GetTask), "49 00", "00 00"},
      {"task 15, permanent", set_task(15, true), "4B 00", "02 00  0F 00  01 00"},
      {"X telegrams on", set_user_parameter(false, user::kXDisabled, 0), "59 00", "03 00  00 00  D4 07  00 00"},
      {"get pause", get_user_parameter(user::kPause), "5B 00", "01 00  D8 07"},
      {"input triggered", set_task_parameter(false, task::kOperationMode, {1}), "6D 00", "03 00  00 00  BA 0B  01 00"},
      {"field X", set_task_parameter(true, task::kFieldX, {0xF448, 0x0BB8}), "6D 00",
       "04 00  01 00  BF 0B  48 F4  B8 0B"},  // -300.0 … 300.0 mm
      {"get operation mode", get_task_parameter(task::kOperationMode), "6F 00", "01 00  BA 0B"}};
  return all;
}

TEST(Lps36Codec, EachCommandBothWays) {
  for (const auto& [name, telegram, id, content] : commands()) {
    SCOPED_TRACE(name);
    Bytes bytes = hex("FF FF FF FF 00 00");
    append(bytes, hex(id));
    append(bytes, hex("00 00  00 00  00 00  00 00  00 00  00 00 00 00  00 00  00 00  10 00"));
    append(bytes, hex(content));
    EXPECT_EQ(encode(telegram), bytes);
    EXPECT_EQ(decoded(bytes), telegram);
  }
}

TEST(Lps36Codec, ConnectAndItsAnswersBothWays) {
  const auto both_ways = [](const Telegram& telegram, const char* text) {
    EXPECT_EQ(encode(telegram), hex(text));
    EXPECT_EQ(decoded(hex(text)), telegram);
  };
  both_ways(connect(false), kConnect);
  both_ways(connect(true), kConnectHi);
  both_ways(answer(Id::Ack, Id::Connect, {0x0111}), kAckOfConnect);
  both_ways(answer(Id::Nack, Id::Connect, {0x0111}), kNackOfConnect);
  both_ways(answer(Id::Ack, Id::EnterCommandMode, {0x0141}), kAckOfEnter);
  both_ways(answer(Id::Ack, Id::ExitCommandMode, {0x0111}), kAckOfExit);
}

TEST(Lps36Codec, ZTelegramBothWays) {
  const Bytes bytes = z_datagram();
  ASSERT_EQ(bytes.size(), 782U);
  const auto z = measured_of(decoded(bytes));
  ASSERT_TRUE(z.has_value());
  EXPECT_EQ(z->part, Measured::Part::Z);
  EXPECT_EQ(z->scan, 0x1234);
  EXPECT_EQ(z->encoder, 0x00010002U);
  EXPECT_EQ(z->status.bits, 0x0111);
  ASSERT_EQ(z->z.size(), 376U);
  EXPECT_TRUE(z->x.empty());
  EXPECT_EQ(z->z[0], 4123);
  EXPECT_EQ(z->z[1], 0);
  EXPECT_EQ(z->z[2], 1900);
  EXPECT_EQ(z->z[375], 8100);
  EXPECT_EQ(encode(telegram_of(*z)), bytes);
}

TEST(Lps36Codec, XTelegramBothWays) {
  const Bytes bytes = x_datagram();
  ASSERT_EQ(bytes.size(), 782U);
  const auto x = measured_of(decoded(bytes));
  ASSERT_TRUE(x.has_value());
  EXPECT_EQ(x->part, Measured::Part::X);
  ASSERT_EQ(x->x.size(), 376U);
  EXPECT_TRUE(x->z.empty());
  EXPECT_EQ(x->x[0], -1500);
  EXPECT_EQ(x->x[375], 3000);
  EXPECT_EQ(encode(telegram_of(*x)), bytes);
}

TEST(Lps36Codec, ZxTelegramOfAnHiBothWays) {
  const Bytes bytes = zx_datagram();
  ASSERT_EQ(bytes.size(), 990U);
  const auto both = measured_of(decoded(bytes));
  ASSERT_TRUE(both.has_value());
  EXPECT_EQ(both->part, Measured::Part::Both);
  ASSERT_EQ(both->z.size(), 240U);
  ASSERT_EQ(both->x.size(), 240U);
  EXPECT_EQ(both->z[239], 41237);
  EXPECT_EQ(both->x[0], -1500);
  EXPECT_EQ(encode(telegram_of(*both)), bytes);
}

TEST(Lps36Codec, PointsOutOfRangeAreNone) {
  EXPECT_FALSE(is_point(0, false));
  EXPECT_TRUE(is_point(1, false));
  EXPECT_TRUE(is_point(8100, false));
  EXPECT_FALSE(is_point(8101, false));
  EXPECT_TRUE(is_point(61000, true));
  EXPECT_FALSE(is_point(61001, true));
}

TEST(Lps36Codec, TaskParameterBothWays) {
  const Bytes bytes = hex(kParameterReply);
  ASSERT_EQ(bytes.size(), 48U);
  const auto parameter = parameter_of(decoded(bytes));
  ASSERT_TRUE(parameter.has_value());
  EXPECT_EQ(*parameter, (Parameter{0x0BBA, 1, 0, 1, 0, {1}}));
  EXPECT_EQ(encode(telegram_of(*parameter, {0x0141})), bytes);
}

TEST(Lps36Codec, ParameterWhoseCountAndWordsDisagreeIsRefused) {
  Telegram telegram = telegram_of(Parameter{0x0BBA, 1, 0, 1, 0, {1}}, {});
  telegram.words[2] = 2;
  ASSERT_FALSE(parameter_of(telegram).has_value());
  EXPECT_EQ(parameter_of(telegram).error().kind, DecodeError::Kind::BadContent);
  telegram.words.resize(7);
  EXPECT_FALSE(parameter_of(telegram).has_value());
  EXPECT_FALSE(parameter_of(command(Id::Ack)).has_value());
}

TEST(Lps36Codec, StatusBitsReadAsStated) {
  EXPECT_EQ(Status{0x0111}.mode(), Mode::Measure);
  EXPECT_EQ(Status{0x0121}.mode(), Mode::Menu);
  EXPECT_EQ(Status{0x0141}.mode(), Mode::Command);
  EXPECT_EQ(Status{0x2181}.mode(), Mode::Error);
  EXPECT_EQ(Status{0x0101}.mode(), std::nullopt);
  EXPECT_EQ(Status{0x0131}.mode(), std::nullopt) << "the four are exclusive";
  EXPECT_TRUE(Status{0x0001}.connected());
  EXPECT_FALSE(Status{0xFFFE}.connected());
  EXPECT_TRUE(Status{0x0100}.activated());
  EXPECT_TRUE(Status{0x0200}.warning());
  EXPECT_TRUE(Status{0x0400}.triggered());
  EXPECT_TRUE(Status{0x0800}.memory());
  EXPECT_TRUE(Status{0x2000}.fault());
  for (const int bit : {0x0100, 0x0200, 0x0400, 0x0800, 0x2000}) {
    const Status others{static_cast<std::uint16_t>(~bit)};
    const int set = others.activated() + others.warning() + others.triggered() + others.memory() + others.fault();
    EXPECT_EQ(set, 4) << bit;
  }
}

TEST(Lps36Codec, TypeZeroIsTakenToo) {
  Bytes bytes = hex(kConnect);
  bytes[26] = std::byte{0};
  EXPECT_EQ(decoded(bytes).type, 0);
  bytes[26] = std::byte{0x11};
  EXPECT_EQ(decode(bytes).error().kind, DecodeError::Kind::BadType);
}

TEST(Lps36Codec, EveryPrefixAndEveryCutIsAnError) {
  for (const Bytes& bytes : all_datagrams())
    for (std::size_t n = 0; n < bytes.size(); ++n) {
      // Copies, so that a sanitizer sees each read beyond the end.
      const Bytes front{bytes.begin(), bytes.begin() + static_cast<std::ptrdiff_t>(n)};
      const auto result = decode(front);
      ASSERT_FALSE(result.has_value()) << n;
      EXPECT_EQ(result.error().kind, n < kHeaderBytes ? DecodeError::Kind::TooShort : DecodeError::Kind::BadLength);
      EXPECT_LE(result.error().at, n);
      const Bytes back{bytes.begin() + static_cast<std::ptrdiff_t>(n), bytes.end()};
      if (n > 0) {
        EXPECT_FALSE(decode(back).has_value()) << n;
      }
    }
}

TEST(Lps36Codec, MoreBytesThanStatedIsAnError) {
  for (Bytes bytes : all_datagrams()) {
    bytes.push_back({});
    EXPECT_EQ(decode(bytes).error().kind, DecodeError::Kind::BadLength);
  }
  Bytes bytes(kHeaderBytes + 2 * (kWordsMax + 1));
  const Bytes head = hex("FF FF FF FF 00 00 5A 5A 00 00 00 00 00 00 00 00 11 01 00 00 00 00 00 00 00 00 10 00 E1 01");
  std::ranges::copy(head, bytes.begin());
  EXPECT_EQ(decode(bytes).error().kind, DecodeError::Kind::BadLength) << "481 words";
}

TEST(Lps36Codec, EverySingleByteCorruptionIsAnErrorOrAValueInRange) {
  for (const Bytes& good : all_datagrams())
    for (std::size_t at = 0; at < good.size(); ++at)
      for (int flip = 1; flip < 256; flip += at < kHeaderBytes ? 1 : 17) {
        Bytes bad = good;
        bad[at] ^= static_cast<std::byte>(flip);
        const auto telegram = decode(bad);
        const bool is_fixed =
            at < 6 || (at >= 8 && at < 10) || at == 12 || at == 13 || at == 22 || at == 23 || at >= 28;
        if (!telegram) continue;
        EXPECT_TRUE(!is_fixed || at >= kHeaderBytes) << "start, fill and count have one right value; byte " << at;
        EXPECT_EQ(encode(*telegram), bad) << "nothing is invented";
        EXPECT_NE(*telegram, decoded(good)) << "nothing is overlooked";
        if (const auto measured = measured_of(*telegram)) {
          EXPECT_EQ(measured->z.size() + measured->x.size(), telegram->words.size());
          EXPECT_TRUE(is_measured(telegram->id));
        }
        if (const auto parameter = parameter_of(*telegram)) {
          EXPECT_EQ(parameter->values.size() + 8, telegram->words.size());
        }
      }
}

TEST(Lps36Codec, MeasuredTelegramsOfAnotherLengthAreRefused) {
  for (const Bytes& bytes : {z_datagram(), x_datagram(), zx_datagram()}) {
    Telegram telegram = decoded(bytes);
    telegram.words.pop_back();
    EXPECT_FALSE(measured_of(telegram).has_value());
    telegram.words.clear();
    EXPECT_FALSE(measured_of(telegram).has_value());
  }
  EXPECT_FALSE(measured_of(command(Id::Ack)).has_value());
}

TEST(Lps36Codec, ErrorsAreWords) {
  EXPECT_EQ(to_string(decode({}).error()), "datagram shorter than a header (byte 0)");
  Bytes bytes = hex(kConnect);
  bytes[2] = std::byte{0};
  EXPECT_EQ(to_string(decode(bytes).error()), "datagram does not begin as a telegram (byte 2)");
  bytes = hex(kConnect);
  bytes[22] = std::byte{1};
  EXPECT_EQ(to_string(decode(bytes).error()), "header word that has to be 0 is not (byte 22)");
}
}  // namespace
}  // namespace binpick::drivers::lps36
