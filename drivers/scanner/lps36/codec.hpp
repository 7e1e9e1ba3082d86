#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "base/bytes.hpp"
#include "base/expected.hpp"

/// Wire format of the Leuze LPS 36 and LPS 36 HI: one UDP datagram is one telegram, a header of 15 little-endian words
/// and up to 480 words of content. Pure functions. Sources, named by their tags here: see README.md beside this file.
namespace binpick::drivers::lps36 {
inline constexpr std::size_t kHeaderBytes = 30;
inline constexpr std::size_t kWordsMax = 480;  ///< Content of the longest telegram, ZX [LES, NODE].
inline constexpr std::size_t kPoints = 376;    ///< Of a Z or X telegram [LES, NODE].
inline constexpr std::size_t kPointsHi = 240;  ///< Of a ZX telegram [NODE].
/// A count of Z or X [LES, NODE]; after an HI connect a hundredth [NODE].
inline constexpr double kCount_mm = 0.1, kCountHi_mm = 0.01;
/// Largest Z in counts [NODE]. A point beyond is no measurement.
inline constexpr std::uint16_t kZMax = 8100, kZMaxHi = 61000;
/// "Content is 16-bit words" [LES, NODE]. One worked example of LES prints 0 instead: sent as this, both are taken.
inline constexpr std::uint16_t kTypeWords = 0x0010;

/// Command or telegram number, header word 3. A number that stands not here is kept as it is.
enum class Id : std::uint16_t {
  // In every mode [LES, NODE, LXSH].
  Connect = 0x434E,     ///< No word or 0: Z and X telegrams; 1: ZX telegrams, where the model can [NODE].
  Disconnect = 0x4443,  ///< A connection lasts until this or a power-off; no keep-alive was found.
  EnterCommandMode = 0x3132,
  ExitCommandMode = 0x3133,
  Trigger = 0x4554,   ///< One measurement, in operation mode "input triggered". Its answer is the measured telegrams.
  Activate = 0x4541,  ///< 1 on, 0 off; not acknowledged.
  Ack = 0x4141,
  Nack = 0x414E,
  // In command mode only [LES, NODE, LXSH]; each line: the question, its answer where that is not Ack.
  SetLaser = 0x0001,
  MeasureOnce = 0x0003,  ///< Read with the three below, 50 ms later (LXSD; NODE waits 30).
  GetX = 0x0011,
  X = 0x0012,
  GetZ = 0x0013,
  Z = 0x0014,
  GetZx = 0x005F,
  Zx = 0x0060,
  SetEncoder = 0x0029,
  GetTask = 0x0049,
  Task = 0x004A,
  SetTask = 0x004B,
  SetScanNumber = 0x0053,
  SetUserParameter = 0x0059,
  GetUserParameter = 0x005B,
  UserParameter = 0x005C,
  SetTaskParameter = 0x006D,
  GetTaskParameter = 0x006F,
  TaskParameter = 0x0070,
  // What it sends while it measures [LES, NODE, LXSH].
  MeasuredZ = 0x5A5A,
  MeasuredX = 0x5858,   ///< After Z, with the same scan number.
  MeasuredZx = 0x5A58,  ///< 240 words Z, then 240 words X [NODE, live]. LXSG supposed them interleaved.
};

enum class Mode : std::uint16_t { Measure = 0x0010, Menu = 0x0020, Command = 0x0040, Error = 0x0080 };

/// Header word 8 [LES, NODE]. The host sends 0.
struct Status {
  std::uint16_t bits = 0;

