#include "drivers/pivot/motion_errors.hpp"

#include <array>
#include <cstdio>

#include "drivers/pivot/motion_codec.hpp"
#include "drivers/pivot/state_word.hpp"

namespace binpick::drivers::pivot::motion {
namespace {
namespace word = pivot::state;

struct ErrorRow {
  std::uint8_t code;
  std::uint32_t bits;  ///< Beside kError; 0: the state word has none for it.
  const char* name;
  const char* remedy;  ///< nullptr: the words of the state word's bit.
};
constexpr std::array kErrors{
    ErrorRow{0x70, 0, "module too cold", "warm it up before it moves"},
    ErrorRow{0x71, word::kStageTemperature, nullptr, nullptr},
    ErrorRow{0x72, word::kLogicVoltage, nullptr, nullptr},
    ErrorRow{0x73, word::kLogicVoltage, nullptr, nullptr},
    ErrorRow{0x74, word::kMotorSupply, nullptr, nullptr},
    ErrorRow{0x75, 0, "motor supply above its range", "check the 24 V motor supply"},
    ErrorRow{0x76, 0, "cable break", "check the module's wiring"},
    ErrorRow{0x78, word::kWatchdog, "motor too hot", "let the motor cool; check load and duty"},
    ErrorRow{0x82, 0, "position overshoot", "free the axis; check load and sweep speed"},
    ErrorRow{0xC8, 0, "wrong ramp type", "set the ramp to trapezoid with the vendor's tool"},
    ErrorRow{0xD2, 0, "configuration memory damaged", "the module needs service"},
    ErrorRow{0xD3, 0, "program memory damaged", "the module needs service"},
    ErrorRow{0xD4, 0, "invalid phrase", "end the program that is stored in the module"},
    ErrorRow{0xD5, word::kSoftLimit, nullptr, nullptr},
    ErrorRow{0xD6, word::kSoftLimit, nullptr, nullptr},
    ErrorRow{0xD7, 0, "pressure", "the module needs service"},
    ErrorRow{0xD8, 0, "service due", "the module needs service"},
    ErrorRow{0xDA, word::kTow, nullptr, nullptr},
    ErrorRow{0xDB, 0, "Profibus chip", "switch the module off and on"},
    ErrorRow{0xDC, word::kCommunication, "fragments out of order", "check the CAN cable and its termination"},
    ErrorRow{0xDD, 0, "commutation failed", "switch the module off and on; service if it comes again"},
    ErrorRow{0xDE, word::kShortCircuit, "motor current too high", "free the axis; check the module's wiring"},
    ErrorRow{0xDF, word::kI2t, nullptr, nullptr},
    ErrorRow{0xE0, 0, "initialisation failed", "switch the module off and on"},
    ErrorRow{0xE1, 0, "internal error", "switch the module off and on; service if it comes again"},
    ErrorRow{0xE2, word::kHardLimit, nullptr, nullptr},
    ErrorRow{0xE3, word::kHardLimit, nullptr, nullptr},
    ErrorRow{0xE4, 0, "too fast", "free the axis; check load and sweep speed"},
    ErrorRow{0xEB, word::kHall, "resolver check failed", "the module needs service"},
    ErrorRow{0xEC, 0, "arithmetic error", "switch the module off and on"},
};

const ErrorRow* find(std::uint8_t code) {
  for (const ErrorRow& row : kErrors)
    if (row.code == code) return &row;
  return nullptr;
}

struct InfoRow {
  std::uint8_t code;
  const char* name;
};
constexpr std::array kInfos{
    InfoRow{info_code::kBoot, "started"},
    InfoRow{0x02, "no free space"},
    InfoRow{0x03, "no rights"},
    InfoRow{info_code::kUnknownCommand, "unknown command"},
    InfoRow{info_code::kFailed, "failed"},
    InfoRow{info_code::kNotReferenced, "not referenced"},
    InfoRow{0x07, "searches its sine vector"},
    InfoRow{info_code::kNoError, "no error"},
    InfoRow{0x09, "communication error"},
    InfoRow{0x10, "time-out"},
    InfoRow{0x16, "wrong bit rate"},
    InfoRow{0x19, "checksum"},
    InfoRow{info_code::kMessageLength, "wrong message length"},
    InfoRow{info_code::kWrongParameter, "wrong parameter"},
    InfoRow{0x1F, "program ended"},
    InfoRow{0x40, "trigger"},
    InfoRow{0x41, "ready"},
};

std::string with_code(const std::string& words, std::uint8_t code) {
  char text[16];
  std::snprintf(text, sizeof text, " [%02X]", unsigned{code});
  return words + text;
}
}  // namespace

std::uint32_t error_bits(std::uint8_t error) {
  if (error == 0) return 0;
  if (error == kFastStopped) return word::kHalt;
  const ErrorRow* row = find(error);
  return word::kError | (row != nullptr ? row->bits : 0);
}

std::uint8_t error_code(std::uint32_t bits) {
  for (const ErrorRow& row : kErrors)
    if ((row.bits & bits) != 0) return row.code;
  return 0xE1;
}

std::uint32_t state_word(std::uint8_t state, std::uint8_t error) {
  std::uint32_t bits = 0;
  if ((state & state_byte::kReferenced) != 0) bits |= word::kHomeOk;
  if ((state & state_byte::kBrake) != 0) bits |= word::kBrake;
  bits |= (state & state_byte::kMoving) != 0 ? word::kMotion : word::kRampEnd;
  // A code without the error bit is a warning or news: public drivers look at the code only where the bit is set.
  if ((state & state_byte::kError) != 0) bits |= error == 0 ? word::kError : error_bits(error);
  return bits;
}

std::string error_in_words(std::uint8_t error) {
  if (error == 0) return "an error that the module does not name (switch the module off and on if it stays)";
  const ErrorRow* row = find(error);
  if (error == kFastStopped) return with_code(faults_in_words(word::kHalt), error);
  if (row == nullptr) return with_code("an error without a public name (see the module's manual)", error);
  if (row->name == nullptr) return with_code(faults_in_words(row->bits), error);
  return with_code(std::string(row->name) + " (" + row->remedy + ")", error);
}

std::string info_in_words(std::uint8_t code) {
  for (const InfoRow& row : kInfos)
    if (row.code == code) return with_code(row.name, code);
  return error_in_words(code);
}
}  // namespace binpick::drivers::pivot::motion
