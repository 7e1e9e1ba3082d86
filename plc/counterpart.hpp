#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <string_view>

#include "plc/handshake.hpp"
#include "plc/registers.hpp"

/// The other side of the handshake table: what a PLC program does, as a table of its own. The programs that `binpick
/// export plc` writes are made from it, for every make of PLC. Which control bits stand in a step belongs to the step;
/// so no bit can be left behind by a way out that was not thought of.
namespace binpick::plc {
/// Values stand in the exported programs as their variable `step`.
enum class PlcStep : std::uint16_t {
  Offline = 0,
  Idle = 10,
  Requesting = 20,
  WaitScanDone = 30,
  WaitResult = 40,
  Acknowledging = 50,
  Finished = 60,
  Aborting = 80,
  Fault = 90,
  Resetting = 95,
};

/// What a PLC program waits for.
enum class When : std::uint8_t {
  Nothing,
  LineUpAgain,  ///< The line is back, the cell was not restarted, and a request has no answer yet.
  LineUp,
  LineLost,  ///< The cell's heartbeat stands still, the map does not fit, or the cell was restarted.
  AbortWanted,
  ResetWanted,
  StartWanted,
  StartDropped,
  Acked,
  ScanDone,
  ResultThere,
  ResultCleared,
  Faulted,
  FaultGone,
  AbortAcked,
  ResetAcked,
  TimedOut,    ///< No result for longer than the cell's own time-outs together.
  Unanswered,  ///< A level was not acknowledged.
};

/// What it does on the way.
enum class Act : std::uint8_t {
  None,
  Meet,          ///< Forget the request, if any; remember which start of the cell this is.
  ChooseNumber,  ///< A new number, part and supply; result_ack 0.
  AskAgain,      ///< The same number, part and supply; result_ack 0.
  TakeResult,    ///< Copy the result, acknowledge it.
  GiveUp,
  GiveUpLate,  ///< The same, by the PLC's own time-out.
};

struct PlcStepText {
  PlcStep step;
  std::string_view name;
  std::uint16_t control;  ///< Bits that stand in this step; robot_clear comes from outside.
  std::string_view help;
};

struct PlcRow {
  PlcStep from;
  When on;
  PlcStep to;
  Act act;
};

inline constexpr std::array kPlcSteps{
    PlcStepText{PlcStep::Offline, "Offline", 0, "No line to the cell, or program and map do not fit; see problem."},
    PlcStepText{PlcStep::Idle, "Idle", 0, "Waits for start, for ready, and for the robot to be clear."},
    PlcStepText{PlcStep::Requesting, "Requesting", control::kRequest, "The request stands; waits for ack."},
    PlcStepText{PlcStep::WaitScanDone, "WaitScanDone", 0, "Accepted; waits for scan_done, the robot stays out."},
    PlcStepText{PlcStep::WaitResult, "WaitResult", 0, "The scan is done, the robot may enter; waits for the result."},
    PlcStepText{PlcStep::Acknowledging, "Acknowledging", 0,
                "The result is taken; waits until the cell has cleared it."},
    PlcStepText{PlcStep::Finished, "Finished", 0, "done or failed is 1; waits until start is dropped."},
    PlcStepText{PlcStep::Aborting, "Aborting", control::kAbort, "abort stands; waits for abort_ack."},
    PlcStepText{PlcStep::Fault, "Fault", 0, "The cell has a fault, first_alarm tells which; waits for reset."},
    PlcStepText{PlcStep::Resetting, "Resetting", control::kReset, "reset stands; waits for reset_ack."},
};

/// Of the rows of one step the first that fits is taken.
inline constexpr std::array kPlcRows{
    // clang-format off
    PlcRow{PlcStep::Offline,       When::LineUpAgain,   PlcStep::Requesting,    Act::AskAgain},
    PlcRow{PlcStep::Offline,       When::LineUp,        PlcStep::Idle,          Act::Meet},

    PlcRow{PlcStep::Idle,          When::LineLost,      PlcStep::Offline,       Act::None},
    PlcRow{PlcStep::Idle,          When::AbortWanted,   PlcStep::Aborting,      Act::GiveUp},
    PlcRow{PlcStep::Idle,          When::ResetWanted,   PlcStep::Resetting,     Act::GiveUp},
    PlcRow{PlcStep::Idle,          When::Faulted,       PlcStep::Fault,         Act::GiveUp},
    PlcRow{PlcStep::Idle,          When::StartWanted,   PlcStep::Requesting,    Act::ChooseNumber},

    PlcRow{PlcStep::Requesting,    When::LineLost,      PlcStep::Offline,       Act::None},
    PlcRow{PlcStep::Requesting,    When::AbortWanted,   PlcStep::Aborting,      Act::GiveUp},
    PlcRow{PlcStep::Requesting,    When::Acked,         PlcStep::WaitScanDone,  Act::None},
    PlcRow{PlcStep::Requesting,    When::Faulted,       PlcStep::Fault,         Act::GiveUp},
    PlcRow{PlcStep::Requesting,    When::TimedOut,      PlcStep::Aborting,      Act::GiveUpLate},

    PlcRow{PlcStep::WaitScanDone,  When::LineLost,      PlcStep::Offline,       Act::None},
    PlcRow{PlcStep::WaitScanDone,  When::AbortWanted,   PlcStep::Aborting,      Act::GiveUp},
    PlcRow{PlcStep::WaitScanDone,  When::ScanDone,      PlcStep::WaitResult,    Act::None},
    PlcRow{PlcStep::WaitScanDone,  When::ResultThere,   PlcStep::Acknowledging, Act::TakeResult},
    PlcRow{PlcStep::WaitScanDone,  When::Faulted,       PlcStep::Fault,         Act::GiveUp},
    PlcRow{PlcStep::WaitScanDone,  When::TimedOut,      PlcStep::Aborting,      Act::GiveUpLate},

    PlcRow{PlcStep::WaitResult,    When::LineLost,      PlcStep::Offline,       Act::None},
    PlcRow{PlcStep::WaitResult,    When::AbortWanted,   PlcStep::Aborting,      Act::GiveUp},
    PlcRow{PlcStep::WaitResult,    When::ResultThere,   PlcStep::Acknowledging, Act::TakeResult},
    PlcRow{PlcStep::WaitResult,    When::Faulted,       PlcStep::Fault,         Act::GiveUp},
    PlcRow{PlcStep::WaitResult,    When::TimedOut,      PlcStep::Aborting,      Act::GiveUpLate},

    PlcRow{PlcStep::Acknowledging, When::LineLost,      PlcStep::Finished,      Act::None},
    PlcRow{PlcStep::Acknowledging, When::ResultCleared, PlcStep::Finished,      Act::None},
    PlcRow{PlcStep::Acknowledging, When::Unanswered,    PlcStep::Finished,      Act::None},

    PlcRow{PlcStep::Finished,      When::AbortWanted,   PlcStep::Aborting,      Act::GiveUp},
    PlcRow{PlcStep::Finished,      When::StartDropped,  PlcStep::Idle,          Act::None},

    PlcRow{PlcStep::Aborting,      When::LineLost,      PlcStep::Offline,       Act::None},
    PlcRow{PlcStep::Aborting,      When::AbortAcked,    PlcStep::Finished,      Act::None},
    PlcRow{PlcStep::Aborting,      When::Unanswered,    PlcStep::Offline,       Act::None},

    PlcRow{PlcStep::Fault,         When::LineLost,      PlcStep::Offline,       Act::None},
    PlcRow{PlcStep::Fault,         When::ResetWanted,   PlcStep::Resetting,     Act::None},
    PlcRow{PlcStep::Fault,         When::FaultGone,     PlcStep::Finished,      Act::None},

    PlcRow{PlcStep::Resetting,     When::LineLost,      PlcStep::Offline,       Act::None},
    PlcRow{PlcStep::Resetting,     When::ResetAcked,    PlcStep::Finished,      Act::None},
    PlcRow{PlcStep::Resetting,     When::Unanswered,    PlcStep::Offline,       Act::None},
    // clang-format on
};

/// How the PLC sees what the cell does in a row of its own table.
constexpr When seen_by_plc(Effect effect) {
  switch (effect) {
    case Effect::AcceptAndScan:
    case Effect::AckAgain:
      return When::Acked;
    case Effect::StartDetection:
      return When::ScanDone;
    case Effect::Refuse:
    case Effect::RefuseNotReady:
    case Effect::RepeatResult:
    case Effect::PublishResult:
      return When::ResultThere;
    case Effect::ClearResult:
      return When::ResultCleared;
    case Effect::StopAndClear:
      return When::AbortAcked;
    case Effect::RaiseFault:
    case Effect::TimeOut:
      return When::Faulted;
    case Effect::ClearFault:
      return When::ResetAcked;
    case Effect::None:
    case Effect::DropAck:
      return When::Nothing;
  }
  return When::Nothing;
}

constexpr bool plc_waits_for(PlcStep step, When when) {
  return std::ranges::any_of(kPlcRows, [=](const PlcRow& row) { return row.from == step && row.on == when; });
}

namespace detail {
constexpr bool plc_rows_are_unique() {
  for (const PlcRow& row : kPlcRows)
    if (std::ranges::count_if(kPlcRows, [&](const PlcRow& o) { return o.from == row.from && o.on == row.on; }) != 1)
      return false;
  return true;
}
/// The steps in which a request is under way, by what the cell's table can do meanwhile: each effect that the PLC can
/// see is waited for in one of them or, for abort and reset, in the step that holds the level.
constexpr bool every_effect_is_waited_for() {
  for (const Row& row : kRows) {
    const When when = seen_by_plc(row.effect);
    if (when == When::Nothing) continue;
    if (std::ranges::none_of(kPlcSteps, [=](const PlcStepText& s) { return plc_waits_for(s.step, when); }))
      return false;
    const bool under_way = row.from == State::Scanning || row.from == State::Detecting;
    const PlcStep step = row.from == State::Scanning ? PlcStep::WaitScanDone : PlcStep::WaitResult;
    if (under_way && (when == When::ResultThere || when == When::ScanDone || when == When::Faulted) &&
        !plc_waits_for(step, when))
      return false;
  }
  return true;
}
/// A PLC that waits for the cell has a way out when the cell does not come.
constexpr bool every_wait_ends() {
  for (const PlcStepText& s : kPlcSteps) {
    const bool for_people = s.step == PlcStep::Offline || s.step == PlcStep::Idle || s.step == PlcStep::Finished ||
                            s.step == PlcStep::Fault;
    if (for_people) continue;
    if (!plc_waits_for(s.step, When::LineLost)) return false;
    if (!plc_waits_for(s.step, When::TimedOut) && !plc_waits_for(s.step, When::Unanswered)) return false;
  }
  return true;
}
}  // namespace detail
static_assert(detail::plc_rows_are_unique());
static_assert(detail::every_effect_is_waited_for());
static_assert(detail::every_wait_ends());

constexpr const PlcStepText& text_of(PlcStep step) { return *std::ranges::find(kPlcSteps, step, &PlcStepText::step); }
}  // namespace binpick::plc
