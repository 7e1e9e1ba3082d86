#include <gtest/gtest.h>

#include "plc/modbus_guard.hpp"
#include "tests/unit/plc/rig.hpp"

/// Frames as they stand in the MODBUS Application Protocol V1.1b3 and the Messaging on TCP/IP Implementation Guide
/// V1.0b.
namespace binpick::plc::modbus {
namespace {
using test::hex;
using test::Rig;

/// Name, request, answer of a session with boot count 7 that nobody has spoken to yet.
struct Dialogue {
  const char* name;
  Bytes request;
  Bytes answer;
};

std::vector<Dialogue> dialogues() {
  return {
      // transaction | protocol | length | unit | function | …
      {"03 reads the f32 test words", hex({0, 1, 0, 0, 0, 6, 255, 3, 0, 10, 0, 2}),
       hex({0, 1, 0, 0, 0, 7, 255, 3, 4, 0x47, 0xF1, 0x20, 0x00})},
      {"04 reads the same words", hex({0, 2, 0, 0, 0, 6, 1, 4, 0, 10, 0, 2}),
       hex({0, 2, 0, 0, 0, 7, 1, 4, 4, 0x47, 0xF1, 0x20, 0x00})},
      {"03 reads u32, unit 0 echoed", hex({0x12, 0x34, 0, 0, 0, 6, 0, 3, 0, 12, 0, 2}),
       hex({0x12, 0x34, 0, 0, 0, 7, 0, 3, 4, 1, 2, 3, 4})},
      {"03 boot count", hex({0, 3, 0, 0, 0, 6, 255, 3, 0, 14, 0, 1}), hex({0, 3, 0, 0, 0, 5, 255, 3, 2, 0, 7})},
      {"06 writes one word", hex({0, 4, 0, 0, 0, 6, 255, 6, 0, 2, 0, 9}), hex({0, 4, 0, 0, 0, 6, 255, 6, 0, 2, 0, 9})},
      {"16 writes two words", hex({0, 5, 0, 0, 0, 11, 255, 16, 0, 1, 0, 2, 4, 0, 1, 0, 2}),
       hex({0, 5, 0, 0, 0, 6, 255, 16, 0, 1, 0, 2})},
      {"16 writes one word", hex({0, 5, 0, 0, 0, 9, 255, 16, 0, 1, 0, 1, 2, 0, 1}),
       hex({0, 5, 0, 0, 0, 6, 255, 16, 0, 1, 0, 1})},
      {"23 writes, then reads", hex({0, 6, 0, 0, 0, 13, 255, 23, 0, 2, 0, 1, 0, 2, 0, 1, 2, 0, 0x55}),
       hex({0, 6, 0, 0, 0, 5, 255, 23, 2, 0, 0x55})},
      {"8/0 echoes", hex({0, 7, 0, 0, 0, 6, 255, 8, 0, 0, 0xA5, 0x37}),
       hex({0, 7, 0, 0, 0, 6, 255, 8, 0, 0, 0xA5, 0x37})},
      // Exceptions: function | 0x80, code 1 function, 2 address, 3 value.
      {"03 count 0", hex({0, 1, 0, 0, 0, 6, 255, 3, 0, 0, 0, 0}), hex({0, 1, 0, 0, 0, 3, 255, 0x83, 3})},
      {"03 count 126", hex({0, 1, 0, 0, 0, 6, 255, 3, 0, 0, 0, 126}), hex({0, 1, 0, 0, 0, 3, 255, 0x83, 3})},
      {"03 past the end", hex({0, 1, 0, 0, 0, 6, 255, 3, 0, 87, 0, 2}), hex({0, 1, 0, 0, 0, 3, 255, 0x83, 2})},
      {"03 address 65535", hex({0, 1, 0, 0, 0, 6, 255, 3, 255, 255, 0, 1}), hex({0, 1, 0, 0, 0, 3, 255, 0x83, 2})},
      {"03 too short", hex({0, 1, 0, 0, 0, 5, 255, 3, 0, 0, 0}), hex({0, 1, 0, 0, 0, 3, 255, 0x83, 3})},
      {"03 too long", hex({0, 1, 0, 0, 0, 7, 255, 3, 0, 0, 0, 1, 0}), hex({0, 1, 0, 0, 0, 3, 255, 0x83, 3})},
      {"06 a status word", hex({0, 1, 0, 0, 0, 6, 255, 6, 0, 17, 0, 1}), hex({0, 1, 0, 0, 0, 3, 255, 0x86, 2})},
      {"16 into the status block", hex({0, 1, 0, 0, 0, 11, 255, 16, 0, 7, 0, 2, 4, 0, 0, 0, 0}),
       hex({0, 1, 0, 0, 0, 3, 255, 0x90, 2})},
      {"16 byte count does not fit", hex({0, 1, 0, 0, 0, 11, 255, 16, 0, 0, 0, 2, 5, 0, 0, 0, 0}),
       hex({0, 1, 0, 0, 0, 3, 255, 0x90, 3})},
      {"16 fewer bytes than said", hex({0, 1, 0, 0, 0, 9, 255, 16, 0, 0, 0, 2, 4, 0, 0}),
       hex({0, 1, 0, 0, 0, 3, 255, 0x90, 3})},
      {"16 count 124", hex({0, 1, 0, 0, 0, 7, 255, 16, 0, 0, 0, 124, 248}), hex({0, 1, 0, 0, 0, 3, 255, 0x90, 3})},
      {"23 write below", hex({0, 1, 0, 0, 0, 13, 255, 23, 0, 0, 0, 1, 0, 8, 0, 1, 2, 0, 0}),
       hex({0, 1, 0, 0, 0, 3, 255, 0x97, 2})},
      {"23 read past the end", hex({0, 1, 0, 0, 0, 13, 255, 23, 0, 88, 0, 1, 0, 0, 0, 1, 2, 0, 0}),
       hex({0, 1, 0, 0, 0, 3, 255, 0x97, 2})},
      {"23 write count 122", hex({0, 1, 0, 0, 0, 11, 255, 23, 0, 0, 0, 1, 0, 0, 0, 122, 244}),
       hex({0, 1, 0, 0, 0, 3, 255, 0x97, 3})},
      {"8/1 restart is refused", hex({0, 1, 0, 0, 0, 6, 255, 8, 0, 1, 0, 0}), hex({0, 1, 0, 0, 0, 3, 255, 0x88, 1})},
      {"8 without sub-function", hex({0, 1, 0, 0, 0, 2, 255, 8}), hex({0, 1, 0, 0, 0, 3, 255, 0x88, 3})},
      {"7, where libmodbus keeps silent", hex({0, 1, 0, 0, 0, 2, 255, 7}), hex({0, 1, 0, 0, 0, 3, 255, 0x87, 1})},
      {"17, which names the library", hex({0, 1, 0, 0, 0, 2, 255, 17}), hex({0, 1, 0, 0, 0, 3, 255, 0x91, 1})},
      {"22 mask write", hex({0, 1, 0, 0, 0, 8, 255, 22, 0, 0, 255, 255, 0, 0}), hex({0, 1, 0, 0, 0, 3, 255, 0x96, 1})},
      {"43", hex({0, 1, 0, 0, 0, 5, 255, 43, 14, 1, 0}), hex({0, 1, 0, 0, 0, 3, 255, 0xAB, 1})},
      {"1 coils", hex({0, 1, 0, 0, 0, 6, 255, 1, 0, 0, 0, 1}), hex({0, 1, 0, 0, 0, 3, 255, 0x81, 1})},
      {"0", hex({0, 1, 0, 0, 0, 2, 255, 0}), hex({0, 1, 0, 0, 0, 3, 255, 0x80, 1})},
      {"255", hex({0, 1, 0, 0, 0, 2, 255, 255}), hex({0, 1, 0, 0, 0, 3, 255, 0xFF, 1})},
  };
}
}  // namespace

TEST(Guard, DialoguesAreAnsweredByteForByte) {
  for (const auto& [name, request, answer] : dialogues()) EXPECT_EQ(Rig{}.exchange(request), answer) << name;
}

TEST(Guard, EveryFrameSplitAtEveryByte) {
  for (const auto& [name, request, answer] : dialogues()) {
    for (std::size_t cut = 1; cut < request.size(); ++cut) {
      Rig rig;
      const ByteView bytes{request};
      rig.session.on_bytes(1, bytes.first(cut), rig.now);
      EXPECT_TRUE(rig.session.take_output(1).empty()) << name << " cut at " << cut;
      EXPECT_EQ(rig.exchange(Bytes(bytes.begin() + static_cast<std::ptrdiff_t>(cut), bytes.end())), answer)
          << name << " cut at " << cut;
    }
  }
}

TEST(Guard, FramesInOneSegmentAreAnsweredInOrder) {
  Rig rig;
  Bytes two = hex({0, 1, 0, 0, 0, 6, 255, 3, 0, 14, 0, 1});
  append(two, hex({0, 2, 0, 0, 0, 6, 255, 3, 0, 12, 0, 2}));
  Bytes expected = hex({0, 1, 0, 0, 0, 5, 255, 3, 2, 0, 7});
  append(expected, hex({0, 2, 0, 0, 0, 7, 255, 3, 4, 1, 2, 3, 4}));
  EXPECT_EQ(rig.exchange(two), expected);
}

TEST(Guard, WhatCanNeverBecomeAFrameIsSeenAtTheFirstWrongByte) {
  struct Case {
    Bytes bytes;
    FrameError::Kind kind;
    std::string text;
  };
  for (const auto& [bytes, kind, text] : {
           Case{hex({0, 1, 0, 7}), FrameError::Kind::ProtocolId, "protocol id 7 is not Modbus (0)"},
           Case{hex({0, 1, 0, 0, 0, 1}), FrameError::Kind::Length, "length field 1 is outside 2 … 254"},
           Case{hex({0, 1, 0, 0, 0, 255}), FrameError::Kind::Length, "length field 255 is outside 2 … 254"},
           Case{hex({0, 1, 0, 0, 0xFF, 0xFF}), FrameError::Kind::Length, "length field 65535 is outside 2 … 254"},
       }) {
    FrameBuffer buffer;
    buffer.append(ByteView{bytes}.first(bytes.size() - 1));
    if (kind == FrameError::Kind::ProtocolId) {
      ASSERT_TRUE(buffer.take_frame().has_value()) << text;
    }
    buffer.append(ByteView{bytes}.last(1));
    const auto frame = buffer.take_frame();
    ASSERT_FALSE(frame.has_value()) << text;
    EXPECT_EQ(frame.error().kind, kind);
    EXPECT_EQ(to_string(frame.error()), text);
    EXPECT_TRUE(buffer.has_frame()) << "the error is there to be taken";
  }
}

TEST(Guard, AnIncompleteFrameConsumesNothing) {
  FrameBuffer buffer;
  const Bytes frame = hex({0, 1, 0, 0, 0, 6, 255, 3, 0, 14, 0, 1});
  for (std::size_t n = 0; n < frame.size(); ++n) {
    const auto taken = buffer.take_frame();
    ASSERT_TRUE(taken.has_value());
    EXPECT_FALSE(taken->has_value()) << n;
    EXPECT_FALSE(buffer.has_frame());
    EXPECT_EQ(buffer.size(), n);
    buffer.append(ByteView{frame}.subspan(n, 1));
  }
  EXPECT_TRUE(buffer.has_frame());
  EXPECT_EQ(**buffer.take_frame(), frame);
  EXPECT_EQ(buffer.size(), 0U);
}

TEST(Guard, WaitingBytesHaveALimit) {
  FrameBuffer buffer;
  const Bytes frame = hex({0, 1, 0, 0, 0, 6, 255, 3, 0, 14, 0, 1});
  for (std::size_t n = 0; n + frame.size() <= kPendingBytesMax; n += frame.size()) buffer.append(frame);
  ASSERT_TRUE(buffer.take_frame().has_value());
  buffer.append(Bytes(2 * frame.size()));
  ASSERT_FALSE(buffer.take_frame().has_value());
  EXPECT_LE(buffer.size(), kPendingBytesMax);
}

TEST(Guard, EveryPduOfOneFunctionIsAnsweredWithinBounds) {
  // All functions, short bodies of 0xFF and of 0: whatever passes must be safe for libmodbus, the rest is an exception.
  for (int function = 0; function < 256; ++function) {
    for (const int fill : {0, 1, 255}) {
      for (std::size_t body = 0; body < 20; ++body) {
        Rig rig;
        Bytes frame = hex({0, 1, 0, 0, 0, static_cast<int>(2 + body), 255, function});
        frame.resize(frame.size() + body, static_cast<std::byte>(fill));
        const Bytes answer = rig.exchange(frame);
        ASSERT_GE(answer.size(), 9U) << function;
        EXPECT_EQ(read_be<std::uint16_t>(answer, 4) + 6U, answer.size()) << function;
        EXPECT_EQ(std::to_integer<int>(answer[7]) & 0x7F, function & 0x7F);
      }
    }
  }
}

TEST(Guard, TheBaseAddressMovesTheMap) {
  Options o = test::options();
  o.base_address = 1000;
  Rig rig{o};
  EXPECT_EQ(rig.exchange(hex({0, 1, 0, 0, 0, 6, 255, 3, 0x03, 0xE7, 0, 1})), hex({0, 1, 0, 0, 0, 3, 255, 0x83, 2}))
      << "999 is before the map";
  EXPECT_EQ(rig.exchange(hex({0, 1, 0, 0, 0, 6, 255, 3, 0x03, 0xF6, 0, 1})), hex({0, 1, 0, 0, 0, 5, 255, 3, 2, 0, 7}))
      << "1000 + 14 is the boot count";
  EXPECT_EQ(rig.exchange(hex({0, 1, 0, 0, 0, 6, 255, 6, 0x03, 0xE8, 0, 1})),
            hex({0, 1, 0, 0, 0, 6, 255, 6, 0x03, 0xE8, 0, 1}));
  EXPECT_EQ(rig.exchange(hex({0, 1, 0, 0, 0, 6, 255, 6, 0, 0, 0, 1})), hex({0, 1, 0, 0, 0, 3, 255, 0x86, 2}));
  EXPECT_EQ(rig.word(at("plc_heartbeat")), 1);
}
}  // namespace binpick::plc::modbus
