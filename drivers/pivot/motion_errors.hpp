#pragma once

#include <cstdint>
#include <string>

/// The Motion Protocol's codes in words, and as the state word that both protocols share.
/// Source: Schunk Motion Protocol 1.41, HTML manual (docu305 to 321); Pejman712/CRF, SchunkCommands.hpp.
namespace binpick::drivers::pivot::motion {
inline constexpr std::uint8_t kFastStopped = 0xD9;  ///< Stands after a FAST STOP until it is acknowledged.

/// Codes of messages 8A and of refusals.
namespace info_code {
inline constexpr std::uint8_t kBoot = 0x01;
inline constexpr std::uint8_t kUnknownCommand = 0x04;
inline constexpr std::uint8_t kFailed = 0x05;
inline constexpr std::uint8_t kNotReferenced = 0x06;
inline constexpr std::uint8_t kNoError = 0x08;
inline constexpr std::uint8_t kMessageLength = 0x1D;
inline constexpr std::uint8_t kWrongParameter = 0x1E;
}  // namespace info_code

/// The bits of state_word.hpp for what the module says in a state report.
std::uint32_t state_word(std::uint8_t state, std::uint8_t error);
/// The error's bits alone.
std::uint32_t error_bits(std::uint8_t error);
/// The code for one of the state word's fault bits (the emulator's half).
std::uint8_t error_code(std::uint32_t bits);

/// "following error (tow) (free the axis; check load and sweep speed) [DA]"; never empty.
std::string error_in_words(std::uint8_t error);
/// Why a command was refused: "not referenced [06]".
std::string info_in_words(std::uint8_t code);
}  // namespace binpick::drivers::pivot::motion
