#include <algorithm>
#include <functional>
#include <gtest/gtest.h>

#include "plc/modbus_client.hpp"
#include "tests/unit/plc/rig.hpp"

/// The cell as the client of a Modbus server in the PLC.
namespace binpick::plc {
namespace {
using test::client_options;
using test::hex;
using test::LogLines;
using namespace std::chrono_literals;

constexpr std::size_t kFlags = at("status");

/// A server in a few lines; its answers are written out by hand and share no encoder with anybody.
class ServerRig {
 public:
  explicit ServerRig(const Options& o = client_options()) : session{o, 7} {}

  void connect() {
    session.on_connected(now);
    connected = true;
    run_for(0ms);
  }
  void disconnect() {
    connected = false;
    session.on_disconnected(now);
  }

  /// Serves whatever is due, and answers; a connection that the session drops stays down.
  void run_for(Duration duration, Duration step = 5ms) {
    const TimePoint end = now + duration;
    while (true) {
      for (int i = 0; i < 20; ++i) {
        if (session.deadline() && *session.deadline() <= now) session.on_deadline(now);
        if (!connected || !exchange()) break;
      }
      if (session.take_reopen()) {
        ++reopened;
        disconnect();
      }
      if (now >= end) return;
      now = std::min(end, now + step);
      if (beating) ++words[0];
    }
  }
  void ready() {
    session.set_not_ready(0, now);
    run_for(50ms);
  }
  void request(std::uint16_t sequence) {
    words[at("sequence")] = sequence;
    words[at("part_id")] = words[at("supply_id")] = 1;
    words[at("result_ack")] = 0;
    words[at("control")] = control::kRequest | control::kRobotClear;
    run_for(100ms);
  }
  void drop() {
    words[at("control")] = control::kRobotClear;
    run_for(100ms);
  }
  std::string events() {
    std::string out;
    while (const auto event = session.take_event()) {
      if (const auto* accepted = std::get_if<RequestAccepted>(&*event))
        out += "A" + std::to_string(accepted->request.sequence) + " ";
      if (std::holds_alternative<PlcLost>(*event)) out += "L ";
      if (std::holds_alternative<PlcBack>(*event)) out += "B ";
      if (std::holds_alternative<CycleAborted>(*event)) out += "a ";
    }
    return out;
  }
  bool has(std::uint16_t flag) const { return (words[kFlags] & flag) != 0; }

  TimePoint now{1000s};
  Session session;
  std::array<std::uint16_t, kMapLength> words{};  ///< The PLC's.
  bool connected = false, beating = true, mute = false;
  int reopened = 0;
  /// Changes an answer before it is sent; empty: as it is.
  std::function<void(Bytes&)> spoil;
  std::vector<Bytes> requests;  ///< As they came.

 private:
  bool exchange() {
    const Bytes frame = session.take_output();
    if (frame.empty()) return false;
    requests.push_back(frame);
    if (mute) return true;
    const std::size_t first = read_be<std::uint16_t>(frame, 8), count = read_be<std::uint16_t>(frame, 10);
    EXPECT_LE(first + count, kMapLength);
    Bytes reply(frame.begin(), frame.begin() + 4);
    if (frame[7] == std::byte{3}) {
      append_be(reply, static_cast<std::uint16_t>(3 + 2 * count));
      reply.push_back(frame[6]);
      reply.push_back(std::byte{3});
      reply.push_back(static_cast<std::byte>(2 * count));
      for (std::size_t i = 0; i < count; ++i) append_be(reply, words[first + i]);
    } else {
      EXPECT_EQ(frame[7], std::byte{16});
      for (std::size_t i = 0; i < count; ++i) words[first + i] = read_be<std::uint16_t>(frame, 13 + 2 * i);
      append_be<std::uint16_t>(reply, 6);
      reply.insert(reply.end(), frame.begin() + 6, frame.begin() + 12);
    }
    if (spoil) spoil(reply);
    session.on_bytes(reply, now);
    return true;
  }
};
}  // namespace

TEST(Client, TheFirstExchangeByteForByte) {
  ServerRig rig;
  rig.session.set_not_ready(0, rig.now);
  rig.connect();
  ASSERT_EQ(rig.requests.size(), 3U);
  // transaction | protocol | length | unit | function | address | count | bytes
  EXPECT_EQ(rig.requests[0], hex({0, 1, 0, 0, 0, 6, 255, 3, 0, 0, 0, 82}));
  ASSERT_EQ(rig.requests[1].size(), 13U + 2 * 74);
  EXPECT_TRUE(
      std::ranges::equal(ByteView{rig.requests[1]}.first(13), hex({0, 2, 0, 0, 0, 155, 255, 16, 0, 8, 0, 74, 148})));
  EXPECT_EQ(rig.requests[2], hex({0, 3, 0, 0, 0, 9, 255, 16, 0, 17, 0, 1, 2, 0, 1})) << "ready, last of all";
  EXPECT_EQ(rig.words[at("map_version")], 1);
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
  EXPECT_EQ(session.take_output(), hex({0, 1, 0, 0, 0, 6, 1, 3, 2, 0, 0, 82}));
  Bytes reply = hex({0, 1, 0, 0, 0, 167, 1, 3, 164});
  reply.resize(reply.size() + 164);
  session.on_bytes(reply, now);
  const Bytes write = session.take_output();
  ASSERT_GE(write.size(), 25U);
  EXPECT_TRUE(std::ranges::equal(ByteView{write}.subspan(7, 6), hex({16, 2, 8, 0, 74, 148})));
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
  EXPECT_EQ(writes[1], "8+74");
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
    EXPECT_EQ(rig.words[at("map_version")], 1);
  }
  EXPECT_EQ(log.count("192.168.0.10:502, unit 255: word 8 is not as it was written"), 1);
  EXPECT_EQ(rig.reopened, 0);
}

