#include <gtest/gtest.h>
#include <random>
#include <set>

#include "tests/unit/plc/pair.hpp"

namespace binpick::plc {
namespace {
using emulators::Plc;
using emulators::PlcOptions;
using test::hex;
using test::Pair;
using namespace std::chrono_literals;

/// The cell in both roles; the PLC is the other.
struct EmulatedPlc : testing::TestWithParam<LineRole> {
  static Options cell_options() { return GetParam() == LineRole::Client ? test::client_options() : test::options(); }
};
INSTANTIATE_TEST_SUITE_P(Roles, EmulatedPlc, testing::Values(LineRole::Server, LineRole::Client),
                         [](const auto& tested) { return tested.param == LineRole::Client ? "Client" : "Server"; });
}  // namespace

TEST(EmulatedPlcAsServer, ItsFirstAnswersByteForByte) {
  PlcOptions o;
  o.cell_role = LineRole::Client;
  o.base_address = 0x0100;
  Plc plc{o};
  const TimePoint t{10s};
  plc.on_connected(t);
  const auto exchange = [&](const Bytes& frame) {
    plc.on_bytes(frame, t);
    return plc.take_output();
  };
  plc.on_deadline(t);  // one scan of its program: heartbeat 1, robot clear
  EXPECT_EQ(exchange(hex({0, 5, 0, 0, 0, 6, 1, 3, 0x01, 0x00, 0, 8})),
            hex({0, 5, 0, 0, 0, 19, 1, 3, 16, 0, 1, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 8}));
  EXPECT_EQ(exchange(hex({0, 6, 0, 0, 0, 11, 1, 16, 0x01, 0x10, 0, 2, 4, 0, 30, 0, 4})),
            hex({0, 6, 0, 0, 0, 6, 1, 16, 0x01, 0x10, 0, 2}));
  EXPECT_EQ(plc.cell_state(), State::Detecting);
  EXPECT_TRUE(plc.busy());
  EXPECT_EQ(exchange(hex({0, 7, 0, 0, 0, 6, 1, 6, 0x01, 0x11, 0, 1})), hex({0, 7, 0, 0, 0, 6, 1, 6, 0x01, 0x11, 0, 1}));
  EXPECT_TRUE(plc.ready());
  // Past its area; a count of nothing; a function that it has not.
  EXPECT_EQ(exchange(hex({0, 8, 0, 0, 0, 6, 1, 3, 0x01, 0x57, 0, 2})), hex({0, 8, 0, 0, 0, 3, 1, 0x83, 2}));
  EXPECT_EQ(exchange(hex({0, 8, 0, 0, 0, 6, 1, 3, 0x00, 0xFF, 0, 2})), hex({0, 8, 0, 0, 0, 3, 1, 0x83, 2}));
  EXPECT_EQ(exchange(hex({0, 9, 0, 0, 0, 6, 1, 3, 0x01, 0x00, 0, 0})), hex({0, 9, 0, 0, 0, 3, 1, 0x83, 3}));
  EXPECT_EQ(exchange(hex({0, 9, 0, 0, 0, 6, 1, 8, 0, 0, 0, 0})), hex({0, 9, 0, 0, 0, 3, 1, 0x88, 1}));
}

TEST(EmulatedPlcAsClient, ItsFirstFramesByteForByte) {
  PlcOptions o;
  o.base_address = 0x0100;
  Plc plc{o};
  const TimePoint t{10s};
  plc.on_connected(t);
  // MBAP (transaction 1, protocol 0, length 6, unit 255), function 3, address 0x0108, 80 words.
  EXPECT_EQ(plc.take_output(), hex({0, 1, 0, 0, 0, 6, 255, 3, 0x01, 0x08, 0, 80}));
  Bytes answer = hex({0, 1, 0, 0, 0, 163, 255, 3, 160});
  answer.resize(answer.size() + 160);
  plc.on_bytes(answer, t);
  EXPECT_TRUE(plc.take_output().empty());
  ASSERT_EQ(plc.deadline(), t + 30ms);
  plc.set_robot_clear(false);
  plc.on_deadline(t + 30ms);
  // Function 16, address 0x0100, 8 words, 16 bytes: heartbeat 1, then zero.
  EXPECT_EQ(plc.take_output(),
            hex({0, 2, 0, 0, 0, 23, 255, 16, 0x01, 0x00, 0, 8, 16, 0, 1, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0}));
  plc.on_bytes(hex({0, 2, 0, 0, 0, 6, 255, 16, 0x01, 0x00, 0, 8}), t + 31ms);
  EXPECT_EQ(plc.take_output(), hex({0, 3, 0, 0, 0, 6, 255, 3, 0x01, 0x08, 0, 80}));
  // An answer under another transaction number is ignored until the time-out, as MB_CLIENT does.
  plc.on_bytes(hex({0, 9, 0, 0, 0, 3, 255, 0x83, 2}), t + 32ms);
  EXPECT_EQ(plc.deadline(), t + 31ms + 2s);
  plc.on_deadline(t + 31ms + 2s);
  EXPECT_TRUE(plc.take_reopen());
}

TEST_P(EmulatedPlc, OnePickInBothWordOrdersAndEachConvention) {
  for (const auto order : {WordOrder::HighWordFirst, WordOrder::LowWordFirst}) {
    for (const auto convention : {PoseConvention::UniversalRobots, PoseConvention::Fanuc, PoseConvention::Kawasaki}) {
      Options cell = cell_options();
      cell.word_order = order;
      cell.pose_convention = convention;
      cell.base_address = 100;
      PlcOptions o;
      o.word_order = order;
      o.pose_convention = convention;
      o.base_address = 100;
      Pair pair{cell, o};
      pair.next_result.T_base_grasp.iso.linear() =
          Eigen::AngleAxisd(2.5, Eigen::Vector3d{1, 2, -0.5}.normalized()).toRotationMatrix();
      pair.next_result.T_base_retreat.iso = Eigen::Translation3d{30, -40, 90} * pair.next_result.T_base_grasp.iso;
      pair.plc.raise_request(2, 3);
      ASSERT_TRUE(pair.run_until([&] { return pair.plc.idle() && pair.plc.last_result(); }));
      EXPECT_EQ(pair.plc.map_problem(), "");
      const auto& result = *pair.plc.last_result();
      EXPECT_EQ(result.sequence, 1);
      EXPECT_EQ(result.code, ResultCode::PickFound);
      EXPECT_EQ(result.pick_id, 1);
      EXPECT_EQ(result.part_id, 2);
      EXPECT_EQ(result.supply_id, 3);
      EXPECT_EQ(result.figures.points, 68000U);
      EXPECT_EQ(result.figures.hypotheses, 312U);
      EXPECT_TRUE(result.T_base_grasp.iso.isApprox(pair.next_result.T_base_grasp.iso, 1e-5));
      EXPECT_TRUE(result.T_base_retreat.iso.isApprox(pair.next_result.T_base_retreat.iso, 1e-5));
      EXPECT_TRUE(result.T_base_approach.iso.isApprox(pair.next_result.T_base_approach.iso, 1e-5));
      EXPECT_TRUE(pair.plc.ready());
      EXPECT_EQ(pair.accepted, std::vector<std::uint16_t>{1});
    }
  }
}

TEST_P(EmulatedPlc, AWrongWordOrderIsSeenInTheTestWords) {
  PlcOptions o;
  o.word_order = WordOrder::LowWordFirst;
  Pair pair{cell_options(), o};
  pair.run_for(1s);
  EXPECT_EQ(pair.plc.map_problem(), "word order differs");
}

TEST_P(EmulatedPlc, AutomaticAsksPickAfterPick) {
  PlcOptions o;
  o.automatic = true;
  o.pick_time = 2s;
  Pair pair{cell_options(), o};
  pair.run_for(60s);
  EXPECT_GE(pair.plc.results_read(), 15U);
  EXPECT_EQ(pair.plc.torn_reads(), 0U);
  EXPECT_EQ(std::set<std::uint16_t>(pair.accepted.begin(), pair.accepted.end()).size(), pair.accepted.size());
  std::uint16_t n = 0;
  while (const auto result = pair.plc.take_result()) EXPECT_EQ(result->pick_id, ++n) << "each once, in order";
}

TEST_P(EmulatedPlc, AutomaticResetsAFaultAndGoesOn) {
  PlcOptions o;
  o.automatic = true;
  Pair pair{cell_options(), o};
  ASSERT_TRUE(pair.run_until([&] { return pair.plc.busy(); }));
  pair.scan_done_at.reset();
  pair.session->fault(Alarm::ScannerNoProfiles, pair.now);
  ASSERT_TRUE(pair.run_until([&] { return pair.plc.results_read() > 0; }, 5s));
  EXPECT_TRUE(pair.plc.alarms_seen().contains(Alarm::ScannerNoProfiles));
  EXPECT_EQ(pair.plc.first_alarm(), Alarm::None);
  EXPECT_EQ(pair.resets, 1U);
}

TEST_P(EmulatedPlc, RetryByHandGetsTheSameAnswer) {
  Pair pair{cell_options()};
  pair.plc.raise_request();
  ASSERT_TRUE(pair.run_until([&] { return pair.plc.results_read() == 1 && pair.plc.idle(); }));
  pair.plc.repeat_request();
  ASSERT_TRUE(pair.run_until([&] { return pair.plc.results_read() == 2 && pair.plc.idle(); }));
  EXPECT_EQ(pair.plc.last_result()->pick_id, 1);
  EXPECT_EQ(pair.accepted.size(), 1U);
}

TEST_P(EmulatedPlc, AbortByHand) {
  Pair pair{cell_options()};
  pair.plc.raise_request();
  ASSERT_TRUE(pair.run_until([&] { return pair.plc.busy(); }));
  pair.plc.raise_abort();
  ASSERT_TRUE(pair.run_until([&] { return pair.plc.ready(); }, 1s));
  EXPECT_EQ(pair.aborted, 1U);
  EXPECT_EQ(pair.plc.results_read(), 0U);
}

TEST_P(EmulatedPlc, EachFaultIsNoticedByTheCellAndOvercome) {
  struct Case {
    const char* name;
    std::function<void(emulators::Faults&)> set;
    Alarm alarm;  ///< None: the cell goes on without an alarm.
  };
  for (const auto& c : {
           Case{"unplugged", [](auto& f) { f.unplugged = true; }, Alarm::PlcLost},
           Case{"silent", [](auto& f) { f.silent = true; }, Alarm::PlcHeartbeatStopped},
           Case{"stop", [](auto& f) { f.error_code = 1; }, Alarm::PlcHeartbeatStopped},
           Case{"garbage", [](auto& f) { f.garbage = true; }, Alarm::PlcLost},
           Case{"wrong protocol id", [](auto& f) { f.wrong_id = true; }, Alarm::PlcLost},
           // Of each answer; a pick takes a dozen of them where the PLC is asked.
           Case{"delay", [](auto& f) { f.delay = GetParam() == LineRole::Client ? 60ms : 300ms; }, Alarm::None},
           Case{"split", [](auto& f) { f.split_every_byte = true; }, Alarm::None},
           Case{"cut", [](auto& f) { f.disconnect_after_bytes = 33; }, Alarm::None},
       }) {
    SCOPED_TRACE(c.name);
    const test::LogLines quiet;
    PlcOptions o;
    o.automatic = true;
    Pair pair{cell_options(), o};
    ASSERT_TRUE(pair.run_until([&] { return pair.plc.results_read() == 2; }));
    c.set(pair.plc.faults);
    pair.run_for(5500ms);
    if (c.alarm == Alarm::None) {
      EXPECT_GE(pair.plc.results_read(), 4U);
      EXPECT_EQ(pair.lost, 0U);
    } else {
      EXPECT_EQ(pair.lost, 1U);
    }
    pair.plc.faults = {};
    const unsigned before = pair.plc.results_read();
    EXPECT_TRUE(pair.run_until([&] { return pair.plc.results_read() > before; }, 8s));
    EXPECT_EQ(pair.back, pair.lost);
    if (c.alarm != Alarm::None) {
      const bool lost = pair.plc.alarms_seen().contains(Alarm::PlcLost);
      const bool stopped = pair.plc.alarms_seen().contains(Alarm::PlcHeartbeatStopped);
      EXPECT_TRUE(lost || stopped) << "visible once it is back";
    }
  }
}

/// Hours of both programs, with restarts of either side and pulled cables at random moments.
TEST_P(EmulatedPlc, RestartsOfEitherSideLoseNothingAndRepeatNothing) {
  const test::LogLines quiet;
  for (unsigned seed = 1; seed <= 5; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    std::mt19937 random{seed};
    PlcOptions o;
    o.automatic = true;
    Pair pair{cell_options(), o};
    std::set<std::pair<std::uint16_t, std::uint16_t>> sweeps;  // boot, sequence
    for (int i = 0; i < 200; ++i) {
      pair.run_for(std::chrono::milliseconds(random() % 3000));
      for (const auto sequence : std::exchange(pair.accepted, {}))
        EXPECT_TRUE(sweeps.insert({pair.plc.boot_count(), sequence}).second) << "sequence " << sequence << " twice";
      const auto what = random() % 4;
      if (what == 0) {
        pair.restart_cell();
        EXPECT_EQ(pair.session->register_at(at("status")) & (status::kResultValid | status::kAck), 0);
      }
      if (what == 1) pair.plc.restart();
      if (what == 2) {
        pair.plc.faults.unplugged = true;
        pair.run_for(std::chrono::milliseconds(random() % 1000));
        pair.accepted.clear();
        pair.plc.faults.unplugged = false;
      }
    }
    const unsigned before = pair.plc.results_read();
    EXPECT_TRUE(pair.run_until([&] { return pair.plc.results_read() > before + 2; }, 60s)) << "and still picks";
    std::set<std::uint16_t> picks;
    while (const auto result = pair.plc.take_result())
      if (result->code == ResultCode::PickFound) picks.insert(result->pick_id);
    EXPECT_GT(picks.size(), 20U);
  }
}
}  // namespace binpick::plc
