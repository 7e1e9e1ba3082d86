#include <cstdlib>
#include <gtest/gtest.h>
#include <map>
#include <random>
#include <set>

#include "tests/unit/plc/rig.hpp"

/// A random walk over everything that PLC, cell and time can do, with restarts of either side, in virtual time.
namespace binpick::plc {
namespace {
using namespace std::chrono_literals;
using test::hex;

/// The walker plays PLC, cell and clock at once and keeps its own account of what may be true.
class Walk {
 public:
  explicit Walk(unsigned seed) : random_{seed}, session_{std::make_unique<Session>(test::options(), boot_)} {
    connect();
  }

  void step() {
    switch (pick(32)) {
      case 0:
        return write_block(random_words());
      case 1:
        return write_single();
      case 2:
      case 3:
      case 4:
      case 5:
        return raise_new();
      case 6:
      case 7:
        return raise_again();
      case 8:
      case 9:
      case 10:
      case 11:
      case 12:
        return drop();
      case 13:
      case 14:
      case 15:
        return acknowledge();
      case 16:
        return toggle(control::kAbort, 2);
      case 17:
        return toggle(control::kReset, 1);
      case 18:
      case 19:
        return session_->on_scan_done(now_);
      case 20:
      case 21:
      case 22:
      case 23:
        return publish();
      case 24:
        return session_->set_not_ready(pick(4) == 0 ? std::uint16_t{2} : std::uint16_t{0}, now_);
      case 25:
        if (pick(8) == 0) session_->fault(Alarm::ScannerNoReply, now_);
        return;
      case 26:
        return reconnect();
      case 27:
        if (pick(50) == 0) restart_cell();
        return;
      case 28:
        if (pick(50) == 0) restart_plc();
        return;
      default:
        return let_time_pass();
    }
  }

  /// What must hold after every step.
  void check() {
    while (const auto event = session_->take_event()) {
      if (const auto* accepted = std::get_if<RequestAccepted>(&*event)) on_accepted(accepted->request);
      if (std::holds_alternative<CycleAborted>(*event)) running_ = 0;
      if (std::holds_alternative<CycleTimedOut>(*event)) running_ = 0;
    }
    const std::uint16_t status = word(at("status"));
    const auto state = static_cast<State>(word(at("cell_state")));
    const bool busy = state == State::Scanning || state == State::Detecting;
    if (!busy) running_ = 0;
    ASSERT_EQ((status & status::kBusy) != 0, busy);
    ASSERT_EQ((status & status::kReady) != 0, state == State::Ready);
    ASSERT_EQ((status & status::kFault) != 0, state == State::Fault);
    ASSERT_EQ(running_ != 0, busy) << "a cycle runs exactly while an accepted request is being worked on";
    ASSERT_EQ(word(at("cycles_total")), static_cast<std::uint16_t>(sweeps_this_boot_));

    const std::uint16_t head = word(at("result_sequence"));
    ASSERT_EQ(head, word(at("result_sequence_tail")));
    const auto code = static_cast<ResultCode>(word(at("result_code")));
    const bool valid = (status & status::kResultValid) != 0;
    if (!valid) {
      for (std::uint16_t i = kResultFirst; i < kMapLength; ++i)
        ASSERT_EQ(word(i), 0) << "not valid, yet not zero: " << i;
    } else {
      ASSERT_NE(head, 0);
      ASSERT_NE(code, ResultCode::None);
      check_result(head, code, word(at("pick_id")));
    }
  }

  std::uint64_t sweeps = 0, results = 0, restarts = 0, repeats = 0;

 private:
  struct Outcome {
    ResultCode code;
    std::uint16_t pick_id;
  };

  std::uint32_t pick(std::uint32_t n) { return static_cast<std::uint32_t>(random_() % n); }
  std::uint16_t word(std::uint16_t offset) const { return session_->register_at(offset); }

  void on_accepted(const PickRequest& request) {
    ASSERT_EQ(running_, 0) << "no sweep while one runs";
    ASSERT_TRUE(request_seen_0_) << "a request that stood at the start was carried out";
    ASSERT_NE(request.sequence, 0);
    // The walker never gives one number to two requests until all others were used, but raises each many times.
    ASSERT_TRUE(accepted_.insert({boot_, request.sequence}).second)
        << "sequence " << request.sequence << " of boot " << boot_ << " swept twice";
    running_ = request.sequence;
    outcomes_.erase(request.sequence);
    ++sweeps, ++sweeps_this_boot_;
  }

