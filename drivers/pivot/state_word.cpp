#include "drivers/pivot/state_word.hpp"

#include <array>

#include "drivers/pivot/motion_errors.hpp"

namespace binpick::drivers::pivot {
namespace {
struct Bit {
  std::uint32_t mask;
  const char* name;
  const char* remedy;  ///< nullptr: news, no fault.
};

constexpr std::array kBits{
    Bit{state::kMotorSupply, "motor supply gone: emergency stop open?", "close it; the pivot resets itself"},
    Bit{state::kTow, "following error (tow)", "free the axis; check load and sweep speed"},
    Bit{state::kCommunication, "communication error inside the module", "check the CAN cable and its termination"},
    Bit{state::kStageTemperature, "power stage too hot", "let it cool, then switch the module off and on"},
    Bit{state::kWatchdog, "watchdog expired or winding too hot", "check the bus load; let the motor cool"},
    Bit{state::kShortCircuit, "short circuit in the motor stage", "switch off and check the module's wiring"},
    Bit{state::kHall, "Hall sensor error", "the module needs service"},
    Bit{state::kI2t, "motor overloaded (I2t)", "free the axis, then switch the module off and on"},
    Bit{state::kCpuOverload, "module CPU overloaded", "switch the module off and on"},
    Bit{state::kHardLimit, "beyond the hard limit", "turn the axis back by hand with the motor supply off"},
    Bit{state::kSoftLimit, "beyond the soft limit", "turn the axis back inside its limits"},
    Bit{state::kLogicVoltage, "logic voltage out of range", "check the 24 V logic supply"},
    Bit{state::kHalt, "halted", "it is reset before the next move"},
    Bit{state::kHomeOk, "referenced", nullptr},
    Bit{state::kHomeSwitch, "home switch", nullptr},
    Bit{state::kLimit1, "limit switch 1", nullptr},
    Bit{state::kLimit2, "limit switch 2", nullptr},
    Bit{state::kBrake, "brake engaged", nullptr},
    Bit{state::kCurrentLimit, "current limit", nullptr},
    Bit{state::kMotion, "moving", nullptr},
    Bit{state::kRampAccelerating, "ramp accelerating", nullptr},
    Bit{state::kRampSteady, "ramp steady", nullptr},
    Bit{state::kRampDecelerating, "ramp decelerating", nullptr},
    Bit{state::kRampEnd, "ramp finished", nullptr},
    Bit{state::kStepInProgress, "step in progress", nullptr},
    Bit{state::kStepBufferFull, "step buffer full", nullptr},
};

struct ShortBit {
  std::uint8_t mask;
  const char* name;
};
constexpr std::array kShortBits{
    ShortBit{short_state::kError, "error"},
    ShortBit{short_state::kHomeSwitch, "home switch"},
    ShortBit{short_state::kLimit1, "limit switch 1"},
    ShortBit{short_state::kLimit2, "limit switch 2"},
    ShortBit{short_state::kMotion, "moving"},
    ShortBit{short_state::kRampEnd, "ramp finished"},
    ShortBit{short_state::kInProgress, "step in progress"},
    ShortBit{short_state::kBufferFull, "step buffer full"},
};

void append(std::string& text, const char* separator, const char* words) {
  if (!text.empty()) text += separator;
  text += words;
}
}  // namespace

std::string faults_in_words(std::uint32_t state_word) {
  std::string text;
  for (const Bit& bit : kBits) {
    if (bit.remedy == nullptr || (state_word & bit.mask) == 0) continue;
    append(text, "; ", bit.name);
    text += std::string(" (") + bit.remedy + ")";
  }
  if (text.empty() && (state_word & state::kError) != 0)
    text = "an error that the module does not name (switch the module off and on if it stays)";
  return text;
}

std::string faults_in_words(const ModuleState& module) {
  const bool fault = (module.word & (state::kFaults | state::kHalt)) != 0;
  return fault && module.code != 0 ? motion::error_in_words(module.code) : faults_in_words(module.word);
}

std::string state_in_words(std::uint32_t state_word) {
  std::string text;
  if ((state_word & state::kError) != 0) text = "error";
  for (const Bit& bit : kBits)
    if ((state_word & bit.mask) != 0) append(text, ", ", bit.name);
  return text.empty() ? "not referenced, standing" : text;
}

std::string short_state_in_words(std::uint8_t short_state) {
  std::string text;
  for (const ShortBit& bit : kShortBits)
    if ((short_state & bit.mask) != 0) append(text, ", ", bit.name);
  return text.empty() ? "standing" : text;
}
}  // namespace binpick::drivers::pivot