TEST(Client, WhatIsNoAnswerEndsTheConnectionWithALine) {
  struct Case {
    const char* line;
    std::function<void(Bytes&)> spoil;
  };
  for (const auto& c : {
           Case{"function 3, 82 words at 0: exception 2: it has no such address",
                [](Bytes& r) {
                  r = hex({r.size() > 1 ? std::to_integer<int>(r[0]) : 0, std::to_integer<int>(r[1]), 0, 0, 0, 3, 255,
                           0x83, 2});
                }},
           Case{"reply of 166 bytes where 164 belong", [](Bytes& r) { r[8] = std::byte{166}; }},
           Case{"reply of transaction", [](Bytes& r) { r[1] ^= std::byte{0x40}; }},
           Case{"reply of unit 1 to a request for 255", [](Bytes& r) { r[6] = std::byte{1}; }},
           Case{"reply of function 4 to 3", [](Bytes& r) { r[7] = std::byte{4}; }},
           Case{"protocol id 7 is not Modbus", [](Bytes& r) { r[3] = std::byte{7}; }},
           Case{"length field 1 is outside", [](Bytes& r) { r[4] = std::byte{0}, r[5] = std::byte{1}; }},
           Case{"reply of 4 bytes where 166 belong", [](Bytes& r) { r.resize(11), r[5] = std::byte{5}; }},
           Case{"it sends what nobody asked for",
                [](Bytes& r) {
                  append(r, hex({0, 9, 0, 0, 0, 3, 255, 0x83, 2}));
                }},
           Case{"no reply to function 3, 82 words at 0 within 1000 ms", [](Bytes& r) { r.pop_back(); }},
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
    EXPECT_EQ(rig.words[at("map_version")], 1);
  }
}

TEST(Client, APeerThatAcceptsAndSaysNothing) {
  const LogLines log;
  ServerRig rig;
  rig.mute = true;
  rig.ready();
  rig.connect();
  rig.run_for(990ms);
  EXPECT_EQ(rig.reopened, 0);
  rig.run_for(20ms);
  EXPECT_EQ(rig.reopened, 1);
  EXPECT_EQ(log.count("no reply to function 3, 82 words at 0 within 1000 ms"), 1);
  EXPECT_TRUE(rig.session.told()) << "nobody is there to be told";
  rig.run_for(3s);
  EXPECT_EQ(rig.events(), "L ");
}

TEST(Client, AReplyThatComesLateMeetsNoRequestOfTheNextConnection) {
  const LogLines log;
  ServerRig rig;
  rig.ready();
  rig.mute = true;
  rig.connect();
  const Bytes asked = rig.requests.back();
  rig.run_for(1100ms);
  ASSERT_EQ(rig.reopened, 1);
  Bytes late = hex({std::to_integer<int>(asked[0]), std::to_integer<int>(asked[1]), 0, 0, 0, 167, 255, 3, 164});
  late.resize(late.size() + 164);
  rig.session.on_bytes(late, rig.now);  // the connection is gone
  EXPECT_TRUE(rig.session.take_output().empty());
  rig.connect();
  rig.run_for(250ms);  // asked again
  rig.session.on_bytes(late, rig.now);
  EXPECT_EQ(log.count("reply of transaction 1 to 2, a late one or somebody else's"), 1);
  EXPECT_TRUE(rig.session.take_reopen());
}

TEST(Client, AConnectionLostInTheMidstOfAWriteIsWrittenAnew) {
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
  EXPECT_EQ(log.count("the connection was lost in the midst of function 16, 74 words at 8"), 1);
  rig.spoil = nullptr;
  rig.requests.clear();
  rig.connect();
  rig.run_for(300ms);
  EXPECT_TRUE(rig.has(status::kResultValid));
  EXPECT_EQ(rig.words[at("pick_id")], 77);
  EXPECT_EQ(rig.requests[0][7], std::byte{3});
  EXPECT_EQ(rig.requests[1].size(), 13U + 2 * 74) << "both blocks, whatever stands there";
}

TEST(Client, EveryAnswerSplitAtEveryByte) {
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

TEST(Client, NoSingleCorruptByteHangsOrMakesAPick) {
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
