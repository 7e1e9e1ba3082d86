#include <gtest/gtest.h>

#include "plc/modbus_guard.hpp"
#include "plc/modbus_request.hpp"
#include "tests/unit/plc/rig.hpp"

/// Frames as they stand in the MODBUS Application Protocol V1.1b3 (6.3, 6.12, 7) and the Messaging on TCP/IP
/// Implementation Guide V1.0b (3.1.3).
namespace binpick::plc::modbus {
namespace {
using test::hex;
using Kind = ReplyError::Kind;

const Request kRead{.transaction = 0x1234, .unit = 255, .first = 0x0107, .count = 2, .words = {}};
const Request kWrite{.transaction = 0x0002, .unit = 1, .first = 8, .count = 3, .words = {0x0001, 0x8002, 0xFFFE}};

// transaction | protocol | length | unit | function | …
const Bytes kReadFrame = hex({0x12, 0x34, 0, 0, 0, 6, 255, 3, 0x01, 0x07, 0, 2});
const Bytes kReadReply = hex({0x12, 0x34, 0, 0, 0, 7, 255, 3, 4, 0x47, 0xF1, 0x20, 0x00});
const Bytes kWriteFrame = hex({0, 2, 0, 0, 0, 13, 1, 16, 0, 8, 0, 3, 6, 0x00, 0x01, 0x80, 0x02, 0xFF, 0xFE});
const Bytes kWriteReply = hex({0, 2, 0, 0, 0, 6, 1, 16, 0, 8, 0, 3});

struct Wrong {
  const char* name;
  Request request;
  Bytes reply;
  Kind kind;
  std::uint16_t got, expected;
};
std::vector<Wrong> wrong_replies() {
  return {
      {"of another transaction", kRead, hex({0x12, 0x33, 0, 0, 0, 7, 255, 3, 4, 0, 0, 0, 0}), Kind::Transaction, 0x1233,
       0x1234},
      {"of another unit", kRead, hex({0x12, 0x34, 0, 0, 0, 7, 1, 3, 4, 0, 0, 0, 0}), Kind::Unit, 1, 255},
      {"of another function", kRead, hex({0x12, 0x34, 0, 0, 0, 7, 255, 4, 4, 0, 0, 0, 0}), Kind::Function, 4, 3},
      {"a write's answer to a read", kRead, hex({0x12, 0x34, 0, 0, 0, 6, 255, 16, 1, 7, 0, 2}), Kind::Function, 16, 3},
      {"one word too few", kRead, hex({0x12, 0x34, 0, 0, 0, 5, 255, 3, 2, 0, 0}), Kind::Length, 4, 6},
      {"one word too many", kRead, hex({0x12, 0x34, 0, 0, 0, 9, 255, 3, 6, 0, 0, 0, 0, 0, 0}), Kind::Length, 8, 6},
      {"a byte count that is not the frame's", kRead, hex({0x12, 0x34, 0, 0, 0, 7, 255, 3, 5, 0, 0, 0, 0}),
       Kind::Length, 5, 4},
      {"no more than a function", kRead, hex({0x12, 0x34, 0, 0, 0, 2, 255, 3}), Kind::Length, 1, 6},
      {"exception 2", kRead, hex({0x12, 0x34, 0, 0, 0, 3, 255, 0x83, 2}), Kind::Exception, 2, 0},
      {"an exception without its code", kRead, hex({0x12, 0x34, 0, 0, 0, 2, 255, 0x83}), Kind::Length, 1, 2},
      {"an exception and more", kRead, hex({0x12, 0x34, 0, 0, 0, 4, 255, 0x83, 2, 0}), Kind::Length, 3, 2},
      {"exception 6 to a write", kWrite, hex({0, 2, 0, 0, 0, 3, 1, 0x90, 6}), Kind::Exception, 6, 0},
      {"a read's exception to a write", kWrite, hex({0, 2, 0, 0, 0, 3, 1, 0x83, 2}), Kind::Function, 0x83, 16},
      {"another address", kWrite, hex({0, 2, 0, 0, 0, 6, 1, 16, 0, 9, 0, 3}), Kind::Echo, 9, 8},
      {"another count", kWrite, hex({0, 2, 0, 0, 0, 6, 1, 16, 0, 8, 0, 2}), Kind::Echo, 2, 3},
      {"a write's answer that is too short", kWrite, hex({0, 2, 0, 0, 0, 4, 1, 16, 0, 8}), Kind::Length, 3, 5},
  };
}
}  // namespace

TEST(Request, FramesByteForByte) {
  EXPECT_EQ(encode(kRead), kReadFrame);
  EXPECT_EQ(encode(kWrite), kWriteFrame);
  EXPECT_EQ(to_string(kRead), "function 3, 2 words at 263");
  EXPECT_EQ(to_string(Request{.first = 17, .count = 1, .words = {1}}), "function 16, 1 word at 17");
}

TEST(Request, TheLongestFramesFitTheSpecification) {
  EXPECT_EQ(encode({.first = 65411, .count = 125, .words = {}}).size(), 12U);
  EXPECT_EQ(encode({.count = 123, .words = std::vector<std::uint16_t>(123)}).size(), 259U);
}

TEST(Request, ARequestOfOursPassesTheGuardOfAServer) {
  for (const Bytes& frame : {kReadFrame, kWriteFrame}) {
    const Verdict verdict = check(frame, {0, 1000, 0, 1000});
    EXPECT_FALSE(verdict.answer.has_value());
  }
}

TEST(Request, RepliesAreReadAsTheyAre) {
  const auto words = parse_reply(kReadReply, kRead);
  ASSERT_TRUE(words.has_value());
  EXPECT_EQ(*words, (std::vector<std::uint16_t>{0x47F1, 0x2000}));
  const auto written = parse_reply(kWriteReply, kWrite);
  ASSERT_TRUE(written.has_value());
  EXPECT_TRUE(written->empty());
}

TEST(Request, WrongRepliesAreNamed) {
  for (const auto& wrong : wrong_replies()) {
    const auto words = parse_reply(wrong.reply, wrong.request);
    ASSERT_FALSE(words.has_value()) << wrong.name;
    EXPECT_EQ(words.error().kind, wrong.kind) << wrong.name;
    EXPECT_EQ(words.error().got, wrong.got) << wrong.name;
    EXPECT_EQ(words.error().expected, wrong.expected) << wrong.name;
  }
  EXPECT_EQ(to_string(ReplyError{Kind::Exception, 2, 0}), "exception 2: it has no such address");
  EXPECT_EQ(to_string(ReplyError{Kind::Unit, 1, 255}), "reply of unit 1 to a request for 255; see plc.unit_id");
}

TEST(Request, APrefixIsNoReplyAndASplitOneIsWhole) {
  for (const Bytes& reply : {kReadReply, kWriteReply, hex({0, 2, 0, 0, 0, 3, 1, 0x90, 6})}) {
    for (std::size_t cut = 0; cut < reply.size(); ++cut) {
      FrameBuffer buffer;
      buffer.append(ByteView{reply}.first(cut));
      const auto nothing = buffer.take_frame();
      ASSERT_TRUE(nothing.has_value());
      EXPECT_FALSE(nothing->has_value()) << "after " << cut << " bytes";
      buffer.append(ByteView{reply}.subspan(cut));
      const auto whole = buffer.take_frame();
      ASSERT_TRUE(whole.has_value() && whole->has_value());
      EXPECT_EQ(**whole, reply);
    }
  }
}

TEST(Request, ACorruptByteIsNeverTakenForTheReply) {
  const auto words_of = [](const Bytes& bytes, const Request& request) -> std::optional<std::vector<std::uint16_t>> {
    FrameBuffer buffer;
    buffer.append(bytes);
    const auto frame = buffer.take_frame();
    if (!frame || !*frame) return std::nullopt;
    auto words = parse_reply(**frame, request);
    return words ? std::optional{std::move(*words)} : std::nullopt;
  };
  constexpr std::size_t kWordsAt = 9;  // of a read's answer: bytes that may be anything
  for (int flip = 1; flip < 256; ++flip) {
    for (std::size_t at = 0; at < kReadReply.size(); ++at) {
      Bytes bytes = kReadReply;
      bytes[at] ^= static_cast<std::byte>(flip);
      const auto words = words_of(bytes, kRead);
      EXPECT_EQ(words.has_value(), at >= kWordsAt) << "byte " << at << " flipped by " << flip;
      if (words) {
        EXPECT_NE(*words, *words_of(kReadReply, kRead));
      }
    }
    for (std::size_t at = 0; at < kWriteReply.size(); ++at) {
      Bytes bytes = kWriteReply;
      bytes[at] ^= static_cast<std::byte>(flip);
      EXPECT_FALSE(words_of(bytes, kWrite).has_value()) << "byte " << at << " flipped by " << flip;
    }
  }
}
}  // namespace binpick::plc::modbus
