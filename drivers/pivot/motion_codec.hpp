#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "drivers/pivot/motion_message.hpp"

/// Schunk Motion Protocol: what messages say, both ways. Pure functions. Values inside are radians and seconds; on the
/// wire they have the unit and the type that the module's unit system says, little-endian.
/// Sources: Schunk Motion Protocol 1.41, HTML manual; spatialaudio/schunk (schunk.py); Pejman712/CRF (SchunkArm).
namespace binpick::drivers::pivot::motion {
enum class Command : std::uint8_t {
  GetConfig = 0x80,
  Error = 0x88,    ///< module → host, at once and every 15 s until acknowledged
  Warning = 0x89,  ///< the same, every 30 s
  Info = 0x8A,
  Acknowledge = 0x8B,
  FastStop = 0x90,  ///< Stops as hard as it can and holds; error D9 stands until it is acknowledged.
  Stop = 0x91,
  Reference = 0x92,
  MoveBlocked = 0x93,      ///< module → host, impulse
  PositionReached = 0x94,  ///< module → host, impulse
  GetState = 0x95,
  SetTargetVelocity = 0xA0,
  SetTargetAcceleration = 0xA1,
  MovePosition = 0xB0,
  Reboot = 0xE0,
  ToggleImpulses = 0xE7,
};

enum class ConfigItem : std::uint8_t {
  ModuleId = 0x01,
  UnitSystem = 0x06,
  PositionMax = 0x07,  ///< Soft limit high.
  PositionMin = 0x08,
  VelocityMax = 0x09,
  AccelerationMax = 0x0A,
  SerialNumber = 0x15,
  OrderNumber = 0x16,
};

/// The module's own setting (configuration item 06): what a number on the wire means.
enum class UnitSystem : std::uint8_t {
  Millimetre = 0,
  Metre = 1,
  Inch = 2,
  Radian = 3,
  Degree = 4,
  Internal = 5,
  Micrometre = 6,  ///< From here on 32-bit integers.
  Microdegree = 7,
  Microinch = 8,
  Millidegree = 9,
};
inline constexpr std::uint8_t kUnitSystemMax = 9;
constexpr bool is_angle(UnitSystem units) {
  return units == UnitSystem::Radian || units == UnitSystem::Degree || units == UnitSystem::Microdegree ||
         units == UnitSystem::Millidegree;
}
constexpr bool is_integer(UnitSystem units) { return units >= UnitSystem::Micrometre; }
const char* to_string(UnitSystem units);

/// Bits of the state byte.
namespace state_byte {
inline constexpr std::uint8_t kReferenced = 0x01;
inline constexpr std::uint8_t kMoving = 0x02;
inline constexpr std::uint8_t kProgram = 0x04;
inline constexpr std::uint8_t kWarning = 0x08;
inline constexpr std::uint8_t kError = 0x10;
inline constexpr std::uint8_t kBrake = 0x20;  ///< Public sources differ on which way round; nothing depends on it.
inline constexpr std::uint8_t kMoveEnd = 0x40;
inline constexpr std::uint8_t kPositionReached = 0x80;
}  // namespace state_byte

/// What a state report carries.
namespace report_mode {
inline constexpr std::uint8_t kPosition = 1;
inline constexpr std::uint8_t kVelocity = 2;
inline constexpr std::uint8_t kCurrent = 4;
inline constexpr std::uint8_t kAll = 7;
}  // namespace report_mode

// Requests, host → module.
struct GetConfig {
  std::optional<ConfigItem> item;  ///< None: the block with the module's type.
  friend bool operator==(const GetConfig&, const GetConfig&) = default;
};
struct GetState {
  struct Cyclic {
    double period_s = 0;  ///< 0: one report, and no further ones.
    std::uint8_t mode = report_mode::kPosition;
    friend bool operator==(const Cyclic&, const Cyclic&) = default;
  };
  std::optional<Cyclic> cyclic;  ///< None: one report in the mode that was last set.
  friend bool operator==(const GetState&, const GetState&) = default;
};
struct SetTarget {
  Command command = Command::SetTargetVelocity;  ///< Or SetTargetAcceleration.
  double value = 0;                              ///< rad/s or rad/s².
  friend bool operator==(const SetTarget&, const SetTarget&) = default;
};
struct MovePosition {
  double position_rad = 0;
  std::optional<double> velocity_rad_s, acceleration_rad_s2;  ///< None: the target values; the second needs the first.
  friend bool operator==(const MovePosition&, const MovePosition&) = default;
};
struct Plain {
  Command command = Command::Stop;  ///< Acknowledge, FastStop, Stop, Reference, Reboot or ToggleImpulses.
  friend bool operator==(const Plain&, const Plain&) = default;
};
using Request = std::variant<GetConfig, GetState, SetTarget, MovePosition, Plain>;

// Replies and news, module → host.
struct StateReport {
  std::optional<double> position_rad, velocity_rad_s;
  std::optional<float> current_a;  ///< Unit systems of integers: not public in which unit, left out.
  std::uint8_t state = 0, error = 0;
  friend bool operator==(const StateReport&, const StateReport&) = default;
};
struct ConfigValue {
  ConfigItem item = ConfigItem::UnitSystem;
  std::variant<double, std::uint32_t> value;  ///< A double: rad, rad/s or rad/s².
  friend bool operator==(const ConfigValue&, const ConfigValue&) = default;
};
struct ModuleType {
  std::string type;  ///< Printable characters; at most 8.
  std::uint32_t order = 0;
  std::uint16_t firmware = 0, protocol = 0, hardware = 0;
  std::string date;  ///< At most 26; the manual says 21.
  friend bool operator==(const ModuleType&, const ModuleType&) = default;
};
struct Done {
  Command command = Command::Stop;  ///< "OK".
  friend bool operator==(const Done&, const Done&) = default;
};
struct MoveTime {
  float estimate_s = 0;  ///< MOVE POS: when the position will be reached, by the module's own estimate.
  friend bool operator==(const MoveTime&, const MoveTime&) = default;
};
struct Refused {
  std::uint8_t command = 0, code = 0;
  friend bool operator==(const Refused&, const Refused&) = default;
};
struct Trouble {
  Command kind = Command::Error;  ///< Or Warning.
  std::uint8_t code = 0;
  friend bool operator==(const Trouble&, const Trouble&) = default;
};
struct Info {
  std::uint8_t code = 0;
  friend bool operator==(const Info&, const Info&) = default;
};
struct Impulse {
  Command kind = Command::PositionReached;  ///< Or MoveBlocked.
  double position_rad = 0;
  friend bool operator==(const Impulse&, const Impulse&) = default;
};
using Reply = std::variant<StateReport, ConfigValue, ModuleType, Done, MoveTime, Refused, Trouble, Info, Impulse>;

Message encode(const Request& request, UnitSystem units);
Message encode(const Reply& reply, UnitSystem units);  ///< The emulator's half.

/// A message of the module, as the host reads it. Numbers that are not finite are BadValue.
Expected<Reply, DecodeError> decode_reply(const Message& message, UnitSystem units);
/// A message of the host, as the module reads it.
Expected<Request, DecodeError> decode_request(const Message& message, UnitSystem units);
}  // namespace binpick::drivers::pivot::motion
