#include "drivers/scanner/lms400/codec.hpp"

#include <algorithm>
#include <bit>
#include <charconv>
#include <cmath>
#include <cstdio>

namespace binpick::drivers::lms400 {
namespace {
constexpr std::byte kStx{0x02};
constexpr std::size_t kStxCount = 4;
constexpr std::size_t kHeaderBytes = 8;  // of the frame
constexpr std::size_t kMeasuredHeaderBytes = 20;
constexpr std::size_t kTrailerBytes = 18;

/// First place from `from` on where a frame may begin: four STX, or fewer at the very end.
std::size_t next_start(ByteView bytes, std::size_t from) {
  for (std::size_t at = from; at < bytes.size(); ++at) {
    const ByteView head = bytes.subspan(at, std::min(kStxCount, bytes.size() - at));
    if (std::ranges::all_of(head, [](std::byte b) { return b == kStx; })) return at;
  }
  return bytes.size();
}

std::size_t bytes_per_point(Format format) {
  switch (format) {
    case Format::DistanceAndRemission:
      return 3;
    case Format::Distance:
      return 2;
    case Format::Remission:
      return 1;
  }
  return 0;
}

std::optional<Message> decode_payload(ByteView payload) {
  if (payload[0] == std::byte{'s'}) return Text{std::string{as_text(payload)}};
  if (payload.size() < kMeasuredHeaderBytes + kTrailerBytes) return std::nullopt;
  const auto format = read_le<std::uint16_t>(payload, 0);
  if (format < 0x20 || format > 0x22) return std::nullopt;
  Measured m;
  m.format = static_cast<Format>(format);
  m.distance_scale = read_le<std::uint16_t>(payload, 2);
  m.start_1e4deg = read_le<std::int32_t>(payload, 4);
  m.step_1e4deg = read_le<std::uint16_t>(payload, 8);
  const std::size_t n = read_le<std::uint16_t>(payload, 10);
  m.frequency_hz = read_le<std::uint16_t>(payload, 12);
  m.remission_scale = read_le<std::uint16_t>(payload, 14);
  m.remission_start = read_le<std::uint16_t>(payload, 16);
  m.remission_end = read_le<std::uint16_t>(payload, 18);
  const std::size_t pitch = bytes_per_point(m.format);
  if (payload.size() != kMeasuredHeaderBytes + n * pitch + kTrailerBytes) return std::nullopt;
  const bool has_distance = m.format != Format::Remission, has_remission = m.format != Format::Distance;
  if (has_distance) m.distance.reserve(n);
  if (has_remission) m.remission.reserve(n);
  for (std::size_t i = 0, at = kMeasuredHeaderBytes; i < n; ++i, at += pitch) {
    if (has_distance) m.distance.push_back(read_le<std::uint16_t>(payload, at));
    if (has_remission) m.remission.push_back(std::to_integer<std::uint8_t>(payload[at + pitch - 1]));
  }
  for (std::size_t word = 0; word < m.trailer.size(); ++word)
    m.trailer[word] = read_le<std::uint16_t>(payload, kMeasuredHeaderBytes + n * pitch + 2 * word);
  return m;
}

Bytes encode_payload(const Measured& m) {
  Bytes out;
  append_le(out, static_cast<std::uint16_t>(m.format));
  append_le(out, m.distance_scale);
  append_le(out, m.start_1e4deg);
  append_le(out, m.step_1e4deg);
  append_le(out, static_cast<std::uint16_t>(m.points()));
  append_le(out, m.frequency_hz);
  append_le(out, m.remission_scale);
  append_le(out, m.remission_start);
  append_le(out, m.remission_end);
  for (std::size_t i = 0; i < m.points(); ++i) {
    if (m.format != Format::Remission) append_le(out, m.distance[i]);
    if (m.format != Format::Distance) append_le(out, m.remission[i]);
  }
  for (const std::uint16_t word : m.trailer) append_le(out, word);
  return out;
}

template <class... Arguments>
std::string printed(const char* format, Arguments... arguments) {
  std::array<char, 64> buffer{};
  const int n = std::snprintf(buffer.data(), buffer.size(), format, arguments...);
  return {buffer.data(), static_cast<std::size_t>(std::clamp(n, 0, static_cast<int>(buffer.size()) - 1))};
}

std::vector<std::string> words_of(std::string_view text) {
  std::vector<std::string> words;
  while (true) {
    const std::size_t space = text.find(' ');
    words.emplace_back(text.substr(0, space));
    if (space == std::string_view::npos) return words;
    text.remove_prefix(space + 1);
  }
}

std::string joined(std::string text, const std::vector<std::string>& arguments) {
  for (const std::string& argument : arguments) text += ' ' + argument;
  return text;
}
}  // namespace

std::optional<float> Measured::range_mm(std::size_t i) const {
  if (i >= distance.size() || distance[i] == 0) return std::nullopt;
  return static_cast<float>(distance[i]) * static_cast<float>(distance_scale);
}

Expected<std::optional<Decoded>, DecodeError> decode(ByteView bytes) {
  using Kind = DecodeError::Kind;
  if (const std::size_t start = next_start(bytes, 0); start > 0) return unexpected(DecodeError{Kind::BadStart, start});
  const auto error = [&](Kind kind) {
    return unexpected(DecodeError{kind, std::max<std::size_t>(1, next_start(bytes, 1))});
  };
  if (bytes.size() < kHeaderBytes) return std::nullopt;
  const std::size_t length = read_be<std::uint32_t>(bytes, kStxCount);
  if (length < 1 || length > kPayloadBytesMax) return error(Kind::BadLength);
  if (bytes.size() < length + kFramingBytes) return std::nullopt;
  const ByteView payload = bytes.subspan(kHeaderBytes, length);
  std::byte checksum{0};
  for (const std::byte b : payload) checksum ^= b;
  if (checksum != bytes[kHeaderBytes + length]) return error(Kind::BadChecksum);
  auto message = decode_payload(payload);
  if (!message) return unexpected(DecodeError{Kind::BadTelegram, length + kFramingBytes});
  return Decoded{std::move(*message), length + kFramingBytes};
}

Bytes encode(const Message& message) {
  Bytes payload;
  if (const Text* text = std::get_if<Text>(&message))
    append(payload, as_bytes(text->text));
  else
    payload = encode_payload(std::get<Measured>(message));
  Bytes out(kStxCount, kStx);
  out.reserve(payload.size() + kFramingBytes);
  append_be(out, static_cast<std::uint32_t>(payload.size()));
  append(out, payload);
  std::byte checksum{0};
  for (const std::byte b : payload) checksum ^= b;
  out.push_back(checksum);
  return out;
}

std::string to_string(DecodeError::Kind kind) {
  switch (kind) {
    case DecodeError::Kind::BadStart:
      return "bytes between the frames";
    case DecodeError::Kind::BadLength:
      return "a length field out of range";
    case DecodeError::Kind::BadChecksum:
      return "a wrong checksum";
    case DecodeError::Kind::BadTelegram:
      return "a telegram of unknown kind or inconsistent length";
  }
  return "?";
}

std::string to_text(const Request& request) { return joined(request.verb + ' ' + request.name, request.arguments); }

std::optional<Request> parse_request(std::string_view text) {
  auto words = words_of(text);
  if (words.size() < 2 || words[1].empty()) return std::nullopt;
  if (words[0] != "sRN" && words[0] != "sWN" && words[0] != "sMN" && words[0] != "sRI") return std::nullopt;
  return Request{words[0], words[1], {words.begin() + 2, words.end()}};
}

Request stop_measuring() { return {"sMN", "mLRstopdata", {}}; }
Request start_measuring(Format format) {
  return {"sMN", "mLRreqdata", {printed("%02X", static_cast<unsigned>(format))}};
}
Request log_in() { return {"sMN", "SetAccessMode", {"4", "81BE23AA"}}; }
Request set_filter(int mask) { return {"sWN", "FLsel", {printed("%+d", mask)}}; }
Request set_extended_remission(bool on) { return {"sWN", "MDblex", {on ? "1" : "0"}}; }
Request set_scan(double frequency_hz, Angle resolution, Angle start, Angle range) {
  return {"sMN",
          "mSCsetscanconfig",
          {printed("%+.2f", frequency_hz), printed("%+.2f", resolution.in_deg()), printed("%+.2f", start.in_deg()),
           printed("%+.2f", range.in_deg())}};
}
Request read_address() { return {"sRN", "EIip", {}}; }

std::string to_text(const Reply& reply) {
  switch (reply.kind) {
    case Reply::Kind::Accepted:
      return joined("sMA " + reply.name, reply.arguments);
    case Reply::Kind::Result:
      return joined("sAN " + reply.name, reply.arguments);
    case Reply::Kind::Written:
      return joined("sWA " + reply.name, reply.arguments);
    case Reply::Kind::Value:
      return joined("sRA " + reply.name, reply.arguments);
    case Reply::Kind::Refused:
      return joined("sFA", reply.arguments);
  }
  return {};
}

std::optional<Reply> parse_reply(std::string_view text) {
  auto words = words_of(text);
  if (words.size() < 2) return std::nullopt;
  Reply reply;
  if (words[0] == "sFA") return Reply{Reply::Kind::Refused, "", {words.begin() + 1, words.end()}};
  if (words[0] == "sMA")
    reply.kind = Reply::Kind::Accepted;
  else if (words[0] == "sAN")
    reply.kind = Reply::Kind::Result;
  else if (words[0] == "sWA")
    reply.kind = Reply::Kind::Written;
  else if (words[0] == "sRA")
    reply.kind = Reply::Kind::Value;
  else
    return std::nullopt;
  reply.name = words[1];
  reply.arguments.assign(words.begin() + 2, words.end());
  return reply;
}

std::optional<std::int64_t> parse_integer(std::string_view word) {
  if (word.empty() || word.size() > 11) return std::nullopt;
  const bool has_sign = word[0] == '+' || word[0] == '-';
  const bool negative = word[0] == '-';
  const std::string_view digits = has_sign ? word.substr(1) : word;
  if (digits.empty() || digits[0] == '-') return std::nullopt;
  std::int64_t value = 0;
  const auto [end, failure] = std::from_chars(digits.data(), digits.data() + digits.size(), value, has_sign ? 10 : 16);
  if (failure != std::errc{} || end != digits.data() + digits.size() || value > 0xFFFFFFFFLL) return std::nullopt;
  return negative ? -value : value;
}

std::optional<double> parse_decimal(std::string_view word) {
  if (!word.empty() && word[0] == '+') word.remove_prefix(1);
  double value = 0;
  const auto [end, failure] = std::from_chars(word.data(), word.data() + word.size(), value);
  if (word.empty() || failure != std::errc{} || end != word.data() + word.size() || !std::isfinite(value))
    return std::nullopt;
  return value;
}

std::optional<double> parse_float_hex(std::string_view word) {
  std::uint32_t bits = 0;
  const auto [end, failure] = std::from_chars(word.data(), word.data() + word.size(), bits, 16);
  if (word.size() != 8 || failure != std::errc{} || end != word.data() + word.size()) return std::nullopt;
  const float value = std::bit_cast<float>(bits);
  if (!std::isfinite(value)) return std::nullopt;
  return value;
}

std::string to_float_hex(double value) {
  return printed("%08X", std::bit_cast<std::uint32_t>(static_cast<float>(value)));
}

std::string refusal_text(std::uint32_t code) {
  struct Row {
    std::uint32_t code;
    const char* meaning;
    const char* remedy;
  };
  constexpr const char* model = "check that the device is an LMS 400 and its firmware";
  constexpr const char* settings = "check frequency_hz, resolution_deg, start_deg and range_deg in [scanner]";
  constexpr const char* restart = "restart the scanner; if it comes again, have it serviced";
  static constexpr std::array rows{
      Row{0x1, "access to the method denied, the login is missing",
          "another program may have ended our login: leave the scanner to one program"},
      Row{0x2, "unknown method", model},
      Row{0x3, "unknown variable", model},
      Row{0x4, "not possible in the device's present condition", "wait for the motor; switch the scanner off and on"},
      Row{0x5, "invalid argument", settings},
      Row{0x6, "unknown error in the device", restart},
      Row{0x7, "buffer overflow in the device, too many arguments", model},
      Row{0x8, "too few arguments", model},
      Row{0x9, "unknown type", model},
      Row{0xA, "writing the variable denied, the login is missing",
          "another program may have ended our login: leave the scanner to one program"},
      Row{0xB, "unknown command for the name server", model},
      Row{0xC, "unknown command", model},
      Row{0xD, "method busy, an earlier call still runs", "leave the scanner to one program; switch it off and on"},
      Row{0xE, "array out of bounds", model},
      Row{0xF, "unknown event", model},
      Row{0x10, "a value too large for its type", settings},
      Row{0x11, "invalid character", model},
      Row{0x12, "no message from the device's operating system", restart},
      Row{0x13, "no answer from the device's operating system", restart},
      Row{0x14, "internal error", restart},
      Row{0x15, "hub address corrupted", restart},
      Row{0x16, "hub address cannot be decoded", restart},
      Row{0x17, "hub address exceeded", restart},
      Row{0x18, "a blank was expected", model},
      Row{0x19, "asynchronous methods are suppressed", restart},
      Row{0x1A, "complex arrays are not supported", model}};
  const auto row = std::ranges::find(rows, code, &Row::code);
  if (row == rows.end()) return printed("error %X", code) + ", which no public table explains; " + restart;
  return printed("error %X, ", code) + row->meaning + "; " + row->remedy;
}
}  // namespace binpick::drivers::lms400
