#pragma once

#include <array>

#include "base/state_table.hpp"

/// The sweep as a table. Pure: events in, effects out.
namespace binpick::drivers::sweep {
enum class State {
  Idle,
  Preparing,  ///< The carrier goes to the start, the scanner starts measuring.
  AtStart,    ///< The carrier waits for the scanner's first profile.
  Measuring,  ///< Profiles come, the carrier is still on its way to the start.
  Sweeping,   ///< The carrier moves from start to end, profiles are collected.
  Draining,   ///< The carrier stands at the end; the scanner stops; the last profiles get their poses.
};
enum class Input { Begin, AtStart, FirstProfile, AtEnd, ScannerStopped, DeviceFailed, Abort, Deadline };
enum class Effect {
  None,
  MoveToStartAndMeasure,
  MoveToEnd,
  StopScanner,
  Finish,       ///< Report the sweep as done.
  StopAndFail,  ///< Stop carrier and scanner, say why.
  StopQuietly,  ///< Stop carrier and scanner; whoever asked for it knows.
};
struct Row {
  State from;
  Input on;
  State to;
  Effect effect;
};

inline constexpr std::array kRows{
    Row{State::Idle, Input::Begin, State::Preparing, Effect::MoveToStartAndMeasure},
    Row{State::Preparing, Input::AtStart, State::AtStart, Effect::None},
    Row{State::Preparing, Input::FirstProfile, State::Measuring, Effect::None},
    Row{State::AtStart, Input::FirstProfile, State::Sweeping, Effect::MoveToEnd},
    Row{State::Measuring, Input::AtStart, State::Sweeping, Effect::MoveToEnd},
    Row{State::Sweeping, Input::AtEnd, State::Draining, Effect::StopScanner},
    Row{State::Draining, Input::ScannerStopped, State::Idle, Effect::Finish},
    // A device that fails, and a deadline that passes, end the sweep wherever it is.
    Row{State::Preparing, Input::DeviceFailed, State::Idle, Effect::StopAndFail},
    Row{State::AtStart, Input::DeviceFailed, State::Idle, Effect::StopAndFail},
    Row{State::Measuring, Input::DeviceFailed, State::Idle, Effect::StopAndFail},
    Row{State::Sweeping, Input::DeviceFailed, State::Idle, Effect::StopAndFail},
    Row{State::Draining, Input::DeviceFailed, State::Idle, Effect::StopAndFail},
    Row{State::Preparing, Input::Deadline, State::Idle, Effect::StopAndFail},
    Row{State::AtStart, Input::Deadline, State::Idle, Effect::StopAndFail},
    Row{State::Measuring, Input::Deadline, State::Idle, Effect::StopAndFail},
    Row{State::Sweeping, Input::Deadline, State::Idle, Effect::StopAndFail},
    Row{State::Draining, Input::Deadline, State::Idle,
        Effect::Finish},  // all profiles are in, else it is DeviceFailed; only the goodbye is missing
    Row{State::Preparing, Input::Abort, State::Idle, Effect::StopQuietly},
    Row{State::AtStart, Input::Abort, State::Idle, Effect::StopQuietly},
    Row{State::Measuring, Input::Abort, State::Idle, Effect::StopQuietly},
    Row{State::Sweeping, Input::Abort, State::Idle, Effect::StopQuietly},
    Row{State::Draining, Input::Abort, State::Idle, Effect::StopQuietly},
};

static_assert(rows_are_unique(kRows), "no two rows for the same state and input");
}  // namespace binpick::drivers::sweep
