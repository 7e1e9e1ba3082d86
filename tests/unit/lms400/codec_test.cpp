#include "drivers/scanner/lms400/codec.hpp"

#include <algorithm>
#include <cctype>
#include <gtest/gtest.h>

namespace binpick::drivers::lms400 {
namespace {
/// "02 02 …" with comments after '#' up to the line's end.
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

Decoded decoded(ByteView bytes) {
  auto result = decode(bytes);
  EXPECT_TRUE(result.has_value());
  EXPECT_TRUE(result.has_value() && result->has_value());
  return result.value().value();
}

// Whole frames, typed from the telegrams that the public drivers send and receive (README.md of the driver).
const Bytes kLogin = hex(R"(
  02 02 02 02                                       # 4 × STX
  00 00 00 1D                                       # payload length 29, big-endian
  73 4D 4E 20                                       # "sMN "
  53 65 74 41 63 63 65 73 73 4D 6F 64 65 20         # "SetAccessMode "
  30 34 20                                          # "04 ", user level
  38 31 42 45 32 33 41 41                           # "81BE23AA", hash of the service password
  1E)");  // XOR of the payload
const Bytes kRequestData = hex(R"(
  02 02 02 02  00 00 00 11
  73 4D 4E 20 6D 4C 52 72 65 71 64 61 74 61 20      # "sMN mLRreqdata "
  32 30                                             # "20": distance and remission
  77)");
const Bytes kDataRequested = hex(R"(
  02 02 02 02  00 00 00 17
  73 41 4E 20 6D 4C 52 72 65 71 64 61 74 61 20      # "sAN mLRreqdata "
  30 30 30 30 30 30 30 30                           # success
  79)");
const Bytes kRefused = hex("02 02 02 02  00 00 00 05  73 46 41 20 35  61");  // "sFA 5"

const char* const kMeasuredHead = R"(
  01 00                                             # distance scale 1
  70 64 08 00                                       # start 550000/10000 = 55 degrees
  C4 09                                             # step 2500/10000 = 0.25 degree
  04 00                                             # 4 points
  68 01                                             # 360 Hz
  01 00 00 00 FF 00                                 # remission scale 1, start 0, end 255
)";
const char* const kTrailer = R"(
  00 00 00 00 00 00                                 # unknown
  D2 04                                             # encoder 1234
  00 00 00 00 00 00                                 # unknown
  07 00 07 00                                       # scan counter 7, twice
)";
const Bytes kBoth = hex(std::string{"02 02 02 02 00 00 00 32  20 00"} + kMeasuredHead + R"(
  E8 03 28                                          # 1000 mm, remission 40
  E9 03 29                                          # 1001 mm, 41
  00 00 00                                          # no measurement
  DB 05 C8                                          # 1499 mm, 200
)" + kTrailer + "A3");
const Bytes kDistance =
    hex(std::string{"02 02 02 02 00 00 00 2E  21 00"} + kMeasuredHead + "E8 03 E9 03 00 00 DB 05" + kTrailer + "6B");
const Bytes kRemission =
    hex(std::string{"02 02 02 02 00 00 00 2A  22 00"} + kMeasuredHead + "28 29 00 C8" + kTrailer + "7E");

Measured example(Format format) {
  Measured m;
  m.format = format;
  m.start_1e4deg = 550000;
  m.step_1e4deg = 2500;
  m.frequency_hz = 360;
  if (format != Format::Remission) m.distance = {1000, 1001, 0, 1499};
  if (format != Format::Distance) m.remission = {40, 41, 0, 200};
  m.trailer = {0, 0, 0, 1234, 0, 0, 0, 7, 7};
  return m;
}

