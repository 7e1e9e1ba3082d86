#pragma once

#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <variant>

#include "base/expected.hpp"
#include "tests/emulators/faults.hpp"

/// What is typed at a running binpick-emulator, or given by --fault: one command per line.
namespace binpick::emulators {
enum class Device { Pivot, Scanner, Robot, Poses, Plc };  ///< Poses: of a robot that carries the scanner.
std::string_view to_string(Device device);

/// "scanner silent on", "pivot error_code 5", "robot healthy".
struct FaultCommand {
  Device device = Device::Pivot;
  std::function<void(Faults&)> apply;
  std::string text;  ///< As it was understood, for the confirmation.
};
/// "pick", "take", "refill", "robot restart", "robot stop_on_path", "plc restart", "plc abort", "plc reset", "pivot
/// power_cycle", "status", "help", "quit".
struct Order {
  enum class Kind {
    Pick,
    Take,
    Refill,
    RobotRestart,
    RobotStopOnPath,
    PlcRestart,
    PlcAbort,
    PlcReset,
    PivotPowerCycle,
    Status,
    Help,
    Quit
  };
  Kind kind = Kind::Help;
};
using Command = std::variant<FaultCommand, Order>;

/// An error says what was not understood and what is possible. Words are separated by blanks, upper and lower case
/// differ.
Expected<Command, std::string> parse_command(std::string_view line);
/// All commands with their meaning, one per line.
std::string command_help();
}  // namespace binpick::emulators
