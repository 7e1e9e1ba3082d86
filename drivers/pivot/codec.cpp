#include "drivers/pivot/codec.hpp"

#include <array>
#include <bit>
#include <cmath>
#include <cstdio>

#include "base/overloaded.hpp"

namespace binpick::drivers::pivot {
namespace {
enum class Type { F32, U32, U16, Report };
struct ParameterRow {
  Parameter parameter;
  Type type;
};
constexpr std::array kParameters{
    ParameterRow{Parameter::SerialNumber, Type::U32},     ParameterRow{Parameter::Firmware, Type::U16},
    ParameterRow{Parameter::StateWord, Type::U32},        ParameterRow{Parameter::Config, Type::U32},
    ParameterRow{Parameter::Position, Type::F32},         ParameterRow{Parameter::FollowingErrorMax, Type::F32},
    ParameterRow{Parameter::Velocity, Type::F32},         ParameterRow{Parameter::PositionMin, Type::F32},
    ParameterRow{Parameter::PositionMax, Type::F32},      ParameterRow{Parameter::VelocityMax, Type::F32},
    ParameterRow{Parameter::AccelerationMax, Type::F32},  ParameterRow{Parameter::CurrentMax, Type::F32},
    ParameterRow{Parameter::Current, Type::F32},          ParameterRow{Parameter::RampVelocity, Type::F32},
    ParameterRow{Parameter::RampAcceleration, Type::F32}, ParameterRow{Parameter::Setup, Type::U32},
    ParameterRow{Parameter::HomeOffset, Type::F32},       ParameterRow{Parameter::PositionAndState, Type::Report},
    ParameterRow{Parameter::HomeVelocity, Type::F32},
};

std::optional<Type> type_of(std::uint8_t parameter) {
  for (const ParameterRow& row : kParameters)
    if (static_cast<std::uint8_t>(row.parameter) == parameter) return row.type;
  return std::nullopt;
}

bool is_motion(std::uint8_t byte) {
  switch (static_cast<Motion>(byte)) {
    case Motion::Ramp:
    case Motion::Step:
    case Motion::Velocity:
    case Motion::Current:
    case Motion::RampExtended:
    case Motion::StepExtended:
    case Motion::VelocityExtended:
    case Motion::CurrentExtended:
      return true;
  }
  return false;
}

CanFrame frame_of(std::uint32_t id) {
  CanFrame frame;
  frame.id = id;
  return frame;
}

void put_u8(CanFrame& frame, std::uint8_t v) { frame.payload[frame.length++] = v; }
void put_u16(CanFrame& frame, std::uint16_t v) {
  put_u8(frame, static_cast<std::uint8_t>(v & 0xFF));
  put_u8(frame, static_cast<std::uint8_t>(v >> 8));
}
void put_u32(CanFrame& frame, std::uint32_t v) {
  put_u16(frame, static_cast<std::uint16_t>(v & 0xFFFF));
  put_u16(frame, static_cast<std::uint16_t>(v >> 16));
}
void put_f32(CanFrame& frame, float v) { put_u32(frame, std::bit_cast<std::uint32_t>(v)); }

std::uint16_t u16_at(const CanFrame& frame, std::size_t at) {
  return static_cast<std::uint16_t>(frame.payload[at] | (frame.payload[at + 1] << 8));
}
std::uint32_t u32_at(const CanFrame& frame, std::size_t at) {
  return static_cast<std::uint32_t>(u16_at(frame, at)) | (static_cast<std::uint32_t>(u16_at(frame, at + 2)) << 16);
}
float f32_at(const CanFrame& frame, std::size_t at) { return std::bit_cast<float>(u32_at(frame, at)); }

DecodeError error(DecodeError::Kind kind, const CanFrame& frame, std::uint8_t what = 0) {
  return {kind, frame.id, frame.length, what};
}

bool is_standard_data(const CanFrame& frame) {
  return !frame.extended && !frame.rtr && !frame.error && frame.length <= frame.payload.size();
}

PositionReport report_at(const CanFrame& frame) { return {f32_at(frame, 2), frame.payload[6], frame.payload[7]}; }

Expected<Reply, DecodeError> decode_value(const CanFrame& frame) {
  using Kind = DecodeError::Kind;
  if (frame.length < 2) return unexpected(error(Kind::BadLength, frame));
  const std::uint8_t byte = frame.payload[1];
  const auto type = type_of(byte);
  if (!type) return unexpected(error(Kind::UnknownParameter, frame, byte));
  Value value{static_cast<Parameter>(byte), {}};
  switch (*type) {
    case Type::F32:
      if (frame.length != 6) return unexpected(error(Kind::BadLength, frame, byte));
      if (!std::isfinite(f32_at(frame, 2))) return unexpected(error(Kind::BadValue, frame, byte));
      value.value = f32_at(frame, 2);
      break;
    case Type::U32:
      if (frame.length != 6) return unexpected(error(Kind::BadLength, frame, byte));
      value.value = u32_at(frame, 2);
      break;
    case Type::U16:
      if (frame.length != 4) return unexpected(error(Kind::BadLength, frame, byte));
      value.value = u16_at(frame, 2);
      break;
    case Type::Report:
      if (frame.length != 8) return unexpected(error(Kind::BadLength, frame, byte));
      if (!std::isfinite(f32_at(frame, 2))) return unexpected(error(Kind::BadValue, frame, byte));
      value.value = report_at(frame);
      break;
  }
  return Reply{value};
}

Expected<Reply, DecodeError> decode_motion_reply(const CanFrame& frame) {
  using Kind = DecodeError::Kind;
  if (frame.length < 2) return unexpected(error(Kind::BadLength, frame));
  const std::uint8_t byte = frame.payload[1];
  if (!is_motion(byte)) return unexpected(error(Kind::UnknownMotion, frame, byte));
  MoveAccepted accepted{static_cast<Motion>(byte), std::nullopt};
  if (is_extended(accepted.motion)) {
    if (frame.length != 8) return unexpected(error(Kind::BadLength, frame, byte));
    if (!std::isfinite(f32_at(frame, 2))) return unexpected(error(Kind::BadValue, frame, byte));
    accepted.report = report_at(frame);
  }
  return Reply{accepted};
}
}  // namespace

std::string to_string(const DecodeError& error) {
  const char* text = "";
  switch (error.kind) {
    case DecodeError::Kind::NotOurs:
      text = "not a frame of this module";
      break;
    case DecodeError::Kind::BadLength:
      text = "wrong length";
      break;
    case DecodeError::Kind::UnknownCommand:
      text = "unknown command";
      break;
    case DecodeError::Kind::UnknownParameter:
      text = "unknown parameter";
      break;
    case DecodeError::Kind::UnknownMotion:
      text = "unknown motion";
      break;
    case DecodeError::Kind::BadValue:
      text = "a number that is not finite";
      break;
    case DecodeError::Kind::BadFragment:
      text = "a fragment out of order";
      break;
  }
  char line[96];
  std::snprintf(line, sizeof line, "%s (CAN id %03X, %u bytes, code %02X)", text, error.id, unsigned{error.length},
                unsigned{error.what});
  return line;
}

CanFrame encode(std::uint8_t module_id, const Request& request) {
  return std::visit(Overloaded{
                        [&](const Get& get) {
                          CanFrame frame = frame_of(kGetBase + module_id);
                          put_u8(frame, static_cast<std::uint8_t>(Command::GetParameter));
                          put_u8(frame, static_cast<std::uint8_t>(get.parameter));
                          return frame;
                        },
                        [&](const Set& set) {
                          CanFrame frame = frame_of(kSetBase + module_id);
                          put_u8(frame, static_cast<std::uint8_t>(Command::SetParameter));
                          put_u8(frame, static_cast<std::uint8_t>(set.parameter));
                          if (const auto* number = std::get_if<float>(&set.value))
                            put_f32(frame, *number);
                          else
                            put_u32(frame, std::get<std::uint32_t>(set.value));
                          return frame;
                        },
                        [&](const Plain& plain) {
                          CanFrame frame = frame_of(kSetBase + module_id);
                          put_u8(frame, static_cast<std::uint8_t>(plain.command));
                          return frame;
                        },
                        [&](const Move& move) {
                          CanFrame frame = frame_of(kSetBase + module_id);
                          put_u8(frame, static_cast<std::uint8_t>(Command::SetMotion));
                          put_u8(frame, static_cast<std::uint8_t>(move.motion));
                          put_f32(frame, move.value);
                          if (is_step(move.motion)) put_u16(frame, move.time_ms);
                          return frame;
                        },
                        [&](const Broadcast& broadcast) {
                          CanFrame frame = frame_of(kBroadcastId);
                          put_u8(frame, static_cast<std::uint8_t>(broadcast.command));
                          put_u8(frame, 0);
                          return frame;
                        },
                    },
                    request);
}

CanFrame encode(std::uint8_t module_id, const Reply& reply) {
  CanFrame frame = frame_of(kReplyBase + module_id);
  const auto put_report = [&frame](const PositionReport& report) {
    put_f32(frame, report.position_rad);
    put_u8(frame, report.short_state);
    put_u8(frame, report.inputs);
  };
  std::visit(Overloaded{
                 [&](const Value& value) {
                   put_u8(frame, static_cast<std::uint8_t>(Command::GetParameter));
                   put_u8(frame, static_cast<std::uint8_t>(value.parameter));
                   std::visit(
                       Overloaded{[&](float v) { put_f32(frame, v); }, [&](std::uint32_t v) { put_u32(frame, v); },
                                  [&](std::uint16_t v) { put_u16(frame, v); }, put_report},
                       value.value);
                 },
                 [&](const SetDone& done) {
                   put_u8(frame, static_cast<std::uint8_t>(Command::SetParameter));
                   put_u8(frame, static_cast<std::uint8_t>(done.parameter));
                 },
                 [&](const PlainDone& done) { put_u8(frame, static_cast<std::uint8_t>(done.command)); },
                 [&](const MoveAccepted& accepted) {
                   put_u8(frame, static_cast<std::uint8_t>(Command::SetMotion));
                   put_u8(frame, static_cast<std::uint8_t>(accepted.motion));
                   if (accepted.report) put_report(*accepted.report);
                 },
                 [&](const StateNews&) { frame.id = kStateBase + module_id; },
             },
             reply);
  return frame;
}

Expected<Reply, DecodeError> decode_reply(std::uint8_t module_id, const CanFrame& frame) {
  using Kind = DecodeError::Kind;
  if (!is_standard_data(frame)) return unexpected(error(Kind::NotOurs, frame));
  if (frame.id == kStateBase + module_id) return Reply{StateNews{}};
  if (frame.id != kReplyBase + module_id) return unexpected(error(Kind::NotOurs, frame));
  if (frame.length < 1) return unexpected(error(Kind::BadLength, frame));
  const std::uint8_t byte = frame.payload[0];
  switch (static_cast<Command>(byte)) {
    case Command::GetParameter:
      return decode_value(frame);
    case Command::SetMotion:
      return decode_motion_reply(frame);
    case Command::SetParameter:  // what follows the parameter differs between firmwares, public drivers do not look
      if (frame.length < 2) return unexpected(error(Kind::BadLength, frame));
      if (!type_of(frame.payload[1])) return unexpected(error(Kind::UnknownParameter, frame, frame.payload[1]));
      return Reply{SetDone{static_cast<Parameter>(frame.payload[1])}};
    case Command::Reset:
    case Command::Home:
    case Command::Halt:
      return Reply{PlainDone{static_cast<Command>(byte)}};
    case Command::Watchdog:
    case Command::StartMotion:
      break;  // broadcasts are never answered
  }
  return unexpected(error(Kind::UnknownCommand, frame, byte));
}

Expected<Request, DecodeError> decode_request(std::uint8_t module_id, const CanFrame& frame) {
  using Kind = DecodeError::Kind;
  const bool get = frame.id == kGetBase + module_id;
  const bool set = frame.id == kSetBase + module_id;
  const bool all = frame.id == kBroadcastId;
  if (!is_standard_data(frame) || !(get || set || all)) return unexpected(error(Kind::NotOurs, frame));
  if (frame.length < 1) return unexpected(error(Kind::BadLength, frame));
  const std::uint8_t byte = frame.payload[0];
  const auto command = static_cast<Command>(byte);
  if (all) {
    if (command != Command::Watchdog && command != Command::StartMotion)
      return unexpected(error(Kind::UnknownCommand, frame, byte));
    return Request{Broadcast{command}};
  }
  if (get) {
    if (command != Command::GetParameter) return unexpected(error(Kind::UnknownCommand, frame, byte));
    if (frame.length != 2) return unexpected(error(Kind::BadLength, frame, byte));
    if (!type_of(frame.payload[1])) return unexpected(error(Kind::UnknownParameter, frame, frame.payload[1]));
    return Request{Get{static_cast<Parameter>(frame.payload[1])}};
  }
  if (command == Command::Reset || command == Command::Home || command == Command::Halt) {
    if (frame.length != 1) return unexpected(error(Kind::BadLength, frame, byte));
    return Request{Plain{command}};
  }
  if (command == Command::SetParameter) {
    if (frame.length != 6) return unexpected(error(Kind::BadLength, frame, byte));
    const auto type = type_of(frame.payload[1]);
    if (!type || *type == Type::Report || *type == Type::U16)
      return unexpected(error(Kind::UnknownParameter, frame, frame.payload[1]));
    Set request{static_cast<Parameter>(frame.payload[1]), u32_at(frame, 2)};
    if (*type == Type::F32) {
      if (!std::isfinite(f32_at(frame, 2))) return unexpected(error(Kind::BadValue, frame, frame.payload[1]));
      request.value = f32_at(frame, 2);
    }
    return Request{request};
  }
  if (command == Command::SetMotion) {
    if (frame.length < 2) return unexpected(error(Kind::BadLength, frame, byte));
    if (!is_motion(frame.payload[1])) return unexpected(error(Kind::UnknownMotion, frame, frame.payload[1]));
    Move move{static_cast<Motion>(frame.payload[1]), 0, 0};
    if (frame.length != (is_step(move.motion) ? 8 : 6)) return unexpected(error(Kind::BadLength, frame, byte));
    move.value = f32_at(frame, 2);
    if (!std::isfinite(move.value)) return unexpected(error(Kind::BadValue, frame, frame.payload[1]));
    if (is_step(move.motion)) move.time_ms = u16_at(frame, 6);
    return Request{move};
  }
  return unexpected(error(Kind::UnknownCommand, frame, byte));
}

bool answers(const Request& request, const Reply& reply) {
  return std::visit(Overloaded{
                        [](const Get& get, const Value& value) { return get.parameter == value.parameter; },
                        [](const Set& set, const SetDone& done) { return set.parameter == done.parameter; },
                        [](const Plain& plain, const PlainDone& done) { return plain.command == done.command; },
                        [](const Move& move, const MoveAccepted& accepted) { return move.motion == accepted.motion; },
                        [](const auto&, const auto&) { return false; },
                    },
                    request, reply);
}
}  // namespace binpick::drivers::pivot
