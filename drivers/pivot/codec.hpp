#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <variant>

#include "base/expected.hpp"
#include "drivers/link/can.hpp"

/// PowerCube frames both ways. Pure functions: no socket, no clock, no log. Numbers on the wire are little-endian;
/// angles are radians. Source: ipa320/schunk_modular_robotics, schunk_libm5api (ProtocolCommands.h, ProtocolDevice.cpp,
/// m5apiw32.h); playerproject/player, amtecpowercube.cc.
namespace binpick::drivers::pivot {
using link::CanFrame;

/// CAN identifiers are a base plus the module's number, 1 … 31.
inline constexpr std::uint32_t kStateBase = 0x060;    ///< module → host, unsolicited
inline constexpr std::uint32_t kReplyBase = 0x0A0;    ///< module → host
inline constexpr std::uint32_t kGetBase = 0x0C0;      ///< host → module, read
inline constexpr std::uint32_t kSetBase = 0x0E0;      ///< host → module, everything else
inline constexpr std::uint32_t kBroadcastId = 0x100;  ///< host → all
inline constexpr std::uint8_t kModuleIdMax = 31;

enum class Command : std::uint8_t {
  Reset = 0x00,  ///< Clears error and halt.
  Home = 0x01,
  Halt = 0x02,  ///< Stops at once; the module then needs a Reset.
  Watchdog = 0x07,
  SetParameter = 0x08,
  GetParameter = 0x0A,
  SetMotion = 0x0B,
  StartMotion = 0x0F,
};

enum class Parameter : std::uint8_t {
  SerialNumber = 0x1A,
  Firmware = 0x1D,
  StateWord = 0x27,
  Config = 0x39,
  Position = 0x3C,
  FollowingErrorMax = 0x40,
  Velocity = 0x41,
  PositionMin = 0x45,
  PositionMax = 0x46,
  VelocityMax = 0x48,
  AccelerationMax = 0x4A,
  CurrentMax = 0x4C,
  Current = 0x4D,
  RampVelocity = 0x4F,
  RampAcceleration = 0x50,
  Setup = 0x58,
  HomeOffset = 0x59,
  PositionAndState = 0x62,  ///< Position, short state and inputs in one reply; see has_position_and_state.
  HomeVelocity = 0x64,
};

enum class Motion : std::uint8_t {
  Ramp = 0x04,      ///< FRAMP: to a position with ramp velocity and acceleration.
  Step = 0x06,      ///< FSTEP: be at a position after a time.
  Velocity = 0x07,  ///< FVEL.
  Current = 0x08,   ///< FCUR.
  RampExtended = 0x0E,
  StepExtended = 0x10,
  VelocityExtended = 0x11,
  CurrentExtended = 0x12,
};
constexpr bool is_extended(Motion motion) { return static_cast<std::uint8_t>(motion) >= 0x0E; }
constexpr bool is_step(Motion motion) { return motion == Motion::Step || motion == Motion::StepExtended; }

/// Bits of the configuration word (parameter 39) that change what a driver has to do.
namespace config_bit {
inline constexpr std::uint32_t kBrake = 1U << 3;
inline constexpr std::uint32_t kLinear = 1U << 17;
inline constexpr std::uint32_t kWatchdog = 1U << 24;             ///< Broadcast 07 must come periodically.
inline constexpr std::uint32_t kSuppressAcknowledge = 1U << 26;  ///< Writes, commands and motions are not answered.
inline constexpr std::uint32_t kSynchronousMotion = 1U << 27;    ///< Motions wait for broadcast 0F.
}  // namespace config_bit

// Requests, host → module.
struct Get {
  Parameter parameter = Parameter::StateWord;
  friend bool operator==(const Get&, const Get&) = default;
};
struct Set {
  Parameter parameter = Parameter::RampVelocity;
  std::variant<float, std::uint32_t> value;
  friend bool operator==(const Set&, const Set&) = default;
};
struct Plain {
  Command command = Command::Reset;  ///< Reset, Home or Halt.
  friend bool operator==(const Plain&, const Plain&) = default;
};
struct Move {
  Motion motion = Motion::Step;
  float value = 0;            ///< rad, rad/s or A.
  std::uint16_t time_ms = 0;  ///< Steps only.
  friend bool operator==(const Move&, const Move&) = default;
};
struct Broadcast {
  Command command = Command::Watchdog;  ///< Watchdog or StartMotion; nobody replies.
  friend bool operator==(const Broadcast&, const Broadcast&) = default;
};
using Request = std::variant<Get, Set, Plain, Move, Broadcast>;

// Replies, module → host.
struct PositionReport {
  float position_rad = 0;
  std::uint8_t short_state = 0;
  std::uint8_t inputs = 0;
  friend bool operator==(const PositionReport&, const PositionReport&) = default;
};
/// A parameter's value in the type that the module gives it.
struct Value {
  Parameter parameter = Parameter::StateWord;
  std::variant<float, std::uint32_t, std::uint16_t, PositionReport> value;
  friend bool operator==(const Value&, const Value&) = default;
};
struct SetDone {
  Parameter parameter = Parameter::RampVelocity;
  friend bool operator==(const SetDone&, const SetDone&) = default;
};
struct PlainDone {
  Command command = Command::Reset;
  friend bool operator==(const PlainDone&, const PlainDone&) = default;
};
struct MoveAccepted {
  Motion motion = Motion::Step;
  std::optional<PositionReport> report;  ///< Extended motions only.
  friend bool operator==(const MoveAccepted&, const MoveAccepted&) = default;
};
/// The module spoke without being asked (0x060 + id). Public drivers do not read the content; ask for the state word.
struct StateNews {
  friend bool operator==(const StateNews&, const StateNews&) = default;
};
using Reply = std::variant<Value, SetDone, PlainDone, MoveAccepted, StateNews>;

struct DecodeError {
  enum class Kind {
    NotOurs,
    BadLength,
    UnknownCommand,
    UnknownParameter,
    UnknownMotion,
    BadValue,
    BadFragment  ///< Motion Protocol: out of order, or one is missing.
  } kind = Kind::NotOurs;
  std::uint32_t id = 0;
  std::uint8_t length = 0;
  std::uint8_t what = 0;  ///< Command, parameter or motion byte.
  friend bool operator==(const DecodeError&, const DecodeError&) = default;
};
std::string to_string(const DecodeError& error);

CanFrame encode(std::uint8_t module_id, const Request& request);
CanFrame encode(std::uint8_t module_id, const Reply& reply);  ///< The emulator's half.

/// A frame of the module, as the host reads it. Floats that are not finite are BadValue.
Expected<Reply, DecodeError> decode_reply(std::uint8_t module_id, const CanFrame& frame);
/// A frame of the host, as the module reads it.
Expected<Request, DecodeError> decode_request(std::uint8_t module_id, const CanFrame& frame);

/// Whether `reply` answers `request`: same command byte and same parameter or motion.
bool answers(const Request& request, const Reply& reply);

/// Parameter 62 came with the second generation's 0x2518 and the third's 0x3518; 0x3500 … 0x3517 do not have it.
constexpr bool has_position_and_state(std::uint16_t firmware) {
  return firmware >= 0x2518 && !(firmware >= 0x3500 && firmware <= 0x3517);
}
}  // namespace binpick::drivers::pivot
