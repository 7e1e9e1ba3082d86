#include "daemon/sequence_docs.hpp"

#include "daemon/sequence.hpp"
#include "drivers/sweep/sequence.hpp"

namespace binpick::daemon {
namespace {
const char* name(CellState state) {
  switch (state) {
    case CellState::Idle:
      return "Idle";
    case CellState::AwaitingClear:
      return "AwaitingClear";
    case CellState::Sweeping:
      return "Sweeping";
    case CellState::Detecting:
      return "Detecting";
  }
  return "?";
}

const char* name(CellInput input) {
  switch (input) {
    case CellInput::Request:
      return "request accepted";
    case CellInput::KnownRequest:
      return "request accepted, the last scan holds another pick";
    case CellInput::RobotClear:
      return "robot clear of the view";
    case CellInput::RobotEntered:
      return "robot entered the view";
    case CellInput::SweepDone:
      return "sweep done";
    case CellInput::SweepFailed:
      return "sweep failed";
    case CellInput::DetectionDone:
      return "detection done";
    case CellInput::DetectionFailed:
      return "detection failed";
    case CellInput::DeviceLost:
      return "pivot or scanner lost";
    case CellInput::Cancelled:
      return "abort, time-out, PLC gone or daemon stopping";
  }
  return "?";
}

const char* name(CellEffect effect) {
  switch (effect) {
    case CellEffect::None:
      return "–";
    case CellEffect::BeginSweep:
      return "begin the sweep";
    case CellEffect::StartDetection:
      return "scan done: robot may enter; start detection";
    case CellEffect::Publish:
      return "result to the PLC, pick to the robot";
    case CellEffect::FaultCycle:
      return "stop the pivot, nothing valid, fault with alarm; PLC has to reset";
    case CellEffect::StopQuietly:
      return "stop the pivot, nothing valid";
  }
  return "?";
}

namespace sweep = drivers::sweep;
const char* name(sweep::State state) {
  switch (state) {
    case sweep::State::Idle:
      return "Idle";
    case sweep::State::Preparing:
      return "Preparing";
    case sweep::State::AtStart:
      return "AtStart";
    case sweep::State::Measuring:
      return "Measuring";
    case sweep::State::Sweeping:
      return "Sweeping";
    case sweep::State::Draining:
      return "Draining";
  }
  return "?";
}

const char* name(sweep::Input input) {
  switch (input) {
    case sweep::Input::Begin:
      return "begin";
    case sweep::Input::AtStart:
      return "carrier at the start";
    case sweep::Input::FirstProfile:
      return "first profile";
    case sweep::Input::AtEnd:
      return "carrier at the end";
    case sweep::Input::ScannerStopped:
      return "scanner stopped";
    case sweep::Input::DeviceFailed:
      return "device failed";
    case sweep::Input::Abort:
      return "abort";
    case sweep::Input::Deadline:
      return "deadline passed";
  }
  return "?";
}

const char* name(sweep::Effect effect) {
  switch (effect) {
    case sweep::Effect::None:
      return "–";
    case sweep::Effect::MoveToStartAndMeasure:
      return "carrier to the start, scanner measures";
    case sweep::Effect::MoveToEnd:
      return "carrier to the end at sweep speed";
    case sweep::Effect::StopScanner:
      return "stop the scanner, last profiles get their poses";
    case sweep::Effect::Finish:
      return "sweep done";
    case sweep::Effect::StopAndFail:
      return "stop both, sweep failed";
    case sweep::Effect::StopQuietly:
      return "stop both";
  }
  return "?";
}

template <class Rows>
std::string table_and_diagram(const Rows& rows) {
  std::string table = "| in state | on | goes to | and does |\n|---|---|---|---|\n";
  std::string diagram = "```mermaid\nstateDiagram-v2\n  [*] --> Idle\n";
  for (const auto& row : rows) {
    table += std::string("| ") + name(row.from) + " | " + name(row.on) + " | " + name(row.to) + " | " +
             name(row.effect) + " |\n";
    diagram += std::string("  ") + name(row.from) + " --> " + name(row.to) + ": " + name(row.on) + "\n";
  }
  return table + "\n" + diagram + "```\n";
}
}  // namespace

std::string sequence_markdown() {
  return "# The cell's sequence\n\n"
         "Generated from the tables that the program runs on (`daemon/sequence.hpp`, `drivers/sweep/sequence.hpp`); a "
         "test fails "
         "when this page is stale. An input that has no row in a state means nothing there and changes nothing. The "
         "handshake "
         "with the PLC is a table of its own: [plc-registers.md](plc-registers.md).\n\n"
         "## One cycle, from the PLC's request to its answer\n\n" +
         table_and_diagram(kCellRows) +
         "\n## One sweep\n\n"
         "The carrier of the scanner is the pivot, or the robot on a path that was taught it. Carrier and scanner get "
         "ready at the same time; whichever is first waits for the other. A pivot starts from the end that it is "
         "nearer to.\n\n" +
         table_and_diagram(sweep::kRows);
}
}  // namespace binpick::daemon
