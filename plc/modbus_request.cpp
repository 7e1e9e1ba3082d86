#include "plc/modbus_request.hpp"

#include "base/check.hpp"
#include "plc/modbus_guard.hpp"

namespace binpick::plc::modbus {
namespace {
constexpr std::uint8_t kExceptionBit = 0x80;

std::string_view name_of_exception(std::uint16_t code) {
  switch (code) {
    case 1:
      return "it does not serve this function";
    case 2:
      return "it has no such address";
    case 3:
      return "it takes no such count";
    case 4:
      return "it failed";
    case 5:
      return "it is still at work";
    case 6:
      return "it is busy";
    case 10:
    case 11:
      return "a gateway does not reach it";
    default:
      return "no exception of the specification";
  }
}
}  // namespace

std::string to_string(const Request& request) {
  return "function " + std::to_string(request.function()) + ", " + std::to_string(request.count) +
         (request.count == 1 ? " word at " : " words at ") + std::to_string(request.first);
}

Bytes encode(const Request& request) {
  BINPICK_CHECK(request.count > 0 && std::size_t{request.first} + request.count <= 65536);
  BINPICK_CHECK(request.is_read() ? request.count <= kReadWordsMax
                                  : request.count <= kWriteWordsMax && request.count == request.words.size());
  Bytes out;
  append_be(out, request.transaction);
  append_be<std::uint16_t>(out, 0);
  append_be<std::uint16_t>(out, static_cast<std::uint16_t>(request.is_read() ? 6 : 7 + 2 * request.count));
  out.push_back(std::byte{request.unit});
  out.push_back(std::byte{request.function()});
  append_be(out, request.first);
  append_be(out, request.count);
  if (!request.is_read()) out.push_back(static_cast<std::byte>(2 * request.count));
  for (const std::uint16_t word : request.words) append_be(out, word);
  return out;
}

std::string to_string(const ReplyError& error) {
  const std::string got = std::to_string(error.got), expected = std::to_string(error.expected);
  switch (error.kind) {
    case ReplyError::Kind::Transaction:
      return "reply of transaction " + got + " to " + expected + ", a late one or somebody else's";
    case ReplyError::Kind::Unit:
      return "reply of unit " + got + " to a request for " + expected + "; see plc.unit_id";
    case ReplyError::Kind::Function:
      return "reply of function " + got + " to " + expected;
    case ReplyError::Kind::Length:
      return "reply of " + got + " bytes where " + expected + " belong";
    case ReplyError::Kind::Echo:
      return "write of " + expected + " answered as one of " + got;
    case ReplyError::Kind::Exception:
      return "exception " + got + ": " + std::string(name_of_exception(error.got));
  }
  return "?";
}

Expected<std::vector<std::uint16_t>, ReplyError> parse_reply(ByteView adu, const Request& request) {
  using Kind = ReplyError::Kind;
  BINPICK_CHECK(adu.size() > kHeaderBytes && adu.size() <= kAduBytesMax);
  const auto refuse = [](Kind kind, std::size_t got, std::size_t expected) {
    return unexpected(ReplyError{kind, static_cast<std::uint16_t>(got), static_cast<std::uint16_t>(expected)});
  };
  if (const auto id = read_be<std::uint16_t>(adu, 0); id != request.transaction)
    return refuse(Kind::Transaction, id, request.transaction);
  if (const auto unit = std::to_integer<std::uint8_t>(adu[6]); unit != request.unit)
    return refuse(Kind::Unit, unit, request.unit);
  const ByteView pdu = adu.subspan(kHeaderBytes);
  const auto function = std::to_integer<std::uint8_t>(pdu[0]);
  if (function == (request.function() | kExceptionBit)) {
    if (pdu.size() != 2) return refuse(Kind::Length, pdu.size(), 2);
    return refuse(Kind::Exception, std::to_integer<std::uint8_t>(pdu[1]), 0);
  }
  if (function != request.function()) return refuse(Kind::Function, function, request.function());

  std::vector<std::uint16_t> words;
  if (!request.is_read()) {
    if (pdu.size() != 5) return refuse(Kind::Length, pdu.size(), 5);
    const auto first = read_be<std::uint16_t>(pdu, 1), count = read_be<std::uint16_t>(pdu, 3);
    if (first != request.first) return refuse(Kind::Echo, first, request.first);
    if (count != request.count) return refuse(Kind::Echo, count, request.count);
    return words;
  }
  const std::size_t bytes = 2 * std::size_t{request.count};
  if (pdu.size() != 2 + bytes) return refuse(Kind::Length, pdu.size(), 2 + bytes);
  if (const auto said = std::to_integer<std::uint8_t>(pdu[1]); said != bytes) return refuse(Kind::Length, said, bytes);
  words.reserve(request.count);
  for (std::size_t i = 0; i < request.count; ++i) words.push_back(read_be<std::uint16_t>(pdu, 2 + 2 * i));
  return words;
}
}  // namespace binpick::plc::modbus
