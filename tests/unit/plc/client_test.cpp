#include "tests/unit/plc/server_rig.hpp"

/// The cell as the client of a Modbus server in the PLC.
namespace binpick::plc {
namespace {
using test::client_options;
using test::hex;
using test::LogLines;
using test::ServerRig;
using namespace std::chrono_literals;

constexpr std::size_t kFlags = at("status");
}  // namespace

TEST(Client, TheFirstExchangeByteForByte) {
  ServerRig rig;
  rig.session.set_not_ready(0, rig.now);
  rig.connect();
  ASSERT_EQ(rig.requests.size(), 3U);
  // transaction | protocol | length | unit | function | address | count | bytes
  EXPECT_EQ(rig.requests[0], hex({0, 1, 0, 0, 0, 6, 255, 3, 0, 0, 0, 88}));
  ASSERT_EQ(rig.requests[1].size(), 13U + 2 * 80);
  EXPECT_TRUE(
      std::ranges::equal(ByteView{rig.requests[1]}.first(13), hex({0, 2, 0, 0, 0, 167, 255, 16, 0, 8, 0, 80, 160})));
  EXPECT_EQ(rig.requests[2], hex({0, 3, 0, 0, 0, 9, 255, 16, 0, 17, 0, 1, 2, 0, 1})) << "ready, last of all";
  EXPECT_EQ(rig.words[at("map_version")], 2);
  EXPECT_EQ(rig.words[at("test_f32")], 0x47F1);
  EXPECT_EQ(rig.words[at("boot_count")], 7);
  EXPECT_TRUE(rig.session.told());
}

TEST(Client, BaseAddressUnitAndWordOrderAreTheCellFiles) {
  Options o = client_options();
  o.base_address = 0x0200;
  o.unit_id = 1;
  o.word_order = WordOrder::LowWordFirst;
  Session session{o, 1};
  const TimePoint now{1000s};
  session.on_connected(now);
  session.on_deadline(now);
  EXPECT_EQ(session.take_output(), hex({0, 1, 0, 0, 0, 6, 1, 3, 2, 0, 0, 88}));
  Bytes reply = hex({0, 1, 0, 0, 0, 179, 1, 3, 176});
  reply.resize(reply.size() + 176);
  session.on_bytes(reply, now);
  const Bytes write = session.take_output();
  ASSERT_GE(write.size(), 25U);
  EXPECT_TRUE(std::ranges::equal(ByteView{write}.subspan(7, 6), hex({16, 2, 8, 0, 80, 160})));
  EXPECT_TRUE(std::ranges::equal(ByteView{write}.subspan(17, 4), hex({0x20, 0x00, 0x47, 0xF1})));
}

TEST(Client, ARequestThatStandsWhenTheCellComesUpIsNotCarriedOut) {
  ServerRig rig;
  rig.words[at("sequence")] = 5;
  rig.words[at("part_id")] = rig.words[at("supply_id")] = 1;
  rig.words[at("control")] = control::kRequest | control::kRobotClear;
  rig.session.set_not_ready(0, rig.now);
  rig.connect();
  EXPECT_EQ(rig.requests.size(), 3U) << "and before all is written, it is not even answered";
  EXPECT_FALSE(rig.has(status::kAck));
  rig.run_for(100ms);
  EXPECT_EQ(rig.events(), "");
  EXPECT_TRUE(rig.has(status::kAck) && rig.has(status::kResultValid));
  EXPECT_EQ(rig.words[at("result_code")], 30);
  rig.drop();
  rig.request(6);
  EXPECT_EQ(rig.events(), "A6 ");
}

TEST(Client, ARequestThatWasZeroAtTheFirstLookIsBelievedLater) {
  ServerRig rig;
  rig.session.set_not_ready(0, rig.now);
  rig.connect();
  rig.request(1);
  EXPECT_EQ(rig.events(), "A1 ");
  EXPECT_TRUE(rig.has(status::kAck) && rig.has(status::kBusy));
  EXPECT_EQ(rig.words[at("ack_sequence")], 1);
}

TEST(Client, ARequestThatStandsAfterABrokenLineIsTheSameOrANewOne) {
  ServerRig rig;
  rig.ready();
  rig.connect();
  rig.request(1);
  EXPECT_EQ(rig.events(), "A1 ");
  rig.disconnect();
  rig.run_for(1s);
  rig.connect();
  rig.run_for(2s);
  EXPECT_EQ(rig.events(), "") << "no second sweep";
  EXPECT_TRUE(rig.has(status::kAck) && rig.has(status::kBusy));
  rig.disconnect();
  rig.session.on_scan_done(rig.now);
  rig.session.publish(test::Rig::pick(77), rig.now);
  rig.words[at("sequence")] = 2;  // raised while the line was down
  rig.connect();
  while (rig.words[at("pick_id")] != 77 && rig.now < TimePoint{1010s}) rig.run_for(5ms);
  EXPECT_EQ(rig.words[at("pick_id")], 77) << "first everything is written";
  rig.run_for(100ms);
  EXPECT_EQ(rig.events(), "A2 ");
}

TEST(Client, ABlockThatIsBeingWrittenCountsWhenItIsReadAgain) {
  ServerRig rig;
  rig.ready();
  rig.connect();
  rig.request(1);
  rig.drop();
  rig.session.on_scan_done(rig.now);
  rig.session.publish(test::Rig::pick(77), rig.now);
  rig.run_for(100ms);
  EXPECT_EQ(rig.events(), "A1 ");
  // The PLC's program has the bit there, the number not yet: with the old one it would be a repeated request.
  int reads = 0;
  rig.words[at("control")] = control::kRequest | control::kRobotClear;
  rig.spoil = [&](Bytes& reply) {
    if (reply[7] == std::byte{3} && ++reads == 1) rig.words[at("sequence")] = 2;
  };
  rig.run_for(100ms);
  EXPECT_EQ(rig.events(), "A2 ");
}

TEST(Client, DataGoBeforeTheirFlagAndFlagsFallBeforeTheirData) {
  ServerRig rig;
  rig.ready();
  rig.connect();
  rig.request(1);
  rig.drop();
  rig.session.on_scan_done(rig.now);
  rig.run_for(100ms);
  EXPECT_TRUE(rig.has(status::kScanDone));
  rig.session.publish(test::Rig::pick(77), rig.now);
  rig.run_for(100ms);
  EXPECT_TRUE(rig.has(status::kResultValid));
  rig.requests.clear();
  rig.request(2);  // at once, over the result
  std::vector<std::string> writes;
  for (const Bytes& frame : rig.requests) {
    if (frame[7] != std::byte{16}) continue;
    const auto first = read_be<std::uint16_t>(frame, 8), count = read_be<std::uint16_t>(frame, 10);
    const auto flags = read_be<std::uint16_t>(frame, 13 + 2 * (kFlags - first));
    writes.push_back(std::to_string(first) + "+" + std::to_string(count) +
                     (flags & status::kResultValid ? " valid" : "") + (flags & status::kScanDone ? " scan_done" : "") +
                     (flags & status::kAck ? " ack" : ""));
  }
  ASSERT_GE(writes.size(), 3U);
  EXPECT_EQ(writes[0], "17+1");
  EXPECT_EQ(writes[1], "8+80");
  EXPECT_EQ(writes[2], "17+1 ack");
}

TEST(Client, HeartbeatsBothWays) {
  ServerRig rig;
  rig.ready();
  rig.connect();
  const auto before = rig.words[at("cell_heartbeat")];
  rig.run_for(10s);
  EXPECT_EQ(rig.words[at("cell_heartbeat")] - before, 20);
  EXPECT_EQ(rig.events(), "");
  rig.beating = false;
  rig.run_for(3200ms);
  EXPECT_EQ(rig.events(), "L ");
  EXPECT_EQ(rig.words[at("first_alarm")], static_cast<std::uint16_t>(Alarm::PlcHeartbeatStopped));
  rig.beating = true;
  rig.run_for(100ms);
  EXPECT_EQ(rig.events(), "B ");
}

TEST(Client, WhoeverElseWritesTheCellsWordsIsNamedAndOverwritten) {
  const LogLines log;
  ServerRig rig;
  rig.ready();
  rig.connect();
  for (int i = 0; i < 5; ++i) {
    rig.words[at("map_version")] = 9;
    rig.run_for(100ms);
    EXPECT_EQ(rig.words[at("map_version")], 2);
  }
  EXPECT_EQ(log.count("192.168.0.10:502, unit 255: word 8 is not as it was written"), 1);
  EXPECT_EQ(rig.reopened, 0);
}

TEST(Client, WhatIsWithdrawnAtTheEndIsToldBeforeTheEnd) {
  ServerRig rig;
  rig.ready();
  rig.connect();
  EXPECT_TRUE(rig.session.told());
  rig.session.set_not_ready(static_cast<std::uint16_t>(NotReady::Stopping), rig.now);
  EXPECT_FALSE(rig.session.told());
  rig.run_for(50ms);
  EXPECT_TRUE(rig.session.told());
  EXPECT_FALSE(rig.has(status::kReady));
}
}  // namespace binpick::plc
