#pragma once

#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string_view>

#include "base/clock.hpp"
#include "base/state_table.hpp"

/// The pick handshake seen from the cell. Pure: signals in, effects out; everything that changes the state is a row of
/// kRows. docs/plc-registers.md holds the table and the diagram generated from it.
///
/// Rules that the rows carry: the PLC drops its request when it sees the acknowledge; a result stays until it is
/// acknowledged or until the next request; the number of the last accepted request again gets the stored answer and
/// never new work; what cannot be done now is refused with a code, at once, and does not disturb what runs.
namespace binpick::plc {
/// Values are those of the register cell_state; integrators depend on them, so they never change.
enum class State : std::uint16_t {
  NotReady = 0,
  Ready = 10,
  Scanning = 20,
  Detecting = 30,
  ResultValid = 40,
  Fault = 90
};

enum class Signal : std::uint8_t {
  DevicesReady,     ///< Nothing is missing any more.
  DevicesMissing,   ///< A device went away.
  NewRequest,       ///< Raised with a new number, part and supply known.
  BadRequest,       ///< Raised, but part, supply or number are wrong, a device is missing, or abort stands.
  RepeatedRequest,  ///< Raised again with the number of the last accepted request.
  StandingRequest,  ///< Already raised when the cell came up.
  RequestDropped,
  ScanComplete,
  DetectionDone,
  ResultAcked,
  AbortRaised,
  ResetRaised,
  FaultRaised,  ///< The cell cannot go on.
  Deadline,     ///< Scan or detection took too long.
};

enum class Effect : std::uint8_t {
  None,
  AcceptAndScan,
  Refuse,          ///< Answer at once with the code that says why.
  RefuseNotReady,  ///< Answer at once with NotReady.
  RepeatResult,    ///< Answer at once from the stored result.
  AckAgain,        ///< Acknowledge; the answer is still being worked on.
  DropAck,
  StartDetection,  ///< scan_done rises.
  PublishResult,
  ClearResult,
  StopAndClear,  ///< Stop what moves, forget the cycle.
  RaiseFault,    ///< Forget the cycle, if one runs; nothing is valid.
  TimeOut,       ///< The same, by the handshake's own deadline: stop what moves.
  ClearFault,    ///< Try the devices again.
};

struct Row {
  State from;
  Signal on;
  State to;
  Effect effect;
};

inline constexpr std::array kStates{State::NotReady,  State::Ready,       State::Scanning,
                                    State::Detecting, State::ResultValid, State::Fault};
inline constexpr std::array kSignals{Signal::DevicesReady,   Signal::DevicesMissing,  Signal::NewRequest,
                                     Signal::BadRequest,     Signal::RepeatedRequest, Signal::StandingRequest,
                                     Signal::RequestDropped, Signal::ScanComplete,    Signal::DetectionDone,
                                     Signal::ResultAcked,    Signal::AbortRaised,     Signal::ResetRaised,
                                     Signal::FaultRaised,    Signal::Deadline};

inline constexpr std::array kRows{
    // clang-format off
    Row{State::NotReady,    Signal::DevicesReady,    State::Ready,       Effect::None},
    Row{State::NotReady,    Signal::NewRequest,      State::NotReady,    Effect::RefuseNotReady},
    Row{State::NotReady,    Signal::BadRequest,      State::NotReady,    Effect::Refuse},
    Row{State::NotReady,    Signal::RepeatedRequest, State::NotReady,    Effect::RepeatResult},
    Row{State::NotReady,    Signal::StandingRequest, State::NotReady,    Effect::Refuse},
    Row{State::NotReady,    Signal::RequestDropped,  State::NotReady,    Effect::DropAck},
    Row{State::NotReady,    Signal::ResultAcked,     State::NotReady,    Effect::ClearResult},
    Row{State::NotReady,    Signal::AbortRaised,     State::NotReady,    Effect::ClearResult},
    Row{State::NotReady,    Signal::ResetRaised,     State::NotReady,    Effect::ClearFault},
    Row{State::NotReady,    Signal::FaultRaised,     State::Fault,       Effect::RaiseFault},

    Row{State::Ready,       Signal::DevicesMissing,  State::NotReady,    Effect::None},
    Row{State::Ready,       Signal::NewRequest,      State::Scanning,    Effect::AcceptAndScan},
    Row{State::Ready,       Signal::BadRequest,      State::ResultValid, Effect::Refuse},
    Row{State::Ready,       Signal::RepeatedRequest, State::ResultValid, Effect::RepeatResult},
    Row{State::Ready,       Signal::StandingRequest, State::ResultValid, Effect::Refuse},
    Row{State::Ready,       Signal::RequestDropped,  State::Ready,       Effect::DropAck},
    Row{State::Ready,       Signal::ResultAcked,     State::Ready,       Effect::ClearResult},
    Row{State::Ready,       Signal::AbortRaised,     State::Ready,       Effect::ClearResult},
    Row{State::Ready,       Signal::ResetRaised,     State::Ready,       Effect::None},
    Row{State::Ready,       Signal::FaultRaised,     State::Fault,       Effect::RaiseFault},

    Row{State::Scanning,    Signal::NewRequest,      State::Scanning,    Effect::RefuseNotReady},
    Row{State::Scanning,    Signal::BadRequest,      State::Scanning,    Effect::Refuse},
    Row{State::Scanning,    Signal::RepeatedRequest, State::Scanning,    Effect::AckAgain},
    Row{State::Scanning,    Signal::RequestDropped,  State::Scanning,    Effect::DropAck},
    Row{State::Scanning,    Signal::ScanComplete,    State::Detecting,   Effect::StartDetection},
    Row{State::Scanning,    Signal::DetectionDone,   State::ResultValid, Effect::PublishResult},
    Row{State::Scanning,    Signal::ResultAcked,     State::Scanning,    Effect::ClearResult},
    Row{State::Scanning,    Signal::AbortRaised,     State::Ready,       Effect::StopAndClear},
    Row{State::Scanning,    Signal::ResetRaised,     State::Scanning,    Effect::None},
    Row{State::Scanning,    Signal::FaultRaised,     State::Fault,       Effect::RaiseFault},
    Row{State::Scanning,    Signal::Deadline,        State::Fault,       Effect::TimeOut},

    Row{State::Detecting,   Signal::NewRequest,      State::Detecting,   Effect::RefuseNotReady},
    Row{State::Detecting,   Signal::BadRequest,      State::Detecting,   Effect::Refuse},
    Row{State::Detecting,   Signal::RepeatedRequest, State::Detecting,   Effect::AckAgain},
    Row{State::Detecting,   Signal::RequestDropped,  State::Detecting,   Effect::DropAck},
    Row{State::Detecting,   Signal::DetectionDone,   State::ResultValid, Effect::PublishResult},
    Row{State::Detecting,   Signal::ResultAcked,     State::Detecting,   Effect::ClearResult},
    Row{State::Detecting,   Signal::AbortRaised,     State::Ready,       Effect::StopAndClear},
    Row{State::Detecting,   Signal::ResetRaised,     State::Detecting,   Effect::None},
    Row{State::Detecting,   Signal::FaultRaised,     State::Fault,       Effect::RaiseFault},
    Row{State::Detecting,   Signal::Deadline,        State::Fault,       Effect::TimeOut},

    Row{State::ResultValid, Signal::NewRequest,      State::Scanning,    Effect::AcceptAndScan},
    Row{State::ResultValid, Signal::BadRequest,      State::ResultValid, Effect::Refuse},
    Row{State::ResultValid, Signal::RepeatedRequest, State::ResultValid, Effect::RepeatResult},
    Row{State::ResultValid, Signal::StandingRequest, State::ResultValid, Effect::Refuse},
    Row{State::ResultValid, Signal::RequestDropped,  State::ResultValid, Effect::DropAck},
    Row{State::ResultValid, Signal::ResultAcked,     State::Ready,       Effect::ClearResult},
    Row{State::ResultValid, Signal::AbortRaised,     State::Ready,       Effect::ClearResult},
    Row{State::ResultValid, Signal::ResetRaised,     State::ResultValid, Effect::None},
    Row{State::ResultValid, Signal::FaultRaised,     State::Fault,       Effect::RaiseFault},

    Row{State::Fault,       Signal::NewRequest,      State::Fault,       Effect::RefuseNotReady},
    Row{State::Fault,       Signal::BadRequest,      State::Fault,       Effect::Refuse},
    Row{State::Fault,       Signal::RepeatedRequest, State::Fault,       Effect::RepeatResult},
    Row{State::Fault,       Signal::StandingRequest, State::Fault,       Effect::Refuse},
    Row{State::Fault,       Signal::RequestDropped,  State::Fault,       Effect::DropAck},
    Row{State::Fault,       Signal::ResultAcked,     State::Fault,       Effect::ClearResult},
    Row{State::Fault,       Signal::AbortRaised,     State::Fault,       Effect::ClearResult},
    Row{State::Fault,       Signal::ResetRaised,     State::NotReady,    Effect::ClearFault},
    Row{State::Fault,       Signal::FaultRaised,     State::Fault,       Effect::RaiseFault},
    // clang-format on
};

/// Place of the row in kRows, kRows.size() when there is none. (An index and no pointer, see
/// base/state_table.hpp.)
constexpr std::size_t row_index(State from, Signal on) {
  for (std::size_t i = 0; i < kRows.size(); ++i)
    if (kRows[i].from == from && kRows[i].on == on) return i;
  return kRows.size();
}
constexpr bool has_row(State from, Signal on) { return row_index(from, on) < kRows.size(); }

constexpr const Row* find_row(State from, Signal on) {
  return has_row(from, on) ? &kRows[row_index(from, on)] : nullptr;
}

namespace detail {
/// Whatever the PLC says, and whatever fails, has an answer in every state.
constexpr bool nothing_is_left_unanswered() {
  constexpr std::array kAlways{Signal::NewRequest,     Signal::BadRequest,  Signal::RepeatedRequest,
                               Signal::RequestDropped, Signal::ResultAcked, Signal::AbortRaised,
                               Signal::ResetRaised,    Signal::FaultRaised};
  for (const State state : kStates)
    for (const Signal signal : kAlways)
      if (!has_row(state, signal)) return false;
  return true;
}
}  // namespace detail
static_assert(rows_are_unique(kRows));
static_assert(detail::nothing_is_left_unanswered());

struct Timeouts {
  std::chrono::milliseconds scan{15000};
  std::chrono::milliseconds detect{5000};
};

/// expected == false: no such row; nothing changed.
struct Step {
  State before;
  State after;
  Effect effect;
  bool expected;
};

class Handshake {
 public:
  explicit Handshake(const Timeouts& timeouts) : timeouts_{timeouts} {}

  Step apply(Signal signal, TimePoint now) {
    const Row* row = find_row(state_, signal);
    if (row == nullptr) return {state_, state_, Effect::None, false};
    const Step step{state_, row->to, row->effect, true};
    state_ = row->to;
    if (step.before != step.after) {
      deadline_.reset();
      if (state_ == State::Scanning) deadline_ = now + timeouts_.scan;
      if (state_ == State::Detecting) deadline_ = now + timeouts_.detect;
    }
    return step;
  }

  State state() const { return state_; }
  /// When to apply Signal::Deadline, if ever.
  std::optional<TimePoint> deadline() const { return deadline_; }
  /// In force from the next transition on.
  void set_timeouts(const Timeouts& timeouts) { timeouts_ = timeouts; }

 private:
  Timeouts timeouts_;
  State state_ = State::NotReady;
  std::optional<TimePoint> deadline_;
};

std::string_view to_string(State state);
std::string_view to_string(Signal signal);
std::string_view to_string(Effect effect);
}  // namespace binpick::plc
