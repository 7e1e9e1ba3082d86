#pragma once

#include <cstdint>
#include <string>

/// The module's state word and short state, as bits and in words. The bits are PowerCube's (parameter 27); what a
/// module says in the Motion Protocol is put into the same bits (motion_errors.hpp), so that one session serves both.
/// Source: schunk_libm5api, m5apiw32.h; schunk_powercube_chain, PowerCubeCtrl.cpp (remedies).
namespace binpick::drivers::pivot {
namespace state {
inline constexpr std::uint32_t kError = 1U << 0;
inline constexpr std::uint32_t kHomeOk = 1U << 1;  ///< Referenced.
inline constexpr std::uint32_t kHalt = 1U << 2;    ///< Stopped by HALT; needs RESET.
inline constexpr std::uint32_t kPowerFault = 1U << 3;
inline constexpr std::uint32_t kTow = 1U << 4;
inline constexpr std::uint32_t kCommunication = 1U << 5;
inline constexpr std::uint32_t kHomeSwitch = 1U << 6;
inline constexpr std::uint32_t kLimit1 = 1U << 7;
inline constexpr std::uint32_t kLimit2 = 1U << 8;
inline constexpr std::uint32_t kBrake = 1U << 9;
inline constexpr std::uint32_t kCurrentLimit = 1U << 10;
inline constexpr std::uint32_t kMotion = 1U << 11;
inline constexpr std::uint32_t kRampAccelerating = 1U << 12;
inline constexpr std::uint32_t kRampSteady = 1U << 13;
inline constexpr std::uint32_t kRampDecelerating = 1U << 14;
inline constexpr std::uint32_t kRampEnd = 1U << 15;
inline constexpr std::uint32_t kStepInProgress = 1U << 16;
inline constexpr std::uint32_t kStepBufferFull = 1U << 17;
inline constexpr std::uint32_t kMotorVoltage = 1U << 18;
inline constexpr std::uint32_t kStageTemperature = 1U << 19;
inline constexpr std::uint32_t kWatchdog = 1U << 20;
inline constexpr std::uint32_t kShortCircuit = 1U << 21;
inline constexpr std::uint32_t kHall = 1U << 22;
inline constexpr std::uint32_t kI2t = 1U << 23;
inline constexpr std::uint32_t kCpuOverload = 1U << 24;
inline constexpr std::uint32_t kHardLimit = 1U << 25;
inline constexpr std::uint32_t kSoftLimit = 1U << 26;
inline constexpr std::uint32_t kLogicVoltage = 1U << 27;

/// Bits of a module that must not be moved until they are gone. Limits of current and soft limits count only together
/// with kError: alone they are news, not faults.
inline constexpr std::uint32_t kFaults = kError | kPowerFault | kTow | kCommunication | kMotorVoltage |
                                         kStageTemperature | kWatchdog | kShortCircuit | kHall | kI2t | kCpuOverload |
                                         kHardLimit | kLogicVoltage;
inline constexpr std::uint32_t kMotorSupply = kPowerFault | kMotorVoltage;
}  // namespace state

namespace short_state {
inline constexpr std::uint8_t kError = 0x01;
inline constexpr std::uint8_t kHomeSwitch = 0x02;
inline constexpr std::uint8_t kLimit1 = 0x04;
inline constexpr std::uint8_t kLimit2 = 0x08;
inline constexpr std::uint8_t kMotion = 0x10;
inline constexpr std::uint8_t kRampEnd = 0x20;
inline constexpr std::uint8_t kInProgress = 0x40;
inline constexpr std::uint8_t kBufferFull = 0x80;
}  // namespace short_state

/// The faults and halts of a state word with what to do: "motor supply gone: emergency stop open? …". Empty when there
/// are none.
std::string faults_in_words(std::uint32_t state_word);
/// Every set bit by name, for the log and for `binpick probe`: "referenced, ramp finished".
std::string state_in_words(std::uint32_t state_word);
std::string short_state_in_words(std::uint8_t short_state);

/// What is known of a module's state.
struct ModuleState {
  std::uint32_t word = 0;
  std::uint8_t code = 0;  ///< Motion Protocol: the error's code, which says more than the bits; else 0.
};
std::string faults_in_words(const ModuleState& module);

/// The short state that belongs to a state word (the emulator's half).
constexpr std::uint8_t to_short_state(std::uint32_t word) {
  const auto bit = [word](std::uint32_t mask, std::uint8_t value) {
    return static_cast<unsigned>((word & mask) != 0 ? value : 0);
  };
  return static_cast<std::uint8_t>(
      bit(state::kError, short_state::kError) | bit(state::kHomeSwitch, short_state::kHomeSwitch) |
      bit(state::kLimit1, short_state::kLimit1) | bit(state::kLimit2, short_state::kLimit2) |
      bit(state::kMotion, short_state::kMotion) | bit(state::kRampEnd, short_state::kRampEnd) |
      bit(state::kStepInProgress, short_state::kInProgress) | bit(state::kStepBufferFull, short_state::kBufferFull));
}
}  // namespace binpick::drivers::pivot
