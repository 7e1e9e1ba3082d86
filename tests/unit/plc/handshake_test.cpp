#include "plc/handshake.hpp"

#include <gtest/gtest.h>
#include <map>
#include <set>
#include <string>

namespace binpick::plc {
namespace {
using namespace std::chrono_literals;

/// The table once more, as a PLC programmer would draw it: one line per signal, one column per state
/// (NotReady, Ready, Scanning, Detecting, ResultValid, Fault). A cell is "next/effect"; "-" means: nothing happens.
struct Line {
  Signal signal;
  std::array<std::string_view, 6> cells;
};
const std::array kDrawn{
    Line{Signal::DevicesReady, {"Ready/None", "-", "-", "-", "-", "-"}},
    Line{Signal::DevicesMissing, {"-", "NotReady/None", "-", "-", "-", "-"}},
    Line{Signal::NewRequest,
         {"NotReady/RefuseNotReady", "Scanning/AcceptAndScan", "Scanning/RefuseNotReady", "Detecting/RefuseNotReady",
          "Scanning/AcceptAndScan", "Fault/RefuseNotReady"}},
    Line{Signal::BadRequest,
         {"NotReady/Refuse", "ResultValid/Refuse", "Scanning/Refuse", "Detecting/Refuse", "ResultValid/Refuse",
          "Fault/Refuse"}},
    Line{Signal::RepeatedRequest,
         {"NotReady/RepeatResult", "ResultValid/RepeatResult", "Scanning/AckAgain", "Detecting/AckAgain",
          "ResultValid/RepeatResult", "Fault/RepeatResult"}},
    Line{Signal::StandingRequest,
         {"NotReady/Refuse", "ResultValid/Refuse", "-", "-", "ResultValid/Refuse", "Fault/Refuse"}},
    Line{Signal::RequestDropped,
         {"NotReady/DropAck", "Ready/DropAck", "Scanning/DropAck", "Detecting/DropAck", "ResultValid/DropAck",
          "Fault/DropAck"}},
    Line{Signal::ScanComplete, {"-", "-", "Detecting/StartDetection", "-", "-", "-"}},
    Line{Signal::DetectionDone, {"-", "-", "ResultValid/PublishResult", "ResultValid/PublishResult", "-", "-"}},
    Line{Signal::ResultAcked,
         {"NotReady/ClearResult", "Ready/ClearResult", "Scanning/ClearResult", "Detecting/ClearResult",
          "Ready/ClearResult", "Fault/ClearResult"}},
    Line{Signal::AbortRaised,
         {"NotReady/ClearResult", "Ready/ClearResult", "Ready/StopAndClear", "Ready/StopAndClear", "Ready/ClearResult",
          "Fault/ClearResult"}},
    Line{Signal::ResetRaised,
         {"NotReady/ClearFault", "Ready/None", "Scanning/None", "Detecting/None", "ResultValid/None",
          "NotReady/ClearFault"}},
    Line{Signal::FaultRaised,
         {"Fault/RaiseFault", "Fault/RaiseFault", "Fault/RaiseFault", "Fault/RaiseFault", "Fault/RaiseFault",
          "Fault/RaiseFault"}},
    Line{Signal::Deadline, {"-", "-", "Fault/TimeOut", "Fault/TimeOut", "-", "-"}},
};

/// Signals that lead from NotReady to each state.
const std::map<State, std::vector<Signal>> kWays{
    {State::NotReady, {}},
    {State::Ready, {Signal::DevicesReady}},
    {State::Scanning, {Signal::DevicesReady, Signal::NewRequest}},
    {State::Detecting, {Signal::DevicesReady, Signal::NewRequest, Signal::ScanComplete}},
    {State::ResultValid, {Signal::DevicesReady, Signal::NewRequest, Signal::ScanComplete, Signal::DetectionDone}},
    {State::Fault, {Signal::FaultRaised}},
};
}  // namespace

TEST(Handshake, EveryStateTimesEverySignalIsAsDrawn) {
  ASSERT_EQ(kDrawn.size(), kSignals.size());
  for (const Line& line : kDrawn) {
    for (std::size_t i = 0; i < kStates.size(); ++i) {
      Handshake handshake{{}};
      for (const Signal signal : kWays.at(kStates[i])) handshake.apply(signal, TimePoint{});
      ASSERT_EQ(handshake.state(), kStates[i]);
      const Step step = handshake.apply(line.signal, TimePoint{});
      std::string got = "-";
      if (step.expected) got = std::string(to_string(step.after)) + "/" + std::string(to_string(step.effect));
      EXPECT_EQ(got, line.cells[i]) << to_string(line.signal) << " in " << to_string(kStates[i]);
      EXPECT_EQ(step.before, kStates[i]);
      EXPECT_EQ(handshake.state(), step.after);
      if (!step.expected) {
        EXPECT_EQ(step.after, step.before) << "an unexpected signal leaves the state as it was";
      }
    }
  }
}

TEST(Handshake, EveryStateReachesReady) {
  std::set<State> reaching{State::Ready};
  for (std::size_t round = 0; round < kStates.size(); ++round)
    for (const Row& row : kRows)
      if (reaching.contains(row.to)) reaching.insert(row.from);
  EXPECT_EQ(reaching.size(), kStates.size());
}

TEST(Handshake, WhereThePlcWaitsThereIsADeadline) {
  for (const State state : {State::Scanning, State::Detecting}) {
    ASSERT_NE(find_row(state, Signal::Deadline), nullptr);
    EXPECT_EQ(find_row(state, Signal::Deadline)->to, State::Fault);
  }
  Handshake handshake{{.scan = 8s, .detect = 3s}};
  const TimePoint t{100s};
  EXPECT_EQ(handshake.deadline(), std::nullopt);
  handshake.apply(Signal::DevicesReady, t);
  EXPECT_EQ(handshake.deadline(), std::nullopt);
  handshake.apply(Signal::NewRequest, t);
  EXPECT_EQ(handshake.deadline(), t + 8s);
  handshake.apply(Signal::RequestDropped, t + 1s);
  EXPECT_EQ(handshake.deadline(), t + 8s) << "what the PLC says does not win time";
  handshake.apply(Signal::ScanComplete, t + 2s);
  EXPECT_EQ(handshake.deadline(), t + 5s);
  handshake.apply(Signal::DetectionDone, t + 3s);
  EXPECT_EQ(handshake.deadline(), std::nullopt) << "a result never expires";
}
}  // namespace binpick::plc
