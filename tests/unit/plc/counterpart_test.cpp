#include "plc/counterpart.hpp"

#include <deque>
#include <gtest/gtest.h>
#include <map>
#include <set>
#include <tuple>
#include <vector>

namespace binpick::plc {
namespace {
/// Both tables at work on each other: the PLC's step, the cell's state, and the bits between them.
struct World {
  PlcStep step = PlcStep::Idle;
  State cell = State::NotReady;
  std::uint16_t seen = 0;  ///< Control bits as the cell last saw them.
  std::uint16_t bits = 0;  ///< Status bits: ack, result_valid, scan_done, abort_ack, reset_ack.
  bool start = false;
  bool own = false;  ///< ack_sequence and result_sequence are the PLC's number.
  auto key() const { return std::tuple{step, cell, seen, bits, start, own}; }
  friend bool operator<(const World& a, const World& b) { return a.key() < b.key(); }
};

std::uint16_t status_of(const World& w) {
  return static_cast<std::uint16_t>(w.bits |
                                    (w.cell == State::Ready || w.cell == State::ResultValid ? status::kReady : 0) |
                                    (w.cell == State::Fault ? status::kFault : 0));
}

/// The cell takes its row; nothing when there is none.
bool cell_does(World& w, Signal signal) {
  const Row* row = find_row(w.cell, signal);
  if (row == nullptr) return false;
  w.cell = row->to;
  const auto raise = [&w](unsigned mask) { w.bits = static_cast<std::uint16_t>(w.bits | mask); };
  const auto drop = [&w](unsigned mask) { w.bits = static_cast<std::uint16_t>(w.bits & ~mask); };
  switch (row->effect) {
    case Effect::AcceptAndScan:
      drop(status::kResultValid | status::kScanDone);
      raise(status::kAck);
      break;
    case Effect::Refuse:
    case Effect::RefuseNotReady:
    case Effect::RepeatResult:
      raise(status::kAck | status::kResultValid);
      break;
    case Effect::AckAgain:
      raise(status::kAck);
      break;
    case Effect::DropAck:
      drop(status::kAck);
      break;
    case Effect::StartDetection:
      raise(status::kScanDone);
      break;
    case Effect::PublishResult:
      raise(status::kResultValid | status::kScanDone);
      break;
    case Effect::ClearResult:
    case Effect::StopAndClear:
    case Effect::RaiseFault:
    case Effect::TimeOut:
      drop(status::kResultValid);
      break;
    case Effect::None:
    case Effect::ClearFault:
      break;
  }
  return true;
}

bool holds(const World& w, When when, bool abort, bool reset) {
  const auto bit = [&w](unsigned mask) { return (status_of(w) & mask) != 0; };
  switch (when) {
    case When::AbortWanted:
      return abort;
    case When::ResetWanted:
      return reset;
    case When::StartWanted:
      return w.start && bit(status::kReady) && !bit(status::kAck);
    case When::StartDropped:
      return !w.start;
    case When::Acked:
      return w.own && bit(status::kAck);
    case When::ScanDone:
      return bit(status::kScanDone);
    case When::ResultThere:
      return w.own && bit(status::kResultValid);
    case When::ResultCleared:
      return !bit(status::kResultValid);
    case When::Faulted:
      return bit(status::kFault);
    case When::FaultGone:
      return !bit(status::kFault);
    case When::AbortAcked:
      return bit(status::kAbortAck);
    case When::ResetAcked:
      return bit(status::kResetAck);
    case When::LineUp:
    case When::LineUpAgain:
    case When::LineLost:
    case When::TimedOut:
    case When::Unanswered:
    case When::Nothing:
      return false;  // a good line, and nobody is late: the tables must do without
  }
  return false;
}

/// The PLC takes the first row that fits.
bool plc_does(World& w, bool abort, bool reset) {
  for (const PlcRow& row : kPlcRows) {
    if (row.from != w.step || !holds(w, row.on, abort, reset)) continue;
    w.step = row.to;
    if (row.act == Act::ChooseNumber) w.own = false;
    return true;
  }
  return false;
}

/// Everything that can happen next. `willing`: only what brings things on; nobody disturbs.
std::vector<World> nexts(const World& w, bool willing) {
  std::vector<World> out;
  const auto add = [&out](const World& next) { out.push_back(next); };
  const std::uint16_t wanted = text_of(w.step).control;
  const bool taken = w.step == PlcStep::Acknowledging;
  // The block is one write: the cell sees all its bits at once.
  if (wanted != w.seen) {
    const auto rose = [&](std::uint16_t mask) { return (wanted & mask) != 0 && (w.seen & mask) == 0; };
    for (const Signal request : {Signal::NewRequest, Signal::BadRequest}) {
      World next = w;
      next.seen = wanted;
      next.bits = static_cast<std::uint16_t>(w.bits & ~(status::kAbortAck | status::kResetAck));
      if ((wanted & control::kAbort) != 0) next.bits |= status::kAbortAck;
      if ((wanted & control::kReset) != 0) next.bits |= status::kResetAck;
      if (rose(control::kAbort)) cell_does(next, Signal::AbortRaised);
      if (rose(control::kReset)) cell_does(next, Signal::ResetRaised);
      if (rose(control::kRequest)) next.own = cell_does(next, request);
      if ((wanted & control::kRequest) == 0 && (w.seen & control::kRequest) != 0)
        cell_does(next, Signal::RequestDropped);
      add(next);
    }
  }
  if (taken && (w.bits & status::kResultValid) != 0) {
    World next = w;
    if ((w.seen & control::kRequest) != 0) cell_does(next, Signal::RequestDropped);
    next.seen = wanted;
    if (cell_does(next, Signal::ResultAcked)) add(next);
  }
  for (const Signal signal : {Signal::DevicesReady, Signal::ScanComplete, Signal::DetectionDone}) {
    World next = w;
    if (cell_does(next, signal)) add(next);
  }
  if (!willing)
    for (const Signal signal : {Signal::DevicesMissing, Signal::FaultRaised, Signal::Deadline}) {
      World next = w;
      if (cell_does(next, signal)) add(next);
    }
  for (const bool abort : {false, true})
    for (const bool reset : {false, true}) {
      if (willing && (abort || (reset && w.step != PlcStep::Fault))) continue;
      World next = w;
      if (plc_does(next, abort, reset)) add(next);
    }
  World next = w;
  next.start = !w.start;
  if (!willing || w.step == PlcStep::Finished || w.step == PlcStep::Idle) add(next);
  return out;
}

std::set<World> everything_reachable() {
  std::set<World> known{World{}};
  std::deque<World> open{World{}};
  while (!open.empty()) {
    const World w = open.front();
    open.pop_front();
    for (const World& next : nexts(w, false))
      if (known.insert(next).second) open.push_back(next);
  }
  return known;
}

TEST(Counterpart, EveryStepAndEveryStateIsMet) {
  std::set<PlcStep> steps;
  std::set<State> states;
  for (const World& w : everything_reachable()) steps.insert(w.step), states.insert(w.cell);
  EXPECT_EQ(steps.size(), kPlcSteps.size() - 1) << "all but Offline, which a broken line alone leads to";
  EXPECT_EQ(states.size(), kStates.size());
}

TEST(Counterpart, FromEverywhereBothComeToRestWithoutATimeOut) {
  const std::set<World> all = everything_reachable();
  std::map<World, std::vector<World>> before;
  std::deque<World> open;
  std::set<World> good;
  for (const World& w : all) {
    for (const World& next : nexts(w, true)) before[next].push_back(w);
    if (w.step == PlcStep::Idle && w.cell == State::Ready && w.seen == 0) good.insert(w), open.push_back(w);
  }
  ASSERT_FALSE(good.empty());
  while (!open.empty()) {
    const World w = open.front();
    open.pop_front();
    for (const World& earlier : before[w])
      if (good.insert(earlier).second) open.push_back(earlier);
  }
  for (const World& w : all)
    EXPECT_TRUE(good.contains(w)) << "no way on from step " << text_of(w.step).name << ", cell " << to_string(w.cell)
                                  << ", control " << w.seen << ", bits " << w.bits;
}

TEST(Counterpart, NoPickIsWaitedForThatTheCellDoesNotWorkOn) {
  for (const World& w : everything_reachable()) {
    if (w.step != PlcStep::WaitResult && w.step != PlcStep::WaitScanDone) continue;
    const bool coming = w.cell == State::Scanning || w.cell == State::Detecting || w.cell == State::Fault ||
                        (w.bits & status::kResultValid) != 0;
    EXPECT_TRUE(coming) << text_of(w.step).name << " while the cell is " << to_string(w.cell);
  }
}
}  // namespace
}  // namespace binpick::plc
