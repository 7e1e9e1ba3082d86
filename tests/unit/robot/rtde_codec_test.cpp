#include <cmath>
#include <gtest/gtest.h>
#include <limits>
#include <string>

#include "drivers/robot/rtde/codec.hpp"

namespace binpick::drivers::rtde {
namespace {
Bytes bytes_of(std::initializer_list<int> values) {
  Bytes out;
  for (const int value : values) out.push_back(static_cast<std::byte>(value));
  return out;
}

Bytes operator+(Bytes a, std::string_view text) {
  append(a, as_bytes(text));
  return a;
}

// What the client says. Source of all tables where nothing else is said: UniversalRobots/
// Universal_Robots_Client_Library, tests/test_rtde_*.cpp and src/rtde.
struct RequestTelegram {
  const char* what;
  Request request;
  Bytes bytes;
};
std::vector<RequestTelegram> requests() {
  return {
      {"protocol version", RequestVersion{2},
       bytes_of({0x00, 0x05,                                                         // size, header included
                 0x56,                                                               // 'V'
                 0x00, 0x02})},                                                      // version 2
      {"controller version", GetControllerVersion{}, bytes_of({0x00, 0x03, 0x76})},  // test_rtde_get_urcontrol_version
      {"outputs", SetupOutputs{500, {"actual_q", "actual_qd"}},
       bytes_of({0x00, 0x1d,                                         // 29
                 0x4f,                                               // 'O'
                 0x40, 0x7f, 0x40, 0x00, 0x00, 0x00, 0x00, 0x00}) +  // 500.0
           "actual_q,actual_qd"},                                    // test_rtde_control_package_setup_outputs
      {"start", Start{}, bytes_of({0x00, 0x03, 0x53})},
      {"pause", Pause{}, bytes_of({0x00, 0x03, 0x50})},
  };
}

// What the controller says.
struct ReplyTelegram {
  const char* what;
  Reply reply;
  Bytes bytes;
};
std::vector<ReplyTelegram> replies() {
  return {
      {"version accepted", VersionAnswer{true}, bytes_of({0x00, 0x04, 0x56, 0x01})},  // test_rtde_parser
      {"version refused", VersionAnswer{false}, bytes_of({0x00, 0x04, 0x56, 0x00})},
      {"controller 5.8.0-0", ControllerVersion{5, 8, 0, 0},
       bytes_of({0x00, 0x13,                 // 19
                 0x76,                       // 'v'
                 0x00, 0x00, 0x00, 0x05,     // major
                 0x00, 0x00, 0x00, 0x08,     // minor
                 0x00, 0x00, 0x00, 0x00,     // bugfix
                 0x00, 0x00, 0x00, 0x00})},  // build; test_rtde_parser
      {"outputs accepted", OutputsAnswer{1, {"DOUBLE", "VECTOR6D"}},
       bytes_of({0x00, 0x13, 0x4f, 0x01}) + "DOUBLE,VECTOR6D"},  // the size is that of these bytes
      {"outputs refused", OutputsAnswer{0, {"NOT_FOUND", "VECTOR6D"}},
       bytes_of({0x00, 0x16, 0x4f, 0x00}) + "NOT_FOUND,VECTOR6D"},
      {"started", StartAnswer{true}, bytes_of({0x00, 0x04, 0x53, 0x01})},
      {"paused", PauseAnswer{true}, bytes_of({0x00, 0x04, 0x50, 0x01})},
      {"text", TextMessage{"Hello", "Safety", 2},
       (bytes_of({0x00, 0x11, 0x4d, 0x05}) + "Hello" + std::string_view("\x06", 1) + "Safety") +
           std::string_view("\x02", 1)},
      {"data",
       Values{1, bytes_of(
                     {0x40, 0xd0, 0x07, 0x0d, 0x2f, 0x1a, 0x9f, 0xbe, 0x3f, 0xf0, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00})},
       bytes_of({0x00, 0x14, 0x55, 0x01,                             // 20, 'U', recipe 1
                 0x40, 0xd0, 0x07, 0x0d, 0x2f, 0x1a, 0x9f, 0xbe,     // 16412.2059...
                 0x3f, 0xf0, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00})},  // 1.0; test_rtde_parser
  };
}

const std::vector<Field> kRecipe{Field::Timestamp, Field::TcpPose,    Field::TcpOffset,
                                 Field::RobotMode, Field::SafetyMode, Field::RuntimeState};

/// timestamp 16854.1919 and a pose with the six numbers of test_rtde_data_package.
Bytes sample_bytes() {
  return bytes_of({0x40, 0xd0, 0x75, 0x8c, 0x49, 0xba, 0x5e, 0x35,  // timestamp
                   0xbf, 0xf9, 0x9c, 0x77, 0xd1, 0x10, 0xb4, 0x60,  // x -1.6007 m
                   0xbf, 0xfb, 0xa2, 0x33, 0xd1, 0x10, 0xb4, 0x60,  // y -1.7271
                   0xc0, 0x01, 0x9f, 0xbe, 0x68, 0x88, 0x5a, 0x30,  // z -2.203
                   0xbf, 0xe9, 0xdb, 0x22, 0xa2, 0x21, 0x68, 0xc0,  // rx -0.808
                   0x3f, 0xf9, 0x85, 0x87, 0xa0, 0x00, 0x00, 0x00,  // ry 1.5951
                   0xbf, 0x9f, 0xbe, 0x74, 0x44, 0x2d, 0x18, 0x00,  // rz -0.031
                   0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00,  // offset x 0
                   0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00,  //
                   0x3f, 0xc7, 0x0a, 0x3d, 0x70, 0xa3, 0xd7, 0x0a,  // z 0.18
                   0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00,  //
                   0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00,  //
                   0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00,  //
                   0x00, 0x00, 0x00, 0x07,                          // robot_mode: running
                   0x00, 0x00, 0x00, 0x01,                          // safety_mode: normal
                   0x00, 0x00, 0x00, 0x02});                        // runtime_state: playing
}
}  // namespace

TEST(RtdeCodec, EachRequestIsTheseBytesAndIsReadBack) {
  for (const RequestTelegram& t : requests()) {
    SCOPED_TRACE(t.what);
    EXPECT_EQ(encode(t.request), t.bytes);
    const auto decoded = decode_request(t.bytes);
    ASSERT_TRUE(decoded && *decoded);
    EXPECT_EQ((*decoded)->consumed, t.bytes.size());
    EXPECT_EQ((*decoded)->message.index(), t.request.index());
    EXPECT_EQ(encode((*decoded)->message), t.bytes);
  }
}

TEST(RtdeCodec, EachReplyIsTheseBytesAndIsReadBack) {
  for (const ReplyTelegram& t : replies()) {
    SCOPED_TRACE(t.what);
    EXPECT_EQ(encode(t.reply), t.bytes);
    const auto decoded = decode_reply(t.bytes);
    ASSERT_TRUE(decoded && *decoded);
    EXPECT_EQ((*decoded)->consumed, t.bytes.size());
    EXPECT_EQ((*decoded)->message.index(), t.reply.index());
    EXPECT_EQ(encode((*decoded)->message), t.bytes);
  }
}

TEST(RtdeCodec, EachPrefixWaitsForTheRest) {
  for (const ReplyTelegram& t : replies())
    for (std::size_t n = 0; n < t.bytes.size(); ++n) {
      const auto decoded = decode_reply(ByteView{t.bytes}.first(n));
      ASSERT_TRUE(decoded.has_value()) << t.what << " " << n;
      ASSERT_FALSE(decoded->has_value()) << t.what << " " << n;
    }
  for (const RequestTelegram& t : requests())
    for (std::size_t n = 0; n < t.bytes.size(); ++n) {
      const auto decoded = decode_request(ByteView{t.bytes}.first(n));
      ASSERT_TRUE(decoded.has_value() && !decoded->has_value()) << t.what << " " << n;
    }
}

TEST(RtdeCodec, WhatFollowsIsLeftAlone) {
  for (const ReplyTelegram& t : replies()) {
    Bytes two = t.bytes;
    append(two, bytes_of({0x00, 0x04, 0x53}));
    const auto decoded = decode_reply(two);
    ASSERT_TRUE(decoded && *decoded) << t.what;
    EXPECT_EQ((*decoded)->consumed, t.bytes.size());
  }
}

TEST(RtdeCodec, EachCorruptedByteIsAnErrorAWaitOrATelegram) {
  for (const ReplyTelegram& t : replies())
    for (std::size_t at = 0; at < t.bytes.size(); ++at)
      for (int value = 0; value < 256; ++value) {
        Bytes corrupted = t.bytes;
        corrupted[at] = static_cast<std::byte>(value);
        const auto decoded = decode_reply(corrupted);
        if (!decoded) {
          EXPECT_FALSE(to_string(decoded.error()).empty());
        } else if (*decoded) {
          ASSERT_LE((*decoded)->consumed, corrupted.size());
          // What was understood can be said again.
          ASSERT_TRUE(decode_reply(encode((*decoded)->message)).has_value()) << t.what;
        }
      }
}

TEST(RtdeCodec, SizesAndTypesThatAreNotOfTheProtocolAreErrors) {
  for (const auto& bytes :
       {bytes_of({0x00, 0x02}), bytes_of({0x00, 0x00}), bytes_of({0x10, 0x01}), bytes_of({0xff, 0xff, 0x55})})
    EXPECT_EQ(decode_reply(bytes).error().kind, DecodeError::Kind::BadSize);
  EXPECT_EQ(decode_reply(bytes_of({0x00, 0x05, 0x02, 0x00, 0x00})).error().kind, DecodeError::Kind::UnknownType);
  EXPECT_EQ(decode_reply(bytes_of({0x00, 0x05, 0x56, 0x01, 0x01})).error().kind, DecodeError::Kind::BadPayload);
  EXPECT_EQ(decode_reply(bytes_of({0x00, 0x04, 0x76, 0x01})).error().kind, DecodeError::Kind::BadPayload);
  EXPECT_EQ(decode_reply(as_bytes("HTTP/1.0 400 Bad Request\r\n")).error().kind, DecodeError::Kind::BadSize);
}

TEST(RtdeCodec, ATextFromBeforeTheVersionIsAgreedIsReadToo) {
  const auto decoded = decode_reply(bytes_of({0x00, 0x09, 0x4d, 0x03}) + "hello");  // version 1: type, text
  ASSERT_TRUE(decoded && *decoded);
  EXPECT_EQ(std::get<TextMessage>((*decoded)->message).text, "hello");
}

TEST(RtdeCodec, ASampleIsTheseBytesInTheOrderOfItsRecipe) {
  const auto sample = decode_sample(kRecipe, sample_bytes());
  ASSERT_TRUE(sample.has_value());
  EXPECT_NEAR(sample->timestamp_s, 16854.1919, 1e-4);
  const double expected[] = {-1.6007, -1.7271, -2.203, -0.808, 1.5951, -0.031};
  for (std::size_t i = 0; i < 6; ++i) EXPECT_NEAR(sample->tcp_pose[i], expected[i], 1e-4) << i;
  ASSERT_TRUE(sample->tcp_offset.has_value());
  EXPECT_NEAR((*sample->tcp_offset)[2], 0.18, 1e-12);
  EXPECT_EQ(sample->robot_mode, 7);
  EXPECT_EQ(sample->safety_mode, 1);
  EXPECT_EQ(sample->runtime_state, 2U);
  EXPECT_EQ(encode_sample(kRecipe, *sample), sample_bytes());
  const Bytes whole = encode(Values{1, sample_bytes()});
  EXPECT_EQ(whole.size(), 3U + 1U + 8U + 48U + 48U + 12U);

  const auto small =
      decode_sample({Field::RobotMode, Field::Timestamp}, encode_sample({Field::RobotMode, Field::Timestamp}, *sample));
  ASSERT_TRUE(small.has_value());
  EXPECT_EQ(small->robot_mode, 7);
  EXPECT_FALSE(small->tcp_offset.has_value());
}

TEST(RtdeCodec, SamplesOfAnotherLengthOrWithoutMeaningAreErrors) {
  for (std::size_t n = 0; n < sample_bytes().size(); ++n)
    EXPECT_EQ(decode_sample(kRecipe, ByteView{sample_bytes()}.first(n)).error().kind, DecodeError::Kind::BadPayload);
  EXPECT_FALSE(decode_sample(kRecipe, sample_bytes() + "x"));
  const Sample good = decode_sample(kRecipe, sample_bytes()).value();
  const auto refused = [&](auto change) {
    Sample bad = good;
    change(bad);
    return !decode_sample(kRecipe, encode_sample(kRecipe, bad)).has_value();
  };
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_TRUE(refused([&](Sample& s) { s.timestamp_s = nan; }));
  EXPECT_TRUE(refused([&](Sample& s) { s.timestamp_s = -1; }));
  EXPECT_TRUE(refused([&](Sample& s) { s.tcp_pose[4] = nan; }));
  EXPECT_TRUE(refused([&](Sample& s) { s.tcp_pose[0] = 1200; }));  // millimetres?
  EXPECT_TRUE(refused([&](Sample& s) { s.tcp_pose[5] = 90; }));    // degrees?
  EXPECT_TRUE(refused([&](Sample& s) { (*s.tcp_offset)[1] = std::numeric_limits<double>::infinity(); }));
}

TEST(RtdeCodec, EachCorruptedByteOfASampleIsAnErrorOrAPoseInRange) {
  const Bytes good = sample_bytes();
  for (std::size_t at = 0; at < good.size(); ++at)
    for (int value = 0; value < 256; ++value) {
      Bytes corrupted = good;
      corrupted[at] = static_cast<std::byte>(value);
      const auto sample = decode_sample(kRecipe, corrupted);
      if (!sample) continue;
      for (std::size_t i = 0; i < 6; ++i) ASSERT_LE(std::abs(sample->tcp_pose[i]), 100);
    }
}
}  // namespace binpick::drivers::rtde
