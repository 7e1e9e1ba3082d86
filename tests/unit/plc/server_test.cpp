#include <gtest/gtest.h>

#include "plc/modbus_server.hpp"
#include "tests/unit/plc/rig.hpp"

namespace binpick::plc {
namespace {
using test::hex;
using test::LogLines;
using test::Rig;
using namespace std::chrono_literals;

const Bytes kReadBoot = hex({0, 1, 0, 0, 0, 6, 255, 3, 0, 14, 0, 1});
const Bytes kBoot = hex({0, 1, 0, 0, 0, 5, 255, 3, 2, 0, 7});
const Bytes kWriteSequence = hex({0, 2, 0, 0, 0, 6, 255, 6, 0, 1, 0, 9});
const Bytes kRefused = hex({0, 2, 0, 0, 0, 3, 255, 0x86, 6});
}  // namespace

TEST(Server, OnlyLoopbackAndTheAllowedMayConnect) {
  const LogLines lines;
  Rig rig;
  EXPECT_TRUE(rig.session.on_accept(2, "192.168.0.10", 1, rig.now));
  EXPECT_TRUE(rig.session.on_accept(3, "::ffff:192.168.0.10", 1, rig.now)) << "an IPv4 peer of an IPv6 socket";
  EXPECT_TRUE(rig.session.on_accept(4, "::1", 1, rig.now));
  EXPECT_TRUE(rig.session.on_accept(5, "127.9.9.9", 1, rig.now));
  EXPECT_FALSE(rig.session.on_accept(6, "192.168.0.11", 1, rig.now));
  EXPECT_FALSE(rig.session.on_accept(7, "::ffff:192.168.0.11", 1, rig.now));
  EXPECT_FALSE(rig.session.on_accept(8, "fe80::1", 1, rig.now));
  EXPECT_FALSE(rig.session.on_accept(9, "", 1, rig.now));
  for (ConnectionId id = 100; id < 1100; ++id) EXPECT_FALSE(rig.session.on_accept(id, "192.168.0.11", 1, rig.now));
  EXPECT_EQ(lines.count("stranger 192.168.0.11:1 refused"), 1) << "named once";
  EXPECT_EQ(lines.count("stranger"), 3);
}

TEST(Server, AFloodOfStrangersDoesNotFloodTheLog) {
  const LogLines lines;
  Rig rig;
  for (int i = 0; i < 5000; ++i)
    EXPECT_FALSE(
        rig.session.on_accept(10, "10.0." + std::to_string(i / 250) + "." + std::to_string(i % 250), 1, rig.now));
  EXPECT_LE(lines.count("stranger"), 256);
}

TEST(Server, ASecondWriterMayReadAndIsNamedOnce) {
  const LogLines lines;
  Rig rig;
  rig.control(0);
  ASSERT_TRUE(rig.session.on_accept(2, "192.168.0.10", 55, rig.now));
  for (int i = 0; i < 3; ++i) {
    EXPECT_EQ(rig.exchange(kReadBoot, 2), kBoot);
    EXPECT_EQ(rig.exchange(kWriteSequence, 2), kRefused);
  }
  EXPECT_EQ(rig.word(at("sequence")), 0);
  EXPECT_EQ(lines.count("second writer 192.168.0.10:55 refused; 127.0.0.1:40000 writes already"), 1);
  EXPECT_EQ(lines.count("second writer"), 1);
  EXPECT_EQ(rig.first_alarm(), Alarm::PlcSecondWriter);
  EXPECT_TRUE(rig.has(status::kAlarm));
  // FC23 of a second writer neither writes nor reads.
  EXPECT_EQ(rig.exchange(hex({0, 2, 0, 0, 0, 13, 255, 23, 0, 2, 0, 1, 0, 2, 0, 1, 2, 0, 0x55}), 2),
            hex({0, 2, 0, 0, 0, 3, 255, 0x97, 6}));
  EXPECT_EQ(rig.word(at("part_id")), 0);
  rig.session.on_closed(2, rig.now);
  EXPECT_FALSE(rig.has(status::kAlarm));
  EXPECT_EQ(rig.first_alarm(), Alarm::PlcSecondWriter) << "listed until reset";
  rig.control(control::kReset);
  EXPECT_EQ(rig.first_alarm(), Alarm::None);
}

TEST(Server, TheNextWriterMayFollowOneThatClosedOrFellSilent) {
  Rig rig;
  rig.control(0);
  ASSERT_TRUE(rig.session.on_accept(2, "192.168.0.10", 55, rig.now));
  EXPECT_EQ(rig.exchange(kWriteSequence, 2), kRefused);
  rig.session.on_closed(1, rig.now);
  EXPECT_EQ(rig.exchange(kWriteSequence, 2), kWriteSequence);
  ASSERT_TRUE(rig.session.on_accept(3, "127.0.0.1", 56, rig.now));
  EXPECT_EQ(rig.exchange(kWriteSequence, 3), kRefused);
  rig.now += modbus::kWriterSilence - 1ms;
  EXPECT_EQ(rig.exchange(kReadBoot, 3), kBoot);
  EXPECT_EQ(rig.exchange(kWriteSequence, 3), kRefused);
  rig.now += 1ms;
  EXPECT_EQ(rig.exchange(kWriteSequence, 3), kWriteSequence) << "half-open for two seconds: it lost its place";
  EXPECT_EQ(rig.exchange(kWriteSequence, 2), kRefused);
}

TEST(Server, AWriterThatOnlyReadsKeepsItsPlace) {
  Rig rig;
  rig.control(0);
  ASSERT_TRUE(rig.session.on_accept(2, "192.168.0.10", 55, rig.now));
  for (int i = 0; i < 10; ++i) {
    rig.now += 1s;
    EXPECT_EQ(rig.exchange(kReadBoot, 1), kBoot);
    EXPECT_EQ(rig.exchange(kWriteSequence, 2), kRefused);
  }
}

TEST(Server, TheConnectionCapHoldsAndTheIdleMakeRoom) {
  const LogLines lines;
  Rig rig;  // has one of eight
  rig.control(0);
  for (ConnectionId id = 2; id <= 8; ++id) ASSERT_TRUE(rig.session.on_accept(id, "127.0.0.1", 1, rig.now));
  for (ConnectionId id = 9; id < 1009; ++id) EXPECT_FALSE(rig.session.on_accept(id, "127.0.0.1", 1, rig.now));
  EXPECT_EQ(lines.count("all 8 connections are taken"), 1);
  rig.now += 4s;
  for (const ConnectionId id : {2U, 3U, 4U, 6U, 7U, 8U}) EXPECT_EQ(rig.exchange(kReadBoot, id), kBoot);
  rig.now += 1s;
  EXPECT_TRUE(rig.session.on_accept(2000, "127.0.0.1", 1, rig.now));
  EXPECT_TRUE(rig.session.wants_close(5)) << "silent longest";
  EXPECT_FALSE(rig.session.wants_close(1)) << "the writer stays";
  rig.session.on_closed(5, rig.now);
  EXPECT_EQ(rig.exchange(kReadBoot, 2000), kBoot);
}

TEST(Server, ForeignBytesCloseTheirConnectionAlone) {
  const LogLines lines;
  Rig rig;
  for (ConnectionId id = 2; id < 6; ++id) {
    ASSERT_TRUE(rig.session.on_accept(id, "127.0.0.1", 1, rig.now));
    EXPECT_TRUE(rig.exchange(hex({0, 1, 0, 7, 0, 6, 255, 3, 0, 14, 0, 1}), id).empty());
    EXPECT_TRUE(rig.session.wants_close(id));
    rig.session.on_closed(id, rig.now);
  }
  EXPECT_EQ(lines.count("sends no Modbus: protocol id 7 is not Modbus (0); connection closed"), 1);
  EXPECT_FALSE(rig.session.wants_close(1));
  EXPECT_EQ(rig.exchange(kReadBoot), kBoot);
}

/// A bad peer beside a good one in virtual time: whatever the bad one does, the good one's answer comes with the very
/// call that brought its request, at the same instant.
TEST(Server, AHostilePeerNeverDelaysTheGoodOne) {
  const LogLines lines;
  Rig rig;
  rig.control(0);
  ASSERT_TRUE(rig.session.on_accept(2, "127.0.0.1", 666, rig.now));
  const std::vector<Bytes> bad_frames{
      hex({0, 1, 0, 0, 0, 6, 255, 3, 0, 0, 0, 126}),  // wrong count
      hex({0, 1, 0, 0, 0, 11, 255, 16, 0, 0, 0, 9, 4, 0, 0, 0, 0}),
      hex({0, 1, 0, 0, 0, 2, 255, 7}),  // unknown functions
      hex({0, 1, 0, 0, 0, 5, 255, 43, 14, 1, 0}),
      hex({0, 1, 0, 7, 0, 6, 255, 3, 0, 14, 0, 1}),  // protocol id 7
      hex({0, 1, 0, 0, 0xFF, 0xFF, 255, 3}),         // a frame that never ends
  };
  ConnectionId bad = 2;
  std::size_t turn = 0;
  std::size_t sent = 0;
  TimePoint next_byte = rig.now;
  unsigned good_answers = 0;
  for (int ms = 0; ms < 60'000; ms += 20, rig.now += 20ms) {
    if (rig.now >= next_byte) {  // one byte per 0.4 s
      next_byte = rig.now + 400ms;
      const Bytes& frame = bad_frames[turn % bad_frames.size()];
      rig.session.on_bytes(bad, ByteView{frame}.subspan(sent, 1), rig.now);
      rig.session.take_output(bad);
      if (++sent == frame.size()) ++turn, sent = 0;
    } else {  // and whole frames in between, on further connections: 1000 connects in all
      const ConnectionId id = 1000 + static_cast<ConnectionId>(ms);
      if (rig.session.on_accept(id, "127.0.0.1", 667, rig.now)) {
        rig.session.on_bytes(id, bad_frames[static_cast<std::size_t>(ms / 20) % bad_frames.size()], rig.now);
        rig.session.take_output(id);
        rig.session.on_closed(id, rig.now);
      }
    }
    if (rig.session.wants_close(bad)) {
      rig.session.on_closed(bad, rig.now);
      ++bad;
      ASSERT_TRUE(rig.session.on_accept(bad, "127.0.0.1", 666, rig.now));
      ++turn, sent = 0;
    }
    ASSERT_EQ(rig.exchange(kReadBoot), kBoot) << "after " << ms << " ms";
    ++good_answers;
    while (*rig.session.deadline() <= rig.now) rig.session.on_deadline(rig.now);
  }
  EXPECT_EQ(good_answers, 3000U);
  EXPECT_LE(lines.count("sends no Modbus"), 1);
}

TEST(Server, AFloodOfFramesIsServedInTurns) {
  Rig rig;
  ASSERT_TRUE(rig.session.on_accept(2, "127.0.0.1", 666, rig.now));
  Bytes flood;
  for (int i = 0; i < 100; ++i) append(flood, kReadBoot);
  rig.session.on_bytes(2, flood, rig.now);
  EXPECT_EQ(rig.session.take_output(2).size(), modbus::kFramesPerTurn * kBoot.size());
  EXPECT_EQ(rig.exchange(kReadBoot), kBoot) << "the good one's turn";
  std::size_t rest = 0;
  int turns = 0;
  while (*rig.session.deadline() <= rig.now && ++turns < 100) {
    rig.session.on_deadline(rig.now);
    rest += rig.session.take_output(2).size();
  }
  EXPECT_EQ(rest, (100 - modbus::kFramesPerTurn) * kBoot.size()) << "nothing is lost";
  // More than may wait closes the connection.
  for (int i = 0; i < 400; ++i) append(flood, kReadBoot);
  rig.session.on_bytes(2, flood, rig.now);
  EXPECT_TRUE(rig.session.wants_close(2));
}

TEST(Server, ReconfiguringClosesWhoIsNoLongerAllowed) {
  Rig rig;
  ASSERT_TRUE(rig.session.on_accept(2, "192.168.0.10", 1, rig.now));
  Options o = test::options();
  o.allow = {"192.168.0.12"};
  rig.session.reconfigure(o, rig.now);
  EXPECT_TRUE(rig.session.wants_close(2));
  EXPECT_FALSE(rig.session.wants_close(1));
  EXPECT_TRUE(rig.session.on_accept(3, "192.168.0.12", 1, rig.now));
}
}  // namespace binpick::plc
