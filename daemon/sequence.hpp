#pragma once

#include <array>

#include "base/state_table.hpp"

/// One cycle of the cell as a table: what happens between the PLC's accepted request and its answer.
namespace binpick::daemon {
enum class CellState {
  Idle,
  AwaitingClear,  ///< The robot stands in the view.
  Sweeping,
  Detecting,
};
enum class CellInput {
  Request,       ///< The PLC's request was accepted.
  KnownRequest,  ///< The same, and the last scan of the supply holds another pick for it.
  RobotClear,    ///< The robot is out of the view.
  RobotEntered,  ///< The robot came into the view.
  SweepDone,
  SweepFailed,
  DetectionDone,
  DetectionFailed,
  DeviceLost,  ///< Pivot or scanner, outside a sweep.
  Cancelled,   ///< Abort or time-out by the handshake, PLC gone, or the daemon stops.
};
enum class CellEffect {
  None,
  BeginSweep,
  StartDetection,
  Publish,      ///< Result to the PLC, pick to the robot.
  FaultCycle,   ///< Stop what moves, nothing valid, alarm; the PLC has to reset.
  StopQuietly,  ///< Stop what moves, nothing valid; whoever asked for it knows.
};
struct CellRow {
  CellState from;
  CellInput on;
  CellState to;
  CellEffect effect;
};

inline constexpr std::array kCellRows{
    CellRow{CellState::Idle, CellInput::Request, CellState::AwaitingClear, CellEffect::None},
    CellRow{CellState::Idle, CellInput::KnownRequest, CellState::Idle, CellEffect::Publish},
    CellRow{CellState::AwaitingClear, CellInput::RobotClear, CellState::Sweeping, CellEffect::BeginSweep},
    CellRow{CellState::AwaitingClear, CellInput::DeviceLost, CellState::Idle, CellEffect::FaultCycle},
    CellRow{CellState::AwaitingClear, CellInput::Cancelled, CellState::Idle, CellEffect::StopQuietly},
    CellRow{CellState::Sweeping, CellInput::SweepDone, CellState::Detecting, CellEffect::StartDetection},
    CellRow{CellState::Sweeping, CellInput::SweepFailed, CellState::Idle, CellEffect::FaultCycle},
    CellRow{CellState::Sweeping, CellInput::RobotEntered, CellState::Idle, CellEffect::FaultCycle},
    CellRow{CellState::Sweeping, CellInput::Cancelled, CellState::Idle, CellEffect::StopQuietly},
    CellRow{CellState::Detecting, CellInput::DetectionDone, CellState::Idle, CellEffect::Publish},
    CellRow{CellState::Detecting, CellInput::DetectionFailed, CellState::Idle, CellEffect::FaultCycle},
    // A scan whose devices failed right after it is not trusted: an emergency stop, most often.
    CellRow{CellState::Detecting, CellInput::DeviceLost, CellState::Idle, CellEffect::FaultCycle},
    CellRow{CellState::Detecting, CellInput::Cancelled, CellState::Idle, CellEffect::StopQuietly},
};

static_assert(rows_are_unique(kCellRows), "no two rows for the same state and input");
}  // namespace binpick::daemon
