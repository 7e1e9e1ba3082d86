#include "drivers/robot/rtde/codec.hpp"

#include <algorithm>
#include <bit>
#include <cmath>

#include "base/check.hpp"
#include "base/overloaded.hpp"

namespace binpick::drivers::rtde {
namespace {
enum class Type : std::uint8_t {
  RequestVersion = 'V',
  ControllerVersion = 'v',
  Text = 'M',
  Data = 'U',
  SetupOutputs = 'O',
  Start = 'S',
  Pause = 'P',
};

constexpr double kReachMax_m = 100;
constexpr double kTurnMax_rad = 6.2832;  // a rotation vector may be given with its angle up to a whole turn

double read_f64(ByteView bytes, std::size_t at) { return std::bit_cast<double>(read_be<std::uint64_t>(bytes, at)); }
void append_f64(Bytes& out, double value) { append_be(out, std::bit_cast<std::uint64_t>(value)); }

Bytes package(Type type, ByteView payload = {}) {
  Bytes out;
  BINPICK_CHECK(kHeaderBytes + payload.size() <= kPackageBytesMax);
  append_be(out, static_cast<std::uint16_t>(kHeaderBytes + payload.size()));
  append_be(out, static_cast<std::uint8_t>(type));
  append(out, payload);
  return out;
}

std::string join(const std::vector<std::string>& words) {
  std::string text;
  for (const std::string& word : words) text += (text.empty() ? "" : ",") + word;
  return text;
}

std::vector<std::string> split(std::string_view text) {
  std::vector<std::string> words;
  while (!text.empty()) {
    const std::size_t end = std::min(text.find(','), text.size());
    words.emplace_back(text.substr(0, end));
    text.remove_prefix(std::min(end + 1, text.size()));
  }
  return words;
}

bool is_plain_text(std::string_view text) {
  return std::ranges::all_of(text, [](char c) { return c >= ' ' && c <= '~'; });
}

/// Type and payload of the first package.
struct Frame {
  std::uint8_t type = 0;
  ByteView payload;
  std::size_t consumed = 0;
};

Expected<std::optional<Frame>, DecodeError> decode_frame(ByteView bytes) {
  if (bytes.size() < 2) return std::optional<Frame>{};
  const std::size_t size = read_be<std::uint16_t>(bytes, 0);
  if (size < kHeaderBytes || size > kPackageBytesMax) return unexpected(DecodeError{DecodeError::Kind::BadSize});
  if (bytes.size() < size) return std::optional<Frame>{};
  return std::optional{Frame{read_be<std::uint8_t>(bytes, 2), bytes.subspan(kHeaderBytes, size - kHeaderBytes), size}};
}

std::optional<bool> accepted(ByteView payload) {
  if (payload.size() != 1) return std::nullopt;
  return std::to_integer<int>(payload[0]) != 0;
}

/// Version 2, and what came before the version was agreed: a type byte and the text.
std::optional<TextMessage> text_message(ByteView payload) {
  if (payload.empty()) return std::nullopt;
  TextMessage message;
  const std::size_t text_bytes = read_be<std::uint8_t>(payload, 0);
  if (text_bytes + 2 < payload.size()) {
    const std::size_t source_bytes = read_be<std::uint8_t>(payload, 1 + text_bytes);
    if (1 + text_bytes + 1 + source_bytes + 1 == payload.size()) {
      message.text = as_text(payload.subspan(1, text_bytes));
      message.source = as_text(payload.subspan(2 + text_bytes, source_bytes));
      message.level = read_be<std::uint8_t>(payload, payload.size() - 1);
      return message;
    }
  }
  message.text = as_text(payload.subspan(1));
  return message;
}

std::optional<Reply> reply_of(Type type, ByteView payload) {
  switch (type) {
    case Type::RequestVersion:
      if (const auto yes = accepted(payload)) return VersionAnswer{*yes};
      return std::nullopt;
    case Type::ControllerVersion:
      if (payload.size() != 16) return std::nullopt;
      return ControllerVersion{read_be<std::uint32_t>(payload, 0), read_be<std::uint32_t>(payload, 4),
                               read_be<std::uint32_t>(payload, 8), read_be<std::uint32_t>(payload, 12)};
    case Type::Text:
      if (auto message = text_message(payload)) return *std::move(message);
      return std::nullopt;
    case Type::Data:
      if (payload.empty()) return std::nullopt;
      return Values{read_be<std::uint8_t>(payload, 0), Bytes(payload.begin() + 1, payload.end())};
    case Type::SetupOutputs:
      if (payload.empty() || !is_plain_text(as_text(payload.subspan(1)))) return std::nullopt;
      return OutputsAnswer{read_be<std::uint8_t>(payload, 0), split(as_text(payload.subspan(1)))};
    case Type::Start:
      if (const auto yes = accepted(payload)) return StartAnswer{*yes};
      return std::nullopt;
    case Type::Pause:
      if (const auto yes = accepted(payload)) return PauseAnswer{*yes};
      return std::nullopt;
  }
  return std::nullopt;
}

std::optional<Request> request_of(Type type, ByteView payload) {
  switch (type) {
    case Type::RequestVersion:
      if (payload.size() != 2) return std::nullopt;
      return RequestVersion{read_be<std::uint16_t>(payload, 0)};
    case Type::ControllerVersion:
      if (!payload.empty()) return std::nullopt;
      return GetControllerVersion{};
    case Type::SetupOutputs: {
      if (payload.size() < 8) return std::nullopt;
      const double frequency_hz = read_f64(payload, 0);
      const std::string_view names = as_text(payload.subspan(8));
      if (!(frequency_hz > 0 && frequency_hz <= 1000) || !is_plain_text(names)) return std::nullopt;
      return SetupOutputs{frequency_hz, split(names)};
    }
    case Type::Start:
      if (!payload.empty()) return std::nullopt;
      return Start{};
    case Type::Pause:
      if (!payload.empty()) return std::nullopt;
      return Pause{};
    case Type::Text:
    case Type::Data:
      return std::nullopt;
  }
  return std::nullopt;
}

bool is_known(std::uint8_t type) {
  return std::string_view{"VvMUOSP"}.find(static_cast<char>(type)) != std::string_view::npos;
}

template <class Message>
Expected<std::optional<Decoded<Message>>, DecodeError> decode(ByteView bytes,
                                                              std::optional<Message> (*of)(Type, ByteView)) {
  const auto frame = decode_frame(bytes);
  if (!frame) return unexpected(frame.error());
  if (!*frame) return std::optional<Decoded<Message>>{};
  const Frame& f = **frame;
  if (!is_known(f.type)) return unexpected(DecodeError{DecodeError::Kind::UnknownType, f.type});
  auto message = of(static_cast<Type>(f.type), f.payload);
  if (!message) return unexpected(DecodeError{DecodeError::Kind::BadPayload, f.type});
  return std::optional{Decoded<Message>{*std::move(message), f.consumed}};
}

bool is_pose(const std::array<double, 6>& pose) {
  for (std::size_t i = 0; i < 6; ++i)
    if (!(std::abs(pose[i]) <= (i < 3 ? kReachMax_m : kTurnMax_rad))) return false;
  return true;
}
}  // namespace

FieldWords words_of(Field field) {
  switch (field) {
    case Field::Timestamp:
      return {"timestamp", "DOUBLE", 8};
    case Field::TcpPose:
      return {"actual_TCP_pose", "VECTOR6D", 48};
    case Field::TcpOffset:
      return {"tcp_offset", "VECTOR6D", 48};
    case Field::RobotMode:
      return {"robot_mode", "INT32", 4};
    case Field::SafetyMode:
      return {"safety_mode", "INT32", 4};
    case Field::RuntimeState:
      return {"runtime_state", "UINT32", 4};
  }
  check_failed("the field is one of Field", __FILE__, __LINE__);
}

std::string to_string(const DecodeError& error) {
  const std::string which = error.type == 0 ? "" : " (package type " + std::to_string(error.type) + ")";
  switch (error.kind) {
    case DecodeError::Kind::BadSize:
      return "a package size outside 3 ... " + std::to_string(kPackageBytesMax) + which;
    case DecodeError::Kind::UnknownType:
      return "a package type that RTDE does not have" + which;
    case DecodeError::Kind::BadPayload:
      return "a package whose contents do not fit its type" + which;
    case DecodeError::Kind::BadValue:
      return "a value that no robot can have" + which;
  }
  return "?";
}

Bytes encode(const Request& request) {
  Bytes payload;
  return std::visit(
      Overloaded{[&](const RequestVersion& r) {
                   append_be(payload, r.version);
                   return package(Type::RequestVersion, payload);
                 },
                 [](const GetControllerVersion&) { return package(Type::ControllerVersion); },
                 [&](const SetupOutputs& r) {
                   append_f64(payload, r.frequency_hz);
                   append(payload, as_bytes(join(r.names)));
                   return package(Type::SetupOutputs, payload);
                 },
                 [](const Start&) { return package(Type::Start); }, [](const Pause&) { return package(Type::Pause); }},
      request);
}

Bytes encode(const Reply& reply) {
  Bytes payload;
  const auto yes_or_no = [&](Type type, bool yes) {
    append_be(payload, static_cast<std::uint8_t>(yes ? 1 : 0));
    return package(type, payload);
  };
  return std::visit(Overloaded{[&](const VersionAnswer& r) { return yes_or_no(Type::RequestVersion, r.accepted); },
                               [&](const ControllerVersion& r) {
                                 for (const std::uint32_t number : {r.major, r.minor, r.bugfix, r.build})
                                   append_be(payload, number);
                                 return package(Type::ControllerVersion, payload);
                               },
                               [&](const OutputsAnswer& r) {
                                 append_be(payload, r.recipe);
                                 append(payload, as_bytes(join(r.types)));
                                 return package(Type::SetupOutputs, payload);
                               },
                               [&](const StartAnswer& r) { return yes_or_no(Type::Start, r.accepted); },
                               [&](const PauseAnswer& r) { return yes_or_no(Type::Pause, r.accepted); },
                               [&](const TextMessage& r) {
                                 for (const std::string* text : {&r.text, &r.source}) {
                                   const auto bytes =
                                       static_cast<std::uint8_t>(std::min<std::size_t>(text->size(), 255));
                                   append_be(payload, bytes);
                                   append(payload, as_bytes(std::string_view{*text}.substr(0, bytes)));
                                 }
                                 append_be(payload, r.level);
                                 return package(Type::Text, payload);
                               },
                               [&](const Values& r) {
                                 append_be(payload, r.recipe);
                                 append(payload, r.values);
                                 return package(Type::Data, payload);
                               }},
                    reply);
}

Expected<std::optional<Decoded<Reply>>, DecodeError> decode_reply(ByteView bytes) {
  return decode<Reply>(bytes, reply_of);
}

Expected<std::optional<Decoded<Request>>, DecodeError> decode_request(ByteView bytes) {
  return decode<Request>(bytes, request_of);
}

Bytes encode_sample(const std::vector<Field>& recipe, const Sample& sample) {
  Bytes out;
  const auto add = [&](const std::array<double, 6>& vector) {
    for (const double value : vector) append_f64(out, value);
  };
  for (const Field field : recipe) switch (field) {
      case Field::Timestamp:
        append_f64(out, sample.timestamp_s);
        break;
      case Field::TcpPose:
        add(sample.tcp_pose);
        break;
      case Field::TcpOffset:
        add(sample.tcp_offset.value_or(std::array<double, 6>{}));
        break;
      case Field::RobotMode:
        append_be(out, static_cast<std::uint32_t>(sample.robot_mode));
        break;
      case Field::SafetyMode:
        append_be(out, static_cast<std::uint32_t>(sample.safety_mode));
        break;
      case Field::RuntimeState:
        append_be(out, sample.runtime_state);
        break;
    }
  return out;
}

Expected<Sample, DecodeError> decode_sample(const std::vector<Field>& recipe, ByteView values) {
  constexpr auto kType = static_cast<std::uint8_t>(Type::Data);
  std::size_t bytes = 0;
  for (const Field field : recipe) bytes += words_of(field).bytes;
  if (values.size() != bytes) return unexpected(DecodeError{DecodeError::Kind::BadPayload, kType});
  Sample sample;
  const auto vector_at = [&](std::size_t at) {
    std::array<double, 6> vector{};
    for (std::size_t i = 0; i < 6; ++i) vector[i] = read_f64(values, at + 8 * i);
    return vector;
  };
  std::size_t at = 0;
  for (const Field field : recipe) {
    switch (field) {
      case Field::Timestamp:
        sample.timestamp_s = read_f64(values, at);
        break;
      case Field::TcpPose:
        sample.tcp_pose = vector_at(at);
        break;
      case Field::TcpOffset:
        sample.tcp_offset = vector_at(at);
        break;
      case Field::RobotMode:
        sample.robot_mode = static_cast<std::int32_t>(read_be<std::uint32_t>(values, at));
        break;
      case Field::SafetyMode:
        sample.safety_mode = static_cast<std::int32_t>(read_be<std::uint32_t>(values, at));
        break;
      case Field::RuntimeState:
        sample.runtime_state = read_be<std::uint32_t>(values, at);
        break;
    }
    at += words_of(field).bytes;
  }
  const bool is_time = sample.timestamp_s >= 0 && sample.timestamp_s < 1e10;
  if (!is_time || !is_pose(sample.tcp_pose) || (sample.tcp_offset && !is_pose(*sample.tcp_offset)))
    return unexpected(DecodeError{DecodeError::Kind::BadValue, kType});
  return sample;
}
}  // namespace binpick::drivers::rtde
