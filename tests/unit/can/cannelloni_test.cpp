#include "drivers/link/cannelloni.hpp"

#include <gtest/gtest.h>
#include <random>
#include <string>
#include <vector>

/// Byte tables typed from cannelloni's own description (doc/udp_format.md), not made by our encoder.
namespace binpick::drivers::link {
namespace {
using cannelloni::DecodeError;

Bytes hex(const std::string& text) {
  Bytes bytes;
  for (std::size_t at = 0; at + 1 < text.size(); at += 3)
    bytes.push_back(static_cast<std::byte>(std::stoul(text.substr(at, 2), nullptr, 16)));
  return bytes;
}

CanFrame frame(std::uint32_t id, std::vector<std::uint8_t> payload) {
  CanFrame f;
  f.id = id;
  f.length = static_cast<std::uint8_t>(payload.size());
  std::copy(payload.begin(), payload.end(), f.payload.begin());
  return f;
}

// version 2, data, sequence 5, two frames: 50C [2] 01 95, 70C [8] 07 95 00 00 48 41 03 00
const char* const kTwoFrames =
    "02 00 05 00 02 "
    "00 00 05 0C 02 01 95 "
    "00 00 07 0C 08 07 95 00 00 48 41 03 00";

TEST(Cannelloni, TwoFramesBothWays) {
  const std::vector<CanFrame> frames{frame(0x50C, {0x01, 0x95}),
                                     frame(0x70C, {0x07, 0x95, 0x00, 0x00, 0x48, 0x41, 0x03, 0x00})};
  EXPECT_EQ(cannelloni::encode(5, frames), hex(kTwoFrames));
  const auto datagram = cannelloni::decode(hex(kTwoFrames));
  ASSERT_TRUE(datagram);
  EXPECT_EQ(datagram->sequence, 5);
  EXPECT_EQ(datagram->frames, frames);
}

TEST(Cannelloni, RemoteRequestCarriesItsLengthAndNoPayload) {
  CanFrame rtr;
  rtr.id = 0x18FF1234;
  rtr.extended = rtr.rtr = true;
  rtr.length = 8;
  const Bytes bytes = hex("02 00 06 00 01 D8 FF 12 34 08");  // 0x80000000 extended, 0x40000000 remote
  EXPECT_EQ(cannelloni::encode(6, std::vector{rtr}), bytes);
  const auto datagram = cannelloni::decode(bytes);
  ASSERT_TRUE(datagram);
  EXPECT_EQ(datagram->frames, std::vector{rtr});
}

TEST(Cannelloni, FdFramesAreReadOver) {
  // sequence 7: CAN FD 123, flags 01, AA BB; then a classic frame
  const auto datagram = cannelloni::decode(hex("02 00 07 00 02 00 00 01 23 82 01 AA BB 00 00 00 AC 01 0A"));
  ASSERT_TRUE(datagram);
  EXPECT_EQ(datagram->fd_frames, 1U);
  EXPECT_EQ(datagram->frames, std::vector{frame(0x0AC, {0x0A})});
}

TEST(Cannelloni, ErrorFramesPass) {
  CanFrame bus_off = frame(0x040, {0, 0, 0, 0, 0, 0, 0, 0});
  bus_off.error = true;
  const Bytes bytes = hex("02 00 00 00 01 20 00 00 40 08 00 00 00 00 00 00 00 00");
  EXPECT_EQ(cannelloni::encode(0, std::vector{bus_off}), bytes);
  const auto datagram = cannelloni::decode(bytes);
  ASSERT_TRUE(datagram);
  EXPECT_EQ(datagram->frames, std::vector{bus_off});
}

TEST(Cannelloni, NoFramesIsAnEmptyDatagram) {
  const auto datagram = cannelloni::decode(hex("02 00 09 00 00"));
  ASSERT_TRUE(datagram);
  EXPECT_TRUE(datagram->frames.empty());
}

struct Bad {
  const char* name;
  const char* bytes;
  DecodeError::Kind kind;
  std::size_t offset;
};
class CannelloniBad : public testing::TestWithParam<Bad> {};

TEST_P(CannelloniBad, SaysWhatAndWhere) {
  const auto datagram = cannelloni::decode(hex(GetParam().bytes));
  ASSERT_FALSE(datagram);
  EXPECT_EQ(datagram.error().kind, GetParam().kind) << to_string(datagram.error());
  EXPECT_EQ(datagram.error().offset, GetParam().offset);
}

INSTANTIATE_TEST_SUITE_P(
    Table, CannelloniBad,
    testing::Values(Bad{"Version1", "01 00 00 00 00", DecodeError::Kind::Version, 0},
                    Bad{"Ack", "02 01 00 00 00", DecodeError::Kind::Operation, 1},
                    Bad{"Nack", "02 02 00 00 00", DecodeError::Kind::Operation, 1},
                    Bad{"ClassicOf9", "02 00 00 00 01 00 00 00 AC 09 01 02 03 04 05 06 07 08 09",
                        DecodeError::Kind::Length, 9},
                    Bad{"FdOf65", "02 00 00 00 01 00 00 00 AC C1 00 01 02", DecodeError::Kind::Length, 9},
                    Bad{"RemoteOf127", "02 00 00 00 01 40 00 00 AC 7F", DecodeError::Kind::Length, 9},
                    Bad{"CountTooLarge", "02 00 00 FF FF 00 00 00 AC 01 02", DecodeError::Kind::Truncated, 11},
                    Bad{"LeftOver", "02 00 00 00 01 00 00 00 AC 01 02 03", DecodeError::Kind::LeftOver, 11}),
    [](const auto& row) { return row.param.name; });

TEST(Cannelloni, EveryTruncationIsSaid) {
  const Bytes whole = hex(kTwoFrames);
  for (std::size_t length = 0; length < whole.size(); ++length) {
    const auto datagram = cannelloni::decode(ByteView{whole}.first(length));
    ASSERT_FALSE(datagram) << length;
    EXPECT_EQ(datagram.error().kind, DecodeError::Kind::Truncated) << length;
  }
}

TEST(Cannelloni, EveryCorruptedByteIsAnErrorOrFramesInRange) {
  const Bytes whole = hex(kTwoFrames);
  for (std::size_t at = 0; at < whole.size(); ++at)
    for (int value = 0; value < 256; ++value) {
      Bytes bytes = whole;
      bytes[at] = static_cast<std::byte>(value);
      const auto datagram = cannelloni::decode(bytes);
      if (!datagram) continue;
      EXPECT_LE(datagram->frames.size(), 2U);
      for (const CanFrame& f : datagram->frames) {
        EXPECT_LE(f.length, 8);
        EXPECT_LE(f.id, 0x1FFFFFFFU);
      }
    }
}

TEST(Cannelloni, WhatIsEncodedIsDecoded) {
  std::mt19937 random{11};
  for (int round = 0; round < 500; ++round) {
    std::vector<CanFrame> frames(random() % (cannelloni::kFramesMax + 1));
    for (CanFrame& f : frames) {
      f.extended = random() % 4 == 0;
      f.id = static_cast<std::uint32_t>(random()) & (f.extended ? 0x1FFFFFFFU : 0x7FFU);
      f.rtr = random() % 8 == 0;
      f.length = static_cast<std::uint8_t>(random() % 9);
      for (std::size_t i = 0; i < f.length && !f.rtr; ++i) f.payload[i] = static_cast<std::uint8_t>(random());
    }
    const Bytes bytes = cannelloni::encode(static_cast<std::uint8_t>(round), frames);
    EXPECT_LE(bytes.size(), 1472U);
    const auto datagram = cannelloni::decode(bytes);
    ASSERT_TRUE(datagram);
    EXPECT_EQ(datagram->frames, frames);
  }
}

TEST(Cannelloni, CountsLostDatagrams) {
  EXPECT_EQ(cannelloni::lost_between(4, 5), 0U);
  EXPECT_EQ(cannelloni::lost_between(4, 7), 2U);
  EXPECT_EQ(cannelloni::lost_between(255, 0), 0U);
  EXPECT_EQ(cannelloni::lost_between(254, 1), 2U);
  EXPECT_EQ(cannelloni::lost_between(5, 5), 0U);  // twice
  EXPECT_EQ(cannelloni::lost_between(5, 4), 0U);  // late
}
}  // namespace
}  // namespace binpick::drivers::link
