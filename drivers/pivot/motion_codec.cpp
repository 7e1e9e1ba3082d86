#include "drivers/pivot/motion_codec.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>

#include "base/overloaded.hpp"

namespace binpick::drivers::pivot::motion {
namespace {
using Kind = DecodeError::Kind;

constexpr std::size_t kTypeBytes = 8;
constexpr std::size_t kTypeHead = kTypeBytes + 4 + 3 * 2;  // type, order number, three versions; then the date
constexpr std::size_t kDateMin = 21, kDateMax = 26;        // by the manual; as PR 70 modules send it (schunk.py)

enum class Type { Byte, Word, Angle };
struct ItemRow {
  ConfigItem item;
  Type type;
};
constexpr std::array kItems{
    ItemRow{ConfigItem::ModuleId, Type::Byte},     ItemRow{ConfigItem::UnitSystem, Type::Byte},
    ItemRow{ConfigItem::PositionMax, Type::Angle}, ItemRow{ConfigItem::PositionMin, Type::Angle},
    ItemRow{ConfigItem::VelocityMax, Type::Angle}, ItemRow{ConfigItem::AccelerationMax, Type::Angle},
    ItemRow{ConfigItem::SerialNumber, Type::Word}, ItemRow{ConfigItem::OrderNumber, Type::Word},
};

std::optional<Type> type_of(std::uint8_t item) {
  for (const ItemRow& row : kItems)
    if (static_cast<std::uint8_t>(row.item) == item) return row.type;
  return std::nullopt;
}

/// Numbers on the wire for one radian. Lengths have no meaning for a pivot and pass as they are.
double per_rad(UnitSystem units) {
  constexpr double kDegree = 180.0 / std::numbers::pi;
  switch (units) {
    case UnitSystem::Degree:
      return kDegree;
    case UnitSystem::Microdegree:
      return 1e6 * kDegree;
    case UnitSystem::Millidegree:
      return 1e3 * kDegree;
    default:
      return 1;
  }
}

/// No axis has such a number; beyond it, a float in another unit may have none.
bool is_sane(double value) { return std::isfinite(value) && std::abs(value) < 1e12; }

std::int32_t whole(double value) {
  using Limits = std::numeric_limits<std::int32_t>;
  return static_cast<std::int32_t>(std::clamp(std::round(value), double{Limits::min()}, double{Limits::max()}));
}

struct Writer {
  Message message;
  UnitSystem units;

  void byte(std::uint8_t v) { append_le(message.parameters, v); }
  void angle(double rad) {
    if (is_integer(units))
      append_le(message.parameters, whole(rad * per_rad(units)));
    else
      append_f32_le(message.parameters, static_cast<float>(rad * per_rad(units)));
  }
  void text(const char* words) { append(message.parameters, as_bytes(words)); }
  void text(const std::string& words, std::size_t width) {
    for (std::size_t i = 0; i < width; ++i) byte(i < words.size() ? static_cast<std::uint8_t>(words[i]) : 0);
  }
};

struct Reader {
  const Message& message;
  UnitSystem units;

