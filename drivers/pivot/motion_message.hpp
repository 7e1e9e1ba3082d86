#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "base/bytes.hpp"
#include "base/expected.hpp"
#include "drivers/pivot/codec.hpp"

/// Schunk Motion Protocol: how a message lies in CAN frames. A frame is D-Len, command, parameters; a message that does
/// not fit into one goes as fragments. Source: Schunk Motion Protocol 1.41, HTML manual (docu314, 315); fragments as
/// ipa320/schunk_gripper_egl90 (scripts) sends them.
namespace binpick::drivers::pivot::motion {
/// CAN identifiers are a base plus the module's number.
inline constexpr std::uint32_t kErrorBase = 0x300;    ///< module → host, errors and warnings
inline constexpr std::uint32_t kCommandBase = 0x500;  ///< host → module
inline constexpr std::uint32_t kReplyBase = 0x700;    ///< module → host

inline constexpr std::uint8_t kFragmentStart = 0x84, kFragmentMiddle = 0x85, kFragmentEnd = 0x86;

struct Message {
  std::uint8_t command = 0;
  Bytes parameters;  ///< At most 254.
  friend bool operator==(const Message&, const Message&) = default;
};

std::vector<CanFrame> frames_of(std::uint32_t can_id, const Message& message);

/// Puts one sender's frames together again. Anything that does not fit what has begun ends it: nothing is guessed.
class Assembler {
 public:
  /// A whole message, or nothing yet.
  Expected<std::optional<Message>, DecodeError> take(const CanFrame& frame);

 private:
  std::optional<Message> begun_;
  std::size_t left_ = 0;  ///< Bytes still to come.
};
}  // namespace binpick::drivers::pivot::motion
