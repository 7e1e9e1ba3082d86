#include <cstdlib>
#include <gtest/gtest.h>
#include <random>
#include <set>

#include "tests/unit/plc/pair.hpp"

/// A random walk of a cell that polls the PLC's server: faults of the line, restarts of either side, and everything
/// that a PLC's program may ask, in virtual time.
namespace binpick::plc {
namespace {
using namespace std::chrono_literals;

class ClientWalk {
 public:
  explicit ClientWalk(unsigned seed) : random_{seed}, pair_{cell_options(), plc_options()} {}

  void step() {
    auto& plc = pair_.plc;
    switch (pick(24)) {
      case 0:
      case 1:
      case 2:
      case 3:
      case 4:
        if (plc.idle()) plc.raise_request(pick(20) == 0 ? 9 : 1, 1);
        break;
      case 5:
        if (plc.idle() && plc.sequence() != 0) plc.repeat_request();
        break;
      case 6:
        if (pick(4) == 0) plc.raise_abort();
        break;
      case 7:
        plc.raise_reset();
        break;
      case 8:
        if (plc.acknowledged()) plc.drop_request();  // a request stands until then, that much a program owes
        break;
      case 9:
        if (pick(8) == 0) pair_.session->fault(Alarm::ScannerNoReply, pair_.now), forget_cycle();
        break;
      case 10:
        pair_.session->set_not_ready(pick(3) == 0 ? 2 : 0, pair_.now);
        break;
      case 11:
      case 12:
        pair_.cut_line();
        ++cuts;
        break;
      case 13:
        if (pick(6) == 0) plc.restart(), ++restarts;
        break;
      case 14:
        if (pick(6) == 0) restart_cell();
        break;
      case 15:
        random_fault();
        break;
      case 16:
      case 17:
        plc.faults = {};
        break;
      default:
        break;
    }
    pair_.run_for(std::chrono::milliseconds(pick(20) == 0 ? pick(4000) : pick(150)));
  }

  /// What must hold after every step.
  void check() {
    for (; accepted_seen_ < pair_.accepted.size(); ++accepted_seen_) {
      ASSERT_TRUE(swept_.insert(pair_.accepted[accepted_seen_]).second)
          << "sequence " << pair_.accepted[accepted_seen_] << " swept twice";
      ++sweeps;
    }
    while (const auto result = pair_.plc.take_result()) {
      ++results;
      ASSERT_EQ(result->sequence, pair_.plc.last_result()->sequence);
      if (result->code != ResultCode::PickFound) continue;
      ++picks;
      const auto& ids = published_[result->sequence];
      ASSERT_TRUE(ids.contains(result->pick_id) || pair_.published[result->sequence] == result->pick_id)
          << "pick " << result->pick_id << " was never published for sequence " << result->sequence;
      ASSERT_EQ(result->part_id, 1);
      ASSERT_FLOAT_EQ(result->grasp[0], 1.0F);
      ASSERT_FLOAT_EQ(result->approach[2], 0.5F);
    }
    ASSERT_EQ(pair_.plc.torn_reads(), 0U);
    ASSERT_EQ(pair_.plc.map_problem(), "");
  }

  /// With the line sound and nobody interfering, a pick goes through.
  void heal() {
    auto& plc = pair_.plc;
    plc.faults = {};
    pair_.session->set_not_ready(0, pair_.now);
    pair_.run_for(8s);
    plc.raise_reset();
    const auto stands = [&] { return !plc.fault() && !plc.busy() && (plc.ready() || plc.result_valid()); };
    ASSERT_TRUE(pair_.run_until(stands, 30s)) << "never ready again, state " << static_cast<int>(plc.cell_state());
    // An answer that the program missed (a fault that was reset before it looked) is there for whoever asks again.
    if (!plc.idle()) plc.repeat_request();
    ASSERT_TRUE(pair_.run_until([&] { return plc.idle() && !plc.acknowledged(); }, 30s))
        << "a handshake was lost: request " << plc.sequence() << ", ack " << plc.acknowledged() << " of "
        << plc.ack_sequence() << ", state " << static_cast<int>(plc.cell_state());
    check();
    const auto before = pair_.plc.results_read();
    plc.raise_request(1, 1);
    ASSERT_TRUE(pair_.run_until([&] { return plc.results_read() > before && plc.idle(); }, 10s))
        << "no answer to request " << plc.sequence();
    ASSERT_EQ(plc.last_result()->code, ResultCode::PickFound);
    check();
  }

  std::uint64_t sweeps = 0, results = 0, picks = 0, restarts = 0, cuts = 0;

 private:
  static Options cell_options() {
    Options o = test::client_options();
    o.poll = 50ms;
    return o;
  }
  static emulators::PlcOptions plc_options() {
    emulators::PlcOptions o;
    o.scan = 17ms;
    return o;
  }
  std::uint32_t pick(std::uint32_t n) { return static_cast<std::uint32_t>(random_() % n); }
  void forget_cycle() {
    pair_.scan_done_at.reset();
    pair_.result_at.reset();
  }
  void restart_cell() {
    ++restarts;
    for (const auto& [sequence, id] : pair_.published) published_[sequence].insert(id);
    pair_.restart_cell();
    accepted_seen_ = pair_.accepted.size();
    swept_.clear();
  }
  void random_fault() {
    auto& faults = pair_.plc.faults;
    switch (pick(8)) {
      case 0:
        faults.silent = true;
        break;
      case 1:
        faults.unplugged = true;
        break;
      case 2:
        faults.garbage = true;
        break;
      case 3:
        faults.wrong_id = true;
        break;
      case 4:
        faults.error_code = 1 + pick(11);
        break;
      case 5:
        faults.delay = std::chrono::milliseconds(pick(1500));
        break;
      case 6:
        faults.split_every_byte = true;
        break;
      default:
        faults.disconnect_after_bytes = pick(600);
        break;
    }
  }

  std::mt19937 random_;
  test::Pair pair_;
  std::size_t accepted_seen_ = 0;
  std::set<std::uint16_t> swept_;                               // since the cell's start
  std::map<std::uint16_t, std::set<std::uint16_t>> published_;  // before it: what stands in the PLC outlives the cell
};
}  // namespace

TEST(ClientWalk, AHundredThousandStepsWithRestartsFaultsAndLostConnections) {
  const test::LogLines quiet;
  unsigned seed = std::random_device{}();
  if (const char* given = std::getenv("BINPICK_SEED")) seed = static_cast<unsigned>(std::strtoul(given, nullptr, 10));
  RecordProperty("seed", std::to_string(seed));
  ClientWalk walk{seed};
  for (int step = 1; step <= 100'000; ++step) {
    walk.step();
    walk.check();
    if (step % 250 == 0 && !::testing::Test::HasFatalFailure()) walk.heal();
    if (::testing::Test::HasFatalFailure()) FAIL() << "at step " << step << "; run again with BINPICK_SEED=" << seed;
  }
  // The walk went everywhere that matters.
  EXPECT_GT(walk.sweeps, 1'000U);
  EXPECT_GT(walk.picks, 800U);
  EXPECT_GT(walk.results, walk.picks);
  EXPECT_GT(walk.restarts, 500U);
  EXPECT_GT(walk.cuts, 5'000U);
}
}  // namespace binpick::plc