struct TextFrame {
  const char* text;
  std::uint8_t length, checksum;
};
// Every other text of the exchange: its length and the XOR of its bytes, reckoned by hand from the public texts.
constexpr TextFrame kTexts[] = {
    {"sMN SetAccessMode 4 81BE23AA", 0x1C, 0x2E},
    {"sMN SetAccessMode 04 81BE23AA", 0x1D, 0x1E},
    {"sMN SetAccessMode 3 F4724744", 0x1C, 0x52},
    {"sMN SetAccessMode 03 F4724744", 0x1D, 0x62},
    {"sMA SetAccessMode", 0x11, 0x1A},
    {"sAN SetAccessMode 1", 0x13, 0x08},
    {"sAN SetAccessMode 0", 0x13, 0x09},
    {"sMN Run", 0x07, 0x19},
    {"sMA Run", 0x07, 0x16},
    {"sAN Run 1", 0x09, 0x04},
    {"sMN mLRreqdata 20", 0x11, 0x77},
    {"sMN mLRreqdata 21", 0x11, 0x76},
    {"sMN mLRreqdata 22", 0x11, 0x75},
    {"sMN mLRreqdata 0020", 0x13, 0x77},
    {"sMN mLRreqdata 0021", 0x13, 0x76},
    {"sMA mLRreqdata", 0x0E, 0x5A},
    {"sAN mLRreqdata 00000000", 0x17, 0x79},
    {"sMN mLRstopdata", 0x0F, 0x2B},
    {"sMA mLRstopdata", 0x0F, 0x24},
    {"sAN mLRstopdata 00000000", 0x18, 0x07},
    {"sWN FLsel +13", 0x0D, 0x33},
    {"sWA FLsel", 0x09, 0x35},
    {"sWN FLmean 0 5", 0x0E, 0x42},
    {"sWA FLmean", 0x0A, 0x48},
    {"sWN FLrang +700.000000 +3000.000000", 0x23, 0x6E},
    {"sWA FLrang", 0x0A, 0x55},
    {"sWN MDblex 1", 0x0C, 0x41},
    {"sWA MDblex", 0x0A, 0x5F},
    {"sWN IOencm 2", 0x0C, 0x5B},
    {"sWA IOencm", 0x0A, 0x46},
    {"sMN mSCsetscanconfig +360.00 +0.25 +55.00 +70.00", 0x30, 0x5F},
    {"sMA mSCsetscanconfig", 0x14, 0x55},
    {"sAN mSCsetscanconfig 00000000 43B40000 3E800000 00000008", 0x38, 0x51},
    {"sMN mSCconfigbyang 04 81BE23AA +0.250000 01 +55.000000 +70.000000", 0x41, 0x6B},
    {"sMN mSCconfigbyang 03 F4724744 +0.1 +0 +55.000000 +70.000000", 0x3C, 0x3B},
    {"sRN EImac ", 0x0A, 0x0C},
    {"sMN mDCreset ", 0x0D, 0x6F},
    {"sRI 3", 0x05, 0x7B},
    {"sRA 0003 0008 12345678", 0x16, 0x43},
    {"sFA 1", 0x05, 0x65},
    {"sFA 5", 0x05, 0x61},
    {"sFA A", 0x05, 0x15},
};

class Lms400Text : public testing::TestWithParam<TextFrame> {};
INSTANTIATE_TEST_SUITE_P(Public, Lms400Text, testing::ValuesIn(kTexts));

TEST_P(Lms400Text, HasLengthAndChecksumBothWays) {
  const auto& [text, length, checksum] = GetParam();
  Bytes frame = hex("02 02 02 02 00 00 00");
  frame.push_back(static_cast<std::byte>(length));
  append(frame, as_bytes(text));
  frame.push_back(static_cast<std::byte>(checksum));
  EXPECT_EQ(encode(Text{text}), frame);
  const Decoded back = decoded(frame);
  EXPECT_EQ(back.consumed, frame.size());
  EXPECT_EQ(back.message, Message{Text{text}});
}

TEST_P(Lms400Text, GrammarGivesTheSameTextBack) {
  const std::string text = GetParam().text;
  if (const auto request = parse_request(text))
    EXPECT_EQ(to_text(*request), text);
  else if (const auto reply = parse_reply(text))
    EXPECT_EQ(to_text(*reply), text);
  else
    ADD_FAILURE() << text << " is neither request nor reply";
}

TEST(Lms400Codec, WholeFramesBothWays) {
  EXPECT_EQ(encode(Text{"sMN SetAccessMode 04 81BE23AA"}), kLogin);
  EXPECT_EQ(encode(Text{"sMN mLRreqdata 20"}), kRequestData);
  EXPECT_EQ(encode(Text{"sAN mLRreqdata 00000000"}), kDataRequested);
  EXPECT_EQ(encode(Text{"sFA 5"}), kRefused);
  EXPECT_EQ(decoded(kLogin).message, Message{Text{"sMN SetAccessMode 04 81BE23AA"}});
  EXPECT_EQ(decoded(kRequestData).message, Message{Text{"sMN mLRreqdata 20"}});
  EXPECT_EQ(decoded(kDataRequested).message, Message{Text{"sAN mLRreqdata 00000000"}});
  EXPECT_EQ(decoded(kRefused).message, Message{Text{"sFA 5"}});
}

