#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "base/bytes.hpp"
#include "base/expected.hpp"

/// Universal Robots' Real-Time Data Exchange, protocol version 2, as far as poses need it. Pure functions: no socket,
/// no clock, no log. Numbers are big-endian; a package is its size (uint16, itself included), a type byte and a
/// payload. Sources: "Real-Time Data Exchange (RTDE)", universal-robots.com manuals SW10.10; UniversalRobots/
/// Universal_Robots_Client_Library, include/ur_client_library/rtde, src/rtde and tests.
namespace binpick::drivers::rtde {
inline constexpr std::uint16_t kPort = 30004;
inline constexpr std::uint16_t kProtocolVersion = 2;
/// No package of ours or for us comes near it; a longer one is not of this protocol, never a wait.
inline constexpr std::size_t kPackageBytesMax = 4096;
inline constexpr std::size_t kHeaderBytes = 3;

/// What a controller is asked to send, in an order of our choice.
enum class Field { Timestamp, TcpPose, TcpOffset, RobotMode, SafetyMode, RuntimeState };
struct FieldWords {
  std::string_view name;  ///< As RTDE calls it.
  std::string_view type;
  std::size_t bytes;
};
FieldWords words_of(Field field);

/// One package of a recipe's values, in the controller's units: seconds, metres, rotation vectors in radians.
struct Sample {
  double timestamp_s = 0;                           ///< Since the controller was started.
  std::array<double, 6> tcp_pose{};                 ///< Of the active tcp in the robot's base.
  std::optional<std::array<double, 6>> tcp_offset;  ///< Of the active tcp in the flange; older controllers have none.
  std::int32_t robot_mode = 0;
  std::int32_t safety_mode = 0;
  std::uint32_t runtime_state = 0;
};

// What the client says.
struct RequestVersion {
  std::uint16_t version = kProtocolVersion;
};
struct GetControllerVersion {};
struct SetupOutputs {
  double frequency_hz = 0;
  std::vector<std::string> names;
};
struct Start {};
struct Pause {};
using Request = std::variant<RequestVersion, GetControllerVersion, SetupOutputs, Start, Pause>;

// What the controller says.
struct VersionAnswer {
  bool accepted = false;
};
struct ControllerVersion {
  std::uint32_t major = 0, minor = 0, bugfix = 0, build = 0;
};
struct OutputsAnswer {
  std::uint8_t recipe = 0;         ///< 0: refused.
  std::vector<std::string> types;  ///< In the order asked for; NOT_FOUND and IN_USE say why not.
};
struct StartAnswer {
  bool accepted = false;
};
struct PauseAnswer {
  bool accepted = false;
};
/// May come at any time. Before version 2 is agreed it has no source and no level.
struct TextMessage {
  std::string text, source;
  std::uint8_t level = 0;  ///< 0 exception, 1 error, 2 warning, 3 info.
};
struct Values {
  std::uint8_t recipe = 0;
  Bytes values;  ///< See decode_sample.
};
using Reply =
    std::variant<VersionAnswer, ControllerVersion, OutputsAnswer, StartAnswer, PauseAnswer, TextMessage, Values>;

struct DecodeError {
  enum class Kind { BadSize, UnknownType, BadPayload, BadValue } kind = Kind::BadSize;
  std::uint8_t type = 0;  ///< Type byte of the package, as far as it was read.
};
std::string to_string(const DecodeError& error);

template <class Message>
struct Decoded {
  Message message;
  std::size_t consumed = 0;
};

Bytes encode(const Request& request);
Bytes encode(const Reply& reply);
/// First package of `bytes`; nullopt while it is incomplete.
Expected<std::optional<Decoded<Reply>>, DecodeError> decode_reply(ByteView bytes);
Expected<std::optional<Decoded<Request>>, DecodeError> decode_request(ByteView bytes);

Bytes encode_sample(const std::vector<Field>& recipe, const Sample& sample);
/// `values` must be exactly what the recipe has. Poses that no robot can have are an error too.
Expected<Sample, DecodeError> decode_sample(const std::vector<Field>& recipe, ByteView values);
}  // namespace binpick::drivers::rtde
