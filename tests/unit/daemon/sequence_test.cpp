#include "daemon/sequence.hpp"

#include <fstream>
#include <gtest/gtest.h>
#include <set>
#include <sstream>
#include <vector>

#include "daemon/sequence_docs.hpp"
#include "drivers/sweep/sequence.hpp"

namespace binpick {
namespace {
template <class State, class Rows>
std::set<State> states_that_reach_idle(const Rows& rows) {
  std::set<State> reach{State::Idle};
  for (bool grown = true; grown;) {
    grown = false;
    for (const auto& row : rows)
      if (reach.contains(row.to)) grown |= reach.insert(row.from).second;
  }
  return reach;
}
}  // namespace

TEST(CellSequence, EveryStateComesBackToIdle) {
  using daemon::CellState;
  EXPECT_EQ(states_that_reach_idle<CellState>(daemon::kCellRows),
            (std::set{CellState::Idle, CellState::AwaitingClear, CellState::Sweeping, CellState::Detecting}));
}

TEST(CellSequence, EveryRunningStateCanBeCancelledAndStopsThePivot) {
  using daemon::CellState;
  for (const auto state : {CellState::AwaitingClear, CellState::Sweeping, CellState::Detecting}) {
    const auto* row = find_row(daemon::kCellRows, state, daemon::CellInput::Cancelled);
    ASSERT_NE(row, nullptr);
    EXPECT_EQ(row->to, CellState::Idle);
    EXPECT_EQ(row->effect, daemon::CellEffect::StopQuietly);
  }
}

TEST(CellSequence, OnlyADoneDetectionOrAKnownScanPublishes) {
  for (const auto& row : daemon::kCellRows)
    if (row.effect == daemon::CellEffect::Publish && row.on != daemon::CellInput::KnownRequest) {
      EXPECT_EQ(row.from, daemon::CellState::Detecting);
      EXPECT_EQ(row.on, daemon::CellInput::DetectionDone);
    }
}

TEST(CellSequence, NoSweepWithoutAClearRobot) {
  for (const auto& row : daemon::kCellRows)
    EXPECT_TRUE(row.effect != daemon::CellEffect::BeginSweep || row.on == daemon::CellInput::RobotClear);
}

TEST(SweepSequence, EveryRunningStateHasDeadlineAbortAndDeviceFailure) {
  using drivers::sweep::Input;
  using drivers::sweep::State;
  for (const auto state : {State::Preparing, State::AtStart, State::Measuring, State::Sweeping, State::Draining})
    for (const auto input : {Input::Deadline, Input::Abort, Input::DeviceFailed}) {
      const auto* row = find_row(drivers::sweep::kRows, state, input);
      ASSERT_NE(row, nullptr);
      EXPECT_EQ(row->to, State::Idle);
    }
  EXPECT_EQ(states_that_reach_idle<State>(drivers::sweep::kRows).size(), 6U);
}

TEST(Sequences, PageIsNotStale) {
  std::ifstream file(BINPICK_SOURCE_DIR "/docs/cell-sequence.md");
  std::stringstream page;
  page << file.rdbuf();
  EXPECT_EQ(page.str(), daemon::sequence_markdown()) << "write it anew: sequence_docs > docs/cell-sequence.md";
}
}  // namespace binpick