TEST(Lms400Codec, MeasuredTelegramsBothWays) {
  ASSERT_EQ(kBoth.size(), 59U);
  ASSERT_EQ(kDistance.size(), 55U);
  ASSERT_EQ(kRemission.size(), 51U);
  EXPECT_EQ(encode(example(Format::DistanceAndRemission)), kBoth);
  EXPECT_EQ(encode(example(Format::Distance)), kDistance);
  EXPECT_EQ(encode(example(Format::Remission)), kRemission);
  EXPECT_EQ(decoded(kBoth).message, Message{example(Format::DistanceAndRemission)});
  EXPECT_EQ(decoded(kDistance).message, Message{example(Format::Distance)});
  EXPECT_EQ(decoded(kRemission).message, Message{example(Format::Remission)});
}

TEST(Lms400Codec, MeasuredTelegramReadsAsStated) {
  const auto m = std::get<Measured>(decoded(kBoth).message);
  EXPECT_EQ(m.counter(), 7);
  EXPECT_EQ(m.encoder(), 1234);
  EXPECT_EQ(m.points(), 4U);
  EXPECT_EQ(m.range_mm(0), 1000.F);
  EXPECT_EQ(m.range_mm(2), std::nullopt) << "distance 0 is no measurement";
  EXPECT_EQ(m.range_mm(4), std::nullopt);
  Measured scaled = m;
  scaled.distance_scale = 2;
  EXPECT_EQ(scaled.range_mm(3), 2998.F);
}

TEST(Lms400Codec, FullLinesHaveTheKnownLengths) {
  // Totals that two public drivers expect: 1097 bytes for 350 points, 1438 of payload for 700 distances.
  Measured m;
  m.distance.resize(350);
  m.remission.resize(350);
  EXPECT_EQ(encode(m).size(), 1097U);
  m = Measured{};
  m.format = Format::Distance;
  m.distance.resize(700);
  EXPECT_EQ(encode(m).size(), 1438U + 9);
}

TEST(Lms400Codec, EveryPrefixIsNothingYet) {
  for (const Bytes& frame : {kLogin, kRequestData, kDataRequested, kRefused, kBoth, kDistance, kRemission})
    for (std::size_t n = 0; n < frame.size(); ++n) {
      const auto result = decode(ByteView{frame}.first(n));
      ASSERT_TRUE(result.has_value()) << n;
      EXPECT_FALSE(result->has_value()) << n;
    }
}

TEST(Lms400Codec, EverySingleByteCorruptionIsErrorOrNothingYet) {
  for (const Bytes& frame : {kLogin, kRefused, kBoth, kDistance, kRemission})
    for (std::size_t at = 0; at < frame.size(); ++at)
      for (int flip = 1; flip < 256; ++flip) {
        Bytes bad = frame;
        bad[at] ^= static_cast<std::byte>(flip);
        const auto result = decode(bad);
        // One XOR byte sees every single change of the payload; a longer length waits for more.
        if (result.has_value()) {
          EXPECT_FALSE(result->has_value()) << "byte " << at << " flip " << flip;
          EXPECT_TRUE(at >= 4 && at < 8) << "only a length may ask for more; byte " << at;
        } else {
          EXPECT_GE(result.error().skip, 1U);
          EXPECT_LE(result.error().skip, bad.size());
        }
      }
}

TEST(Lms400Codec, FindsTheFramesBetweenGarbage) {
  Bytes stream = hex("00 FF 02 02 13");                  // shorter runs of STX
  append(stream, hex("02 02 02 02 00 00 20 00"));        // length 8192: too long
  append(stream, hex("02 02 02 02 00 00 00 00"));        // length 0
  append(stream, hex("02 02 02 02 00 00 00 01 73 72"));  // wrong checksum
  append(stream, hex("02"));                             // one STX more than four
  append(stream, kRefused);
  append(stream, hex("02 02 02 02 00 00 00 02 99 99 00"));  // right frame, unknown kind
  append(stream, kBoth);
  std::vector<Message> found;
  std::vector<DecodeError::Kind> errors;
  for (std::size_t at = 0; at < stream.size();) {
    const auto result = decode(ByteView{stream}.subspan(at));
    if (!result) {
      errors.push_back(result.error().kind);
      at += result.error().skip;
    } else {
      ASSERT_TRUE(result->has_value());
      found.push_back((*result)->message);
      at += (*result)->consumed;
    }
  }
  EXPECT_EQ(found, (std::vector<Message>{Text{"sFA 5"}, example(Format::DistanceAndRemission)}));
  using Kind = DecodeError::Kind;
  for (const Kind kind : {Kind::BadStart, Kind::BadLength, Kind::BadChecksum, Kind::BadTelegram})
    EXPECT_NE(std::ranges::find(errors, kind), errors.end()) << to_string(kind);
}