  std::size_t size() const { return message.parameters.size(); }
  std::uint8_t byte(std::size_t at) const { return std::to_integer<std::uint8_t>(message.parameters[at]); }
  double angle(std::size_t at) const {
    const double raw = is_integer(units) ? static_cast<double>(read_le<std::int32_t>(message.parameters, at))
                                         : static_cast<double>(read_f32_le(message.parameters, at));
    return raw / per_rad(units);
  }
  std::string text(std::size_t at, std::size_t width) const {
    std::string words;
    for (std::size_t i = at; i < at + width && byte(i) != 0; ++i)
      words += byte(i) >= 0x20 && byte(i) < 0x7F ? static_cast<char>(byte(i)) : '?';
    while (words.ends_with(' ')) words.pop_back();
    return words;
  }
  bool is_ok() const { return as_text(message.parameters) == "OK"; }
};

auto error(Kind kind, const Message& message) {
  return unexpected(DecodeError{kind, 0, static_cast<std::uint8_t>(1 + message.parameters.size()), message.command});
}

bool is_plain(Command command) {
  return command == Command::Acknowledge || command == Command::FastStop || command == Command::Stop ||
         command == Command::Reference || command == Command::Reboot || command == Command::ToggleImpulses;
}

Expected<Reply, DecodeError> decode_config(const Reader& in) {
  if (in.size() >= kTypeHead + kDateMin && in.size() <= kTypeHead + kDateMax) {
    const ByteView bytes{in.message.parameters};
    return Reply{ModuleType{in.text(0, kTypeBytes), read_le<std::uint32_t>(bytes, kTypeBytes),
                            read_le<std::uint16_t>(bytes, kTypeBytes + 4),
                            read_le<std::uint16_t>(bytes, kTypeBytes + 6),
                            read_le<std::uint16_t>(bytes, kTypeBytes + 8), in.text(kTypeHead, in.size() - kTypeHead)}};
  }
  if (in.size() < 2) return error(Kind::BadLength, in.message);
  const auto type = type_of(in.byte(0));
  if (!type) return error(Kind::UnknownParameter, in.message);
  if (in.size() != (*type == Type::Byte ? 2 : 5)) return error(Kind::BadLength, in.message);
  ConfigValue value{static_cast<ConfigItem>(in.byte(0)), std::uint32_t{0}};
  if (*type == Type::Byte) value.value = std::uint32_t{in.byte(1)};
  if (*type == Type::Word) value.value = read_le<std::uint32_t>(in.message.parameters, 1);
  if (*type == Type::Angle) {
    if (!is_sane(in.angle(1))) return error(Kind::BadValue, in.message);
    value.value = in.angle(1);
  }
  if (value.item == ConfigItem::UnitSystem && std::get<std::uint32_t>(value.value) > kUnitSystemMax)
    return error(Kind::BadValue, in.message);
  return Reply{value};
}

Expected<Reply, DecodeError> decode_state(const Reader& in) {
  if (in.is_ok()) return Reply{Done{Command::GetState}};  // seen in the field: the report was not ready; ask again
  const std::size_t numbers = in.size() / 4;
  if (in.size() != 4 * numbers + 2 || numbers > 3) return error(Kind::BadLength, in.message);
  StateReport report;
  if (numbers > 0) report.position_rad = in.angle(0);
  if (numbers > 1) report.velocity_rad_s = in.angle(4);
  if (numbers > 2 && !is_integer(in.units)) report.current_a = read_f32_le(in.message.parameters, 8);
  if (!is_sane(report.position_rad.value_or(0)) || !is_sane(report.velocity_rad_s.value_or(0)) ||
      !std::isfinite(report.current_a.value_or(0)))
    return error(Kind::BadValue, in.message);
  report.state = in.byte(4 * numbers);
  report.error = in.byte(4 * numbers + 1);
  return Reply{report};
}
}  // namespace

const char* to_string(UnitSystem units) {
  constexpr std::array kNames{"mm",       "m",  "inch",         "rad",   "degrees",
                              "internal", "µm", "microdegrees", "µinch", "millidegrees"};
  return kNames.at(static_cast<std::size_t>(units));
}

Message encode(const Request& request, UnitSystem units) {
  Writer out{{}, units};
  const auto command = [&out](Command c) { out.message.command = static_cast<std::uint8_t>(c); };
  std::visit(Overloaded{
                 [&](const GetConfig& get) {
                   command(Command::GetConfig);
                   if (get.item) out.byte(static_cast<std::uint8_t>(*get.item));
                 },
                 [&](const GetState& get) {
                   command(Command::GetState);
                   if (!get.cyclic) return;
                   if (is_integer(units))
                     append_le(out.message.parameters, whole(get.cyclic->period_s * 1e3));
                   else
                     append_f32_le(out.message.parameters, static_cast<float>(get.cyclic->period_s));
                   out.byte(get.cyclic->mode);
                 },
                 [&](const SetTarget& set) {
                   command(set.command);
                   out.angle(set.value);
                 },
                 [&](const MovePosition& move) {
                   command(Command::MovePosition);
                   out.angle(move.position_rad);
                   if (!move.velocity_rad_s) return;
                   out.angle(*move.velocity_rad_s);
                   if (move.acceleration_rad_s2) out.angle(*move.acceleration_rad_s2);
                 },
                 [&](const Plain& plain) { command(plain.command); },
             },
             request);
  return out.message;
}

Message encode(const Reply& reply, UnitSystem units) {
  Writer out{{}, units};
  const auto command = [&out](Command c) { out.message.command = static_cast<std::uint8_t>(c); };
  std::visit(Overloaded{
                 [&](const StateReport& report) {
                   command(Command::GetState);
                   if (report.position_rad) out.angle(*report.position_rad);
                   if (report.velocity_rad_s) out.angle(*report.velocity_rad_s);
                   if (report.current_a) append_f32_le(out.message.parameters, *report.current_a);
                   out.byte(report.state);
                   out.byte(report.error);
                 },
                 [&](const ConfigValue& value) {
                   command(Command::GetConfig);
                   out.byte(static_cast<std::uint8_t>(value.item));
                   if (const auto* angle = std::get_if<double>(&value.value)) return out.angle(*angle);
                   const auto number = std::get<std::uint32_t>(value.value);
                   if (type_of(static_cast<std::uint8_t>(value.item)) == Type::Byte)
                     out.byte(static_cast<std::uint8_t>(number));
                   else
                     append_le(out.message.parameters, number);
                 },
                 [&](const ModuleType& type) {
                   command(Command::GetConfig);
                   out.text(type.type, kTypeBytes);
                   append_le(out.message.parameters, type.order);
                   for (const std::uint16_t version : {type.firmware, type.protocol, type.hardware})
                     append_le(out.message.parameters, version);
                   out.text(type.date, kDateMax);
                 },
                 [&](const Done& done) {
                   command(done.command);
                   out.text("OK");
                 },
                 [&](const MoveTime& time) {
                   command(Command::MovePosition);
                   append_f32_le(out.message.parameters, time.estimate_s);
                 },
                 [&](const Refused& refused) {
                   out.message.command = refused.command;
                   out.byte(refused.code);
                 },
                 [&](const Trouble& trouble) {
                   command(trouble.kind);
                   out.byte(trouble.code);
                 },
                 [&](const Info& info) {
                   command(Command::Info);
                   out.byte(info.code);
                   out.byte(0);
                 },
                 [&](const Impulse& impulse) {
                   command(impulse.kind);
                   out.angle(impulse.position_rad);
                 },
             },
             reply);
  return out.message;
}

Expected<Reply, DecodeError> decode_reply(const Message& message, UnitSystem units) {
  const Reader in{message, units};
  const auto command = static_cast<Command>(message.command);
  const auto length_is = [&](std::size_t size) { return in.size() == size; };
  if (command == Command::Error || command == Command::Warning) {
    if (!length_is(1)) return error(Kind::BadLength, message);
    return Reply{Trouble{command, in.byte(0)}};
  }
  if (length_is(1)) return Reply{Refused{message.command, in.byte(0)}};  // D-Len 2: it failed
  switch (command) {
    case Command::GetConfig:
      return decode_config(in);
    case Command::GetState:
      return decode_state(in);
    case Command::Info:
      if (!length_is(2)) return error(Kind::BadLength, message);
      return Reply{Info{in.byte(0)}};
    case Command::MoveBlocked:
    case Command::PositionReached:
      if (!length_is(4)) return error(Kind::BadLength, message);
      if (!is_sane(in.angle(0))) return error(Kind::BadValue, message);
      return Reply{Impulse{command, in.angle(0)}};
    case Command::MovePosition:
      if (in.is_ok()) return Reply{Done{command}};
      if (!length_is(4)) return error(Kind::BadLength, message);
      // A whole number in unit systems of integers; nothing depends on it.
      return Reply{MoveTime{is_integer(units) ? 0.0F : read_f32_le(message.parameters, 0)}};
    case Command::SetTargetVelocity:
    case Command::SetTargetAcceleration:
      if (!in.is_ok()) return error(Kind::BadLength, message);
      return Reply{Done{command}};
    case Command::ToggleImpulses:
      if (as_text(message.parameters) != "ON" && as_text(message.parameters) != "OFF")
        return error(Kind::BadLength, message);
      return Reply{Done{command}};
    default:
      break;
  }
  if (!is_plain(command)) return error(Kind::UnknownCommand, message);
  if (!in.is_ok()) return error(Kind::BadLength, message);
  return Reply{Done{command}};
}

Expected<Request, DecodeError> decode_request(const Message& message, UnitSystem units) {
  const Reader in{message, units};
  const auto command = static_cast<Command>(message.command);
  switch (command) {
    case Command::GetConfig:
      if (in.size() == 0) return Request{GetConfig{}};
      if (in.size() != 1) return error(Kind::BadLength, message);
      if (!type_of(in.byte(0))) return error(Kind::UnknownParameter, message);
      return Request{GetConfig{static_cast<ConfigItem>(in.byte(0))}};
    case Command::GetState: {
      if (in.size() == 0) return Request{GetState{}};
      if (in.size() != 5) return error(Kind::BadLength, message);
      const double period_s = is_integer(units) ? 1e-3 * read_le<std::int32_t>(message.parameters, 0)
                                                : static_cast<double>(read_f32_le(message.parameters, 0));
      if (!std::isfinite(period_s) || period_s < 0 || in.byte(4) > report_mode::kAll)
        return error(Kind::BadValue, message);
      return Request{GetState{GetState::Cyclic{period_s, in.byte(4)}}};
    }
    case Command::SetTargetVelocity:
    case Command::SetTargetAcceleration:
      if (in.size() != 4) return error(Kind::BadLength, message);
      if (!is_sane(in.angle(0))) return error(Kind::BadValue, message);
      return Request{SetTarget{command, in.angle(0)}};
    case Command::MovePosition: {
      if (in.size() == 0 || in.size() % 4 != 0 || in.size() > 5 * 4) return error(Kind::BadLength, message);
      for (std::size_t at = 0; at < in.size(); at += 4)
        if (!is_sane(in.angle(at))) return error(Kind::BadValue, message);
      MovePosition move{in.angle(0), std::nullopt, std::nullopt};  // current and jerk may follow
      if (in.size() > 4) move.velocity_rad_s = in.angle(4);
      if (in.size() > 8) move.acceleration_rad_s2 = in.angle(8);
      return Request{move};
    }
    default:
      break;
  }
  if (!is_plain(command)) return error(Kind::UnknownCommand, message);
  if (in.size() != 0) return error(Kind::BadLength, message);
  return Request{Plain{command}};
}
}  // namespace binpick::drivers::pivot::motion