  void check_result(std::uint16_t sequence, ResultCode code, std::uint16_t pick_id) {
    if (!accepted_.contains({boot_, sequence})) {
      ASSERT_TRUE(code == ResultCode::NotReady || code == ResultCode::UnknownPart ||
                  code == ResultCode::UnknownSupply || code == ResultCode::Aborted ||
                  code == ResultCode::ControllerRestarted)
          << "sequence " << sequence << " was not accepted, but answered with " << static_cast<int>(code);
      return;
    }
    // The number of an accepted request with another part is refused; that is no answer of the request.
    if (code == ResultCode::BadSequence) return;
    ASSERT_NE(sequence, running_) << "answered before its cycle ended";
    const auto [outcome, first] = outcomes_.insert({sequence, {code, pick_id}});
    ASSERT_EQ(outcome->second.code, code) << "sequence " << sequence;
    ASSERT_EQ(outcome->second.pick_id, pick_id) << "sequence " << sequence;
    if (code == ResultCode::PickFound) {
      ASSERT_TRUE(published_.contains(sequence)) << "sequence " << sequence;
      ASSERT_EQ(published_[sequence], pick_id);
    }
    first ? ++results : ++repeats;
  }

  Bytes send(const Bytes& frame, bool control_in_it) {
    if (control_in_it && (words_[at("control")] & control::kRequest) == 0) request_seen_0_ = true;
    session_->on_bytes(connection_, frame, now_);
    return session_->take_output(connection_);
  }
  void write_block(const std::array<std::uint16_t, kRequestLength>& words) {
    words_ = words;
    Bytes frame = hex({0, 9, 0, 0, 0, 23, 255, 16, 0, 0, 0, 8, 16});
    for (const auto w : words_) append_be(frame, w);
    ASSERT_EQ(send(frame, true).size(), 12U);
  }
  void write_single() {
    const auto offset = static_cast<std::uint16_t>(pick(kRequestLength));
    if (offset == at("sequence")) return;  // numbers are given out by raise_new only
    words_[offset] = random_words()[offset];
    Bytes frame = hex({0, 9, 0, 0, 0, 6, 255, 6});
    append_be(frame, offset);
    append_be(frame, words_[offset]);
    ASSERT_EQ(send(frame, offset == at("control")).size(), 12U);
  }
  std::array<std::uint16_t, kRequestLength> random_words() {
    auto words = words_;
    ++words[0];
    words[at("part_id")] = static_cast<std::uint16_t>(1 + pick(3));
    words[at("supply_id")] = static_cast<std::uint16_t>(1 + pick(4));
    words[at("result_ack")] = pick(2) == 0 ? word(at("result_sequence")) : static_cast<std::uint16_t>(pick(65536));
    words[at("control")] = static_cast<std::uint16_t>(pick(65536));
    return words;
  }
  void raise_new() {
    auto words = words_;
    ++words[0];
    sequence_ = sequence_ == 65535 ? 1 : static_cast<std::uint16_t>(sequence_ + 1);
    // Numbers wrap: whoever had it before is long forgotten.
    accepted_.erase({boot_, sequence_});
    outcomes_.erase(sequence_);
    published_.erase(sequence_);
    words[at("sequence")] = sequence_;
    words[at("part_id")] = static_cast<std::uint16_t>(pick(20) == 0 ? 9 : 1 + pick(2));
    words[at("supply_id")] = pick(20) == 0 ? 2 : 1;
    words[at("result_ack")] = pick(4) == 0 ? words[at("result_ack")] : std::uint16_t{0};
    words[at("control")] = control::kRequest | control::kRobotClear;
    write_block(words);
  }
  void raise_again() {
    auto words = words_;
    ++words[0];
    words[at("control")] |= control::kRequest;
    if (pick(20) == 0) words[at("part_id")] = static_cast<std::uint16_t>(1 + pick(2));
    write_block(words);
  }
  void drop() {
    auto words = words_;
    ++words[0];
    words[at("control")] = control::kRobotClear;
    write_block(words);
  }
  void acknowledge() {
    auto words = words_;
    ++words[0];
    words[at("result_ack")] = word(at("result_sequence"));
    write_block(words);
  }
  void toggle(std::uint16_t bit, std::uint32_t one_in) {
    if (pick(one_in) != 0) return;
    auto words = words_;
    ++words[0];
    words[at("control")] ^= bit;
    write_block(words);
  }
  void publish() {
    if (running_ == 0 && pick(4) != 0) return;  // late ones, too
    PickResult result;
    result.code = pick(4) == 0 ? ResultCode::NothingFound : ResultCode::PickFound;
    result.part_id = 1;
    if (result.code == ResultCode::PickFound) result.pick_id = ++pick_id_ == 0 ? ++pick_id_ : pick_id_;
    if (running_ != 0) published_[running_] = result.pick_id;
    session_->publish(result, now_);
  }
  void connect() { ASSERT_TRUE(session_->on_accept(++connection_, "127.0.0.1", 1, now_)); }
  void reconnect() {
    session_->on_closed(connection_, now_);
    connect();
  }
  void restart_plc() {
    reconnect();
    words_ = {};
    words_[at("sequence")] = sequence_;
    if (pick(2) == 0) write_block(words_);
  }
  void restart_cell() {
    ++restarts, ++boot_;
    session_ = std::make_unique<Session>(test::options(), boot_);
    running_ = 0;
    request_seen_0_ = false;
    sweeps_this_boot_ = 0;
    outcomes_.clear();
    published_.clear();
    ASSERT_EQ(word(at("status")), 0) << "nothing is valid after a restart";
    ASSERT_EQ(word(at("ack_sequence")), 0);
    ASSERT_EQ(word(at("boot_count")), boot_);
    for (std::uint16_t i = kResultFirst; i < kMapLength; ++i) ASSERT_EQ(word(i), 0);
    connect();
    if (pick(2) == 0) session_->set_not_ready(0, now_);
  }
  void let_time_pass() {
    const std::uint16_t before = word(at("result_sequence"));
    const bool valid = (word(at("status")) & status::kResultValid) != 0;
    const auto state = session_->state();
    now_ += std::chrono::milliseconds(pick(10) == 0 ? pick(20000) : pick(200));
    for (int i = 0; i < 3 && *session_->deadline() <= now_; ++i) session_->on_deadline(now_);
    if (valid && state != State::Scanning && state != State::Detecting) {
      ASSERT_EQ(word(at("result_sequence")), before) << "a result does not expire";
      ASSERT_NE(word(at("status")) & status::kResultValid, 0);
    }
  }