TEST(Lms400Codec, TelegramWhoseCountAndLengthDisagreeIsRefused) {
  Bytes bad = kBoth;
  bad[8 + 10] = std::byte{5};      // five points in the room of four
  bad.back() ^= std::byte{4 ^ 5};  // the checksum follows
  const auto result = decode(bad);
  ASSERT_FALSE(result.has_value());
  EXPECT_EQ(result.error().kind, DecodeError::Kind::BadTelegram);
  EXPECT_EQ(result.error().skip, bad.size());
}

TEST(Lms400Codec, CommandsReadAsThePublicDriversSendThem) {
  EXPECT_EQ(to_text(stop_measuring()), "sMN mLRstopdata");
  EXPECT_EQ(to_text(start_measuring(Format::DistanceAndRemission)), "sMN mLRreqdata 20");
  EXPECT_EQ(to_text(start_measuring(Format::Distance)), "sMN mLRreqdata 21");
  EXPECT_EQ(to_text(log_in()), "sMN SetAccessMode 4 81BE23AA");
  EXPECT_EQ(to_text(set_filter(13)), "sWN FLsel +13");
  EXPECT_EQ(to_text(set_extended_remission(true)), "sWN MDblex 1");
  EXPECT_EQ(to_text(set_scan(360, Angle::deg(0.25), Angle::deg(55), Angle::deg(70))),
            "sMN mSCsetscanconfig +360.00 +0.25 +55.00 +70.00");
}

TEST(Lms400Codec, Numbers) {
  EXPECT_EQ(parse_integer("+13"), 13);
  EXPECT_EQ(parse_integer("-13"), -13);
  EXPECT_EQ(parse_integer("13"), 0x13) << "without a sign the digits are hex";
  EXPECT_EQ(parse_integer("0020"), 0x20);
  EXPECT_EQ(parse_integer("81BE23AA"), 0x81BE23AA);
  for (const char* bad : {"", "+", "-", "+-1", "--1", "1G", "123456789", "+99999999999", "1 "})
    EXPECT_EQ(parse_integer(bad), std::nullopt) << bad;
  EXPECT_EQ(parse_decimal("+0.25"), 0.25);
  EXPECT_EQ(parse_decimal("+700.000000"), 700);
  for (const char* bad : {"", "+", "1x", "nan", "inf", "+1e999"}) EXPECT_EQ(parse_decimal(bad), std::nullopt) << bad;
  EXPECT_EQ(parse_float_hex("43B40000"), 360);
  EXPECT_EQ(parse_float_hex("3E800000"), 0.25);
  EXPECT_EQ(parse_float_hex("425C0000"), 55);
  EXPECT_EQ(parse_float_hex("428C0000"), 70);
  EXPECT_EQ(parse_float_hex("43FA0000"), 500);
  EXPECT_EQ(to_float_hex(0.1), "3DCCCCCD");
  EXPECT_EQ(to_float_hex(360), "43B40000");
  for (const char* bad : {"", "43B4000", "43B400000", "7F800000", "7FC00000", "ZZZZZZZZ"})
    EXPECT_EQ(parse_float_hex(bad), std::nullopt) << bad;
}

TEST(Lms400Codec, RefusalsAreWordsWithARemedy) {
  EXPECT_EQ(
      refusal_text(1),
      "error 1, access to the method denied, the login is missing; another program may have ended our login: leave "
      "the scanner to one program");
  EXPECT_EQ(refusal_text(5),
            "error 5, invalid argument; check frequency_hz, resolution_deg, start_deg and range_deg in [scanner]");
  EXPECT_EQ(refusal_text(0x99),
            "error 99, which no public table explains; restart the scanner; if it comes again, have it serviced");
  for (std::uint32_t code = 1; code <= 0x1A; ++code)
    EXPECT_EQ(refusal_text(code).find("no public table"), std::string::npos) << code;
}
}  // namespace
}  // namespace binpick::drivers::lms400
