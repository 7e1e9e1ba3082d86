#include "tests/unit/plc/server_rig.hpp"

/// What a server in the PLC may do wrong, and how the cell gets over it.
namespace binpick::plc {
namespace {
using test::hex;
using test::LogLines;
using test::ServerRig;
using namespace std::chrono_literals;
}  // namespace

TEST(ClientFault, WhatIsNoAnswerEndsTheConnectionWithALine) {
  struct Case {
    const char* line;
    std::function<void(Bytes&)> spoil;
  };
  for (const auto& c : {
           Case{"function 3, 88 words at 0: exception 2: it has no such address",
                [](Bytes& r) { r.resize(9), r[5] = std::byte{3}, r[7] = std::byte{0x83}, r[8] = std::byte{2}; }},
           Case{"reply of 178 bytes where 176 belong", [](Bytes& r) { r[8] = std::byte{178}; }},
           Case{"reply of transaction", [](Bytes& r) { r[1] ^= std::byte{0x40}; }},
           Case{"reply of unit 1 to a request for 255", [](Bytes& r) { r[6] = std::byte{1}; }},
           Case{"reply of function 4 to 3", [](Bytes& r) { r[7] = std::byte{4}; }},
           Case{"protocol id 7 is not Modbus", [](Bytes& r) { r[3] = std::byte{7}; }},
           Case{"length field 1 is outside", [](Bytes& r) { r[4] = std::byte{0}, r[5] = std::byte{1}; }},
           Case{"reply of 4 bytes where 178 belong", [](Bytes& r) { r.resize(11), r[5] = std::byte{5}; }},
           Case{"it sends what nobody asked for",
                [](Bytes& r) {
                  append(r, hex({0, 9, 0, 0, 0, 3, 255, 0x83, 2}));
                }},
           Case{"no reply to function 3, 88 words at 0 within 1000 ms", [](Bytes& r) { r.pop_back(); }},
       }) {
    SCOPED_TRACE(c.line);
    const LogLines log;
    ServerRig rig;
    rig.ready();
    rig.connect();
    rig.run_for(1s);
    ASSERT_EQ(rig.reopened, 0);
    rig.spoil = [&](Bytes& reply) {
      if (reply[7] == std::byte{3}) c.spoil(reply);
    };
    rig.run_for(1500ms);
    EXPECT_EQ(rig.reopened, 1);
    EXPECT_EQ(log.count(c.line), 1);
    EXPECT_EQ(log.count("connecting anew"), 1);
    // It stays so: tried again and again, ever more slowly, told once; the PLC is lost after its heartbeat time-out.
    int tries = 0;
    for (const TimePoint end = rig.now + 20s; rig.now < end; rig.run_for(50ms))
      if (!rig.connected) ++tries, rig.connect();
    EXPECT_GE(tries, 6);
    EXPECT_LE(tries, 15);
    EXPECT_LE(log.count("connecting anew"), 2) << "the same once, whatever the numbers in it";
    EXPECT_EQ(rig.events(), "L ");
    // And well again: everything is written anew, the PLC is back.
    rig.spoil = nullptr;
    std::ranges::fill(rig.words, std::uint16_t{0});
    for (const TimePoint end = rig.now + 5s; rig.now < end; rig.run_for(50ms))
      if (!rig.connected) rig.connect();
    EXPECT_EQ(rig.events(), "B ");
    EXPECT_TRUE(rig.has(status::kReady));
    EXPECT_EQ(rig.words[at("map_version")], 2);
  }
}

TEST(ClientFault, APeerThatAcceptsAndSaysNothing) {
  const LogLines log;
  ServerRig rig;
  rig.mute = true;
  rig.ready();
  rig.connect();
  rig.run_for(990ms);
  EXPECT_EQ(rig.reopened, 0);
  rig.run_for(20ms);
  EXPECT_EQ(rig.reopened, 1);
  EXPECT_EQ(log.count("no reply to function 3, 88 words at 0 within 1000 ms"), 1);
  EXPECT_TRUE(rig.session.told()) << "nobody is there to be told";
  rig.run_for(3s);
  EXPECT_EQ(rig.events(), "L ");
}

TEST(ClientFault, AReplyThatComesLateMeetsNoRequestOfTheNextConnection) {
  const LogLines log;
  ServerRig rig;
  rig.ready();
  rig.mute = true;
  rig.connect();
  const Bytes asked = rig.requests.back();
  rig.run_for(1100ms);
  ASSERT_EQ(rig.reopened, 1);
  Bytes late = hex({std::to_integer<int>(asked[0]), std::to_integer<int>(asked[1]), 0, 0, 0, 179, 255, 3, 176});
  late.resize(late.size() + 176);
  rig.session.on_bytes(late, rig.now);  // the connection is gone
  EXPECT_TRUE(rig.session.take_output().empty());
  rig.connect();
  rig.run_for(250ms);  // asked again
  rig.session.on_bytes(late, rig.now);
  EXPECT_EQ(log.count("reply of transaction 1 to 2, a late one or somebody else's"), 1);
  EXPECT_TRUE(rig.session.take_reopen());
}

TEST(ClientFault, AConnectionLostInTheMidstOfAWriteIsWrittenAnew) {
  const LogLines log;
  ServerRig rig;
  rig.ready();
  rig.connect();
  rig.request(1);
  rig.drop();
  rig.session.on_scan_done(rig.now);
  rig.run_for(100ms);
  rig.session.publish(test::Rig::pick(77), rig.now);
  // The answer to the write of the blocks never comes: the PLC has them, and the cell cannot know.
  rig.spoil = [&](Bytes& reply) {
    if (reply[7] == std::byte{16} && rig.requests.back().size() > 100) {
      rig.connected = false;
      reply.clear();
    }
  };
  rig.run_for(50ms);
  ASSERT_FALSE(rig.connected);
  EXPECT_FALSE(rig.has(status::kResultValid));
  rig.session.on_disconnected(rig.now);
  EXPECT_EQ(log.count("the connection was lost in the midst of function 16, 80 words at 8"), 1);
  rig.spoil = nullptr;
  rig.requests.clear();
  rig.connect();
  rig.run_for(300ms);
  EXPECT_TRUE(rig.has(status::kResultValid));
  EXPECT_EQ(rig.words[at("pick_id")], 77);
  EXPECT_EQ(rig.requests[0][7], std::byte{3});
  EXPECT_EQ(rig.requests[1].size(), 13U + 2 * 80) << "both blocks, whatever stands there";
}

TEST(ClientFault, EveryAnswerSplitAtEveryByte) {
  ServerRig rig;
  rig.ready();
  std::size_t cut = 0;
  rig.spoil = [&](Bytes& reply) {
    cut = (cut + 1) % reply.size();
    rig.session.on_bytes(ByteView{reply}.first(cut), rig.now);
    reply.erase(reply.begin(), reply.begin() + static_cast<std::ptrdiff_t>(cut));
  };
  rig.connect();
  rig.run_for(10s);
  EXPECT_EQ(rig.reopened, 0);
  rig.spoil = nullptr;
  rig.request(1);
  EXPECT_EQ(rig.events(), "A1 ");
}

TEST(ClientFault, NoSingleCorruptByteHangsOrMakesAPick) {
  const LogLines quiet;
  for (const auto function : {std::byte{3}, std::byte{16}}) {
    for (std::size_t at_byte = 0; at_byte < 9 + 2 * kMapLength; ++at_byte) {
      ServerRig rig;
      rig.ready();
      rig.connect();
      rig.run_for(100ms);
      bool done = false;
      rig.spoil = [&](Bytes& reply) {
        if (done || reply[7] != function || at_byte >= reply.size()) return;
        done = true;
        reply[at_byte] ^= std::byte{0x21};
      };
      for (const TimePoint end = rig.now + 3s; rig.now < end; rig.run_for(20ms, 20ms))
        if (!rig.connected) rig.connect();
      // A word of the request block that is wrong once is not believed: the next read says otherwise.
      EXPECT_EQ(rig.events(), "") << "byte " << at_byte;
      EXPECT_TRUE(rig.has(status::kReady)) << "byte " << at_byte;
    }
  }
}
}  // namespace binpick::plc
