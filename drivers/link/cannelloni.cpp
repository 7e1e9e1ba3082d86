#include "drivers/link/cannelloni.hpp"

#include <algorithm>

#include "base/check.hpp"

namespace binpick::drivers::link::cannelloni {
namespace {
constexpr std::uint8_t kVersion = 2;
constexpr std::uint8_t kOperationData = 0;
constexpr std::uint32_t kExtendedFlag = 0x80000000;
constexpr std::uint32_t kRtrFlag = 0x40000000;
constexpr std::uint32_t kErrorFlag = 0x20000000;
constexpr std::uint8_t kFdBit = 0x80;

std::uint8_t u8_at(ByteView bytes, std::size_t at) { return std::to_integer<std::uint8_t>(bytes[at]); }
}  // namespace

std::string to_string(const DecodeError& error) {
  const char* text = "";
  switch (error.kind) {
    case DecodeError::Kind::Truncated:
      text = "datagram ends too early";
      break;
    case DecodeError::Kind::Version:
      text = "not cannelloni version 2";
      break;
    case DecodeError::Kind::Operation:
      text = "not a data datagram";
      break;
    case DecodeError::Kind::Length:
      text = "frame length is impossible";
      break;
    case DecodeError::Kind::LeftOver:
      text = "bytes left over after the last frame";
      break;
  }
  return std::string(text) + ", byte " + std::to_string(error.offset);
}

Bytes encode(std::uint8_t sequence, std::span<const CanFrame> frames) {
  BINPICK_CHECK(frames.size() <= kFramesMax);
  Bytes out;
  out.reserve(kHeaderBytes + frames.size() * 13);
  append_be<std::uint8_t>(out, kVersion);
  append_be<std::uint8_t>(out, kOperationData);
  append_be<std::uint8_t>(out, sequence);
  append_be<std::uint16_t>(out, static_cast<std::uint16_t>(frames.size()));
  for (const CanFrame& frame : frames) {
    append_be<std::uint32_t>(out, frame.id | (frame.extended ? kExtendedFlag : 0) | (frame.rtr ? kRtrFlag : 0) |
                                      (frame.error ? kErrorFlag : 0));
    const std::uint8_t length = std::min<std::uint8_t>(frame.length, 8);
    append_be<std::uint8_t>(out, length);
    if (frame.rtr) continue;  // the length is carried, the payload is not
    for (std::size_t i = 0; i < length; ++i) append_be<std::uint8_t>(out, frame.payload[i]);
  }
  return out;
}

Expected<Datagram, DecodeError> decode(ByteView bytes) {
  using Kind = DecodeError::Kind;
  const auto wrong = [](Kind kind, std::size_t offset) { return unexpected(DecodeError{kind, offset}); };
  if (bytes.size() < kHeaderBytes) return wrong(Kind::Truncated, bytes.size());
  if (u8_at(bytes, 0) != kVersion) return wrong(Kind::Version, 0);
  if (u8_at(bytes, 1) != kOperationData) return wrong(Kind::Operation, 1);
  Datagram datagram;
  datagram.sequence = u8_at(bytes, 2);
  const auto count = read_be<std::uint16_t>(bytes, 3);
  std::size_t at = kHeaderBytes;
  for (unsigned i = 0; i < count; ++i) {
    if (bytes.size() - at < 5) return wrong(Kind::Truncated, bytes.size());
    const auto word = read_be<std::uint32_t>(bytes, at);
    const std::uint8_t length_byte = u8_at(bytes, at + 4);
    const bool fd = (length_byte & kFdBit) != 0;
    const std::size_t length = length_byte & 0x7FU;
    if (length > (fd ? kFdLengthMax : 8)) return wrong(Kind::Length, at + 4);
    at += 5;
    CanFrame frame;
    frame.extended = (word & kExtendedFlag) != 0;
    frame.rtr = (word & kRtrFlag) != 0;
    frame.error = (word & kErrorFlag) != 0;
    frame.id = word & 0x1FFFFFFF;
    frame.length = static_cast<std::uint8_t>(std::min<std::size_t>(length, 8));
    const std::size_t payload = (fd ? 1 : 0) + (frame.rtr ? 0 : length);
    if (bytes.size() - at < payload) return wrong(Kind::Truncated, bytes.size());
    if (fd) {
      ++datagram.fd_frames;
    } else {
      for (std::size_t k = 0; k < payload; ++k) frame.payload[k] = u8_at(bytes, at + k);
      datagram.frames.push_back(frame);
    }
    at += payload;
  }
  if (at != bytes.size()) return wrong(Kind::LeftOver, at);
  return datagram;
}

std::size_t lost_between(std::uint8_t last, std::uint8_t next) {
  const auto gap = static_cast<std::uint8_t>(next - last - 1);
  return gap < 128 ? gap : 0;
}
}  // namespace binpick::drivers::link::cannelloni
