#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "base/bytes.hpp"
#include "base/expected.hpp"
#include "base/units.hpp"

/// Wire format of the SICK LMS 400: text commands and binary measured values in one kind of frame. Pure functions.
/// Sources: see README.md beside this file.
namespace binpick::drivers::lms400 {
/// A length field above this is no frame. The longest telegram known (0.1 degree, distance and remission) has 2138.
inline constexpr std::size_t kPayloadBytesMax = 4096;
/// Four times 0x02, length, checksum.
inline constexpr std::size_t kFramingBytes = 9;

/// A command or a reply.
struct Text {
  std::string text;
  friend bool operator==(const Text&, const Text&) = default;
};

enum class Format : std::uint16_t { DistanceAndRemission = 0x20, Distance = 0x21, Remission = 0x22 };

/// One scan line as it stands in the telegram.
struct Measured {
  Format format = Format::DistanceAndRemission;
  std::uint16_t distance_scale = 1;  ///< Millimetres per count.
  std::int32_t start_1e4deg = 0;     ///< 1/10000 degree.
  std::uint16_t step_1e4deg = 0;
  std::uint16_t frequency_hz = 0;
  std::uint16_t remission_scale = 1, remission_start = 0, remission_end = 255;
  std::vector<std::uint16_t> distance;  ///< Counts, 0: no valid measurement. Empty in format Remission.
  std::vector<std::uint8_t> remission;  ///< Empty in format Distance.
  std::array<std::uint16_t, 9> trailer{};

  std::uint16_t encoder() const { return trailer[3]; }
  std::uint16_t counter() const { return trailer[7]; }  ///< Of scans, modulo 65536.
  std::size_t points() const { return distance.empty() ? remission.size() : distance.size(); }
  std::optional<float> range_mm(std::size_t i) const;  ///< Nothing where there is no valid measurement.
  friend bool operator==(const Measured&, const Measured&) = default;
};

using Message = std::variant<Text, Measured>;

struct DecodeError {
  enum class Kind { BadStart, BadLength, BadChecksum, BadTelegram } kind = Kind::BadStart;
  std::size_t skip = 1;  ///< Bytes to drop before decoding is tried again. At least 1.
};
struct Decoded {
  Message message;
  std::size_t consumed = 0;  ///< Bytes to drop from the front.
};

/// First frame of `bytes`; nothing while it is incomplete. A measured value may look like the start of a frame, so a
/// frame counts only with a length in range and the right checksum; after an error, drop `skip` bytes and go on.
Expected<std::optional<Decoded>, DecodeError> decode(ByteView bytes);
Bytes encode(const Message& message);
std::string to_string(DecodeError::Kind kind);

/// What the host says: "sMN mLRreqdata 20" is {"sMN", "mLRreqdata", {"20"}}.
struct Request {
  std::string verb;  ///< sRN, sWN, sMN.
  std::string name;
  std::vector<std::string> arguments;
  friend bool operator==(const Request&, const Request&) = default;
};
std::string to_text(const Request& request);
/// Words are separated by single spaces; a trailing space gives an empty last argument.
std::optional<Request> parse_request(std::string_view text);

Request stop_measuring();
Request start_measuring(Format format);
Request log_in();              ///< Level 4, service.
Request set_filter(int mask);  ///< 1 median, 2 edge, 4 range, 8 mean.
Request set_extended_remission(bool on);
/// Angles are written with two decimals, as the public drivers do.
Request set_scan(double frequency_hz, Angle resolution, Angle start, Angle range);
Request read_address();  ///< sRN EIip: needs no login and changes nothing.

/// What the device says. The first answer to a method is only "accepted"; its result comes later.
struct Reply {
  enum class Kind { Accepted, Result, Written, Value, Refused } kind = Kind::Accepted;  ///< sMA, sAN, sWA, sRA, sFA.
  std::string name;                                                                     ///< Empty when Refused.
  std::vector<std::string> arguments;                                                   ///< Refused: the code, hex.
  friend bool operator==(const Reply&, const Reply&) = default;
};
std::string to_text(const Reply& reply);
std::optional<Reply> parse_reply(std::string_view text);

/// With a sign: decimal; without: hex. Nothing unless the whole word is a number of at most 32 bits.
std::optional<std::int64_t> parse_integer(std::string_view word);
/// "+0.25". Nothing unless the whole word is a finite number.
std::optional<double> parse_decimal(std::string_view word);
/// Eight hex digits of an IEEE 754 number: "43B40000" is 360.
std::optional<double> parse_float_hex(std::string_view word);
std::string to_float_hex(double value);

/// Meaning and remedy of an sFA code. The table is from newer devices of the maker; that the LMS 400 uses the same
/// numbers is assumed.
std::string refusal_text(std::uint32_t code);
}  // namespace binpick::drivers::lms400