  std::mt19937 random_;
  TimePoint now_{1000s};
  std::uint16_t boot_ = 1;
  std::unique_ptr<Session> session_;
  ConnectionId connection_ = 0;
  std::array<std::uint16_t, kRequestLength> words_{};
  std::uint16_t sequence_ = 64000, pick_id_ = 0;
  std::uint16_t running_ = 0;    // number of the cycle that runs
  bool request_seen_0_ = false;  // since the cell's start
  std::uint64_t sweeps_this_boot_ = 0;
  std::set<std::pair<std::uint16_t, std::uint16_t>> accepted_;
  std::map<std::uint16_t, Outcome> outcomes_;
  std::map<std::uint16_t, std::uint16_t> published_;
};
}  // namespace

TEST(Walk, AMillionStepsWithRestartsOfEitherSide) {
  const test::LogLines quiet;
  unsigned seed = std::random_device{}();
  if (const char* given = std::getenv("BINPICK_SEED")) seed = static_cast<unsigned>(std::strtoul(given, nullptr, 10));
  RecordProperty("seed", std::to_string(seed));
  Walk walk{seed};
  for (int step = 0; step < 1'000'000; ++step) {
    walk.step();
    walk.check();
    if (::testing::Test::HasFatalFailure()) {
      FAIL() << "at step " << step << "; run again with BINPICK_SEED=" << seed;
    }
  }
  RecordProperty("sweeps", static_cast<int>(walk.sweeps));
  // The walk went everywhere that matters.
  EXPECT_GT(walk.sweeps, 5'000U);
  EXPECT_GT(walk.results, 5'000U);
  EXPECT_GT(walk.repeats, 5'000U);
  EXPECT_GT(walk.restarts, 300U);
}
}  // namespace binpick::plc