  bool connected() const { return (bits & 0x0001) != 0; }  ///< The answer to Connect may not show it yet [NODE].
  std::optional<Mode> mode() const;                        ///< Nothing unless exactly one of its four bits is set.
  bool activated() const { return (bits & 0x0100) != 0; }
  bool warning() const { return (bits & 0x0200) != 0; }    ///< Temporary fault.
  bool triggered() const { return (bits & 0x0400) != 0; }  ///< 0 when free running.
  bool memory() const { return (bits & 0x0800) != 0; }     ///< A configuration memory is plugged in.
  bool fault() const { return (bits & 0x2000) != 0; }      ///< Permanent fault.
  friend bool operator==(Status, Status) = default;
};

/// One datagram. Words 0 and 1 are 0xFFFF; words 2, 4, 6 and 11 are 0 [LES, NODE, LXSG].
struct Telegram {
  Id id = Id::Ack;                   ///< Word 3.
  std::uint16_t packet_number = 0;   ///< Word 5: the sensor's own; send 0, ignore on receipt [NODE].
  std::uint16_t transaction = 0;     ///< Word 7: answers name their command here; 0 in measured telegrams [NODE].
  Status status;                     ///< Word 8.
  std::uint32_t encoder = 0;         ///< Words 9 (high) and 10 (low); 0 on models without the input [LES].
  std::uint16_t scan = 0;            ///< Word 12: one more per measurement, wraps [LES].
  std::uint16_t type = kTypeWords;   ///< Word 13.
  std::vector<std::uint16_t> words;  ///< Word 14 counts them.
  friend bool operator==(const Telegram&, const Telegram&) = default;
};

struct DecodeError {
  enum class Kind { TooShort, BadStart, BadFill, BadType, BadLength, BadContent } kind = Kind::TooShort;
  std::size_t at = 0;  ///< Byte at which decoding gave up.
};
std::string to_string(const DecodeError& error);

/// A datagram is a whole telegram or an error: nothing is waited for.
Expected<Telegram, DecodeError> decode(ByteView datagram);
Bytes encode(const Telegram& telegram);

/// Half of a scan line (Z or X), or the whole line of an HI, in counts.
struct Measured {
  enum class Part { Z, X, Both } part = Part::Z;
  Status status;
  std::uint32_t encoder = 0;
  std::uint16_t scan = 0;
  std::vector<std::uint16_t> z;  ///< Distance from the sensor. Empty in part X.
  std::vector<std::int16_t> x;   ///< Along the line, 0 in its middle. Empty in part Z.
  friend bool operator==(const Measured&, const Measured&) = default;
};
bool is_measured(Id id);
Expected<Measured, DecodeError> measured_of(const Telegram& telegram);
Telegram telegram_of(const Measured& measured);
/// Where nothing was measured Z and X are 0 [LES, NODE].
inline bool is_point(std::uint16_t z, bool hi) { return z != 0 && z <= (hi ? kZMaxHi : kZMax); }

/// Of the host [LES, NODE]; ranges as given there.
Telegram connect(bool hi);
Telegram command(Id id);  ///< One without words.
Telegram activate(bool on);
Telegram set_laser(bool on);
Telegram set_encoder(std::uint32_t value);  ///< Low word first, unlike in the header.
Telegram set_task(std::uint16_t task, bool permanent);
Telegram set_scan_number(std::uint16_t scan);
/// Not permanent: lost at power-off.
Telegram set_user_parameter(bool permanent, std::uint16_t id, std::uint16_t value);
Telegram get_user_parameter(std::uint16_t id);
Telegram set_task_parameter(bool permanent, std::uint16_t id, const std::vector<std::uint16_t>& values);
Telegram get_task_parameter(std::uint16_t id);

namespace user {
inline constexpr std::uint16_t kXDisabled = 0x07D4;  ///< 0/1 [LES, NODE].
inline constexpr std::uint16_t kPause = 0x07D8;      ///< Between Z and X, 0 … 9: 0.1 … 1.0 ms [LES, NODE].
}  // namespace user
namespace task {                                          // [LES, NODE]
inline constexpr std::uint16_t kOperationMode = 0x0BBA;   ///< 0 free running, 1 input triggered.
inline constexpr std::uint16_t kActivation = 0x0BBB;      ///< 0 disregard, 1 regard.
inline constexpr std::uint16_t kExposure = 0x0BBD;        ///< 0 normal 261 µs, 1 97, 2 655, 3 328, 4 manual.
inline constexpr std::uint16_t kManualExposure = 0x0BBE;  ///< Tenths of a µs, 973 … 13109 (HI from 739).
inline constexpr std::uint16_t kFieldX = 0x0BBF;          ///< Minimum and maximum, signed, 0.1 mm.
inline constexpr std::uint16_t kFieldZ = 0x0BC0;          ///< Minimum and maximum, 0.1 mm.
}  // namespace task

/// Content of TaskParameter [LXSP; NODE reads the values at the same place].
struct Parameter {
  std::uint16_t id = 0;
  std::uint16_t type = 2;  ///< 1 UINT8, 2 UINT16, 3 UINT32 (uncertain), 5 SINT16, 7 CHAR [LXSP].
  std::uint32_t min = 0, max = 0;
  std::uint16_t fields = 0;
  std::vector<std::uint16_t> values;
  friend bool operator==(const Parameter&, const Parameter&) = default;
};
Expected<Parameter, DecodeError> parameter_of(const Telegram& telegram);
Telegram telegram_of(const Parameter& parameter, Status status);

/// Of the sensor: what `asked` is answered with.
Telegram answer(Id id, Id asked, Status status, std::vector<std::uint16_t> words = {});
}  // namespace binpick::drivers::lps36
