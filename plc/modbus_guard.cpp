#include "plc/modbus_guard.hpp"

#include "base/check.hpp"

namespace binpick::plc::modbus {
namespace {
constexpr std::uint8_t kReadHolding = 3, kReadInput = 4, kWriteSingle = 6, kDiagnostics = 8, kWriteMultiple = 16,
                       kReadWriteMultiple = 23;
constexpr std::size_t kReadMax = 125, kWriteMax = 123, kReadWriteWriteMax = 121;
constexpr std::size_t kLengthMin = 2;  ///< Unit and function.
constexpr std::size_t kLengthMax = kAduBytesMax - 6;

bool within(std::size_t first, std::size_t count, std::size_t from, std::size_t length) {
  return first >= from && first + count <= from + length;
}

std::optional<FrameError> header_error(ByteView bytes) {
  if (bytes.size() >= 4) {
    if (const auto protocol = read_be<std::uint16_t>(bytes, 2); protocol != 0)
      return FrameError{FrameError::Kind::ProtocolId, protocol};
  }
  if (bytes.size() >= 6) {
    if (const auto length = read_be<std::uint16_t>(bytes, 4); length < kLengthMin || length > kLengthMax)
      return FrameError{FrameError::Kind::Length, length};
  }
  return std::nullopt;
}
}  // namespace

std::string to_string(const FrameError& error) {
  switch (error.kind) {
    case FrameError::Kind::ProtocolId:
      return "protocol id " + std::to_string(error.value) + " is not Modbus (0)";
    case FrameError::Kind::Length:
      return "length field " + std::to_string(error.value) + " is outside 2 … 254";
    case FrameError::Kind::TooMuch:
      return "more than " + std::to_string(kPendingBytesMax) + " bytes wait";
  }
  return "?";
}

void FrameBuffer::append(ByteView bytes) {
  if (begin_ > 0) {
    bytes_.erase(bytes_.begin(), bytes_.begin() + static_cast<std::ptrdiff_t>(begin_));
    begin_ = 0;
  }
  if (bytes_.size() + bytes.size() > kPendingBytesMax) {
    too_much_ = true;
    return;
  }
  binpick::append(bytes_, bytes);
}

Expected<std::optional<Bytes>, FrameError> FrameBuffer::take_frame() {
  if (too_much_) return unexpected(FrameError{FrameError::Kind::TooMuch, size()});
  const ByteView bytes = pending();
  if (const auto error = header_error(bytes)) return unexpected(*error);
  if (bytes.size() < kHeaderBytes) return std::optional<Bytes>{};
  const std::size_t frame_bytes = 6 + static_cast<std::size_t>(read_be<std::uint16_t>(bytes, 4));
  if (bytes.size() < frame_bytes) return std::optional<Bytes>{};
  Bytes frame(bytes.begin(), bytes.begin() + static_cast<std::ptrdiff_t>(frame_bytes));
  begin_ += frame_bytes;
  return std::optional{std::move(frame)};
}

bool FrameBuffer::has_frame() const {
  const ByteView bytes = pending();
  if (too_much_ || header_error(bytes)) return true;
  return bytes.size() >= kHeaderBytes && bytes.size() >= 6 + static_cast<std::size_t>(read_be<std::uint16_t>(bytes, 4));
}

Bytes exception_answer(ByteView adu, ExceptionCode code) {
  BINPICK_CHECK(adu.size() > kHeaderBytes);
  Bytes out(adu.begin(), adu.begin() + 4);
  append_be<std::uint16_t>(out, 3);
  out.push_back(adu[6]);
  out.push_back(adu[7] | std::byte{0x80});
  out.push_back(static_cast<std::byte>(code));
  return out;
}

Verdict check(ByteView adu, const Limits& limits) {
  BINPICK_CHECK(adu.size() > kHeaderBytes && adu.size() <= kAduBytesMax);
  const ByteView pdu = adu.subspan(kHeaderBytes);
  const auto refuse = [&](ExceptionCode code) { return Verdict{exception_answer(adu, code), std::nullopt}; };
  const auto word = [&](std::size_t at) { return read_be<std::uint16_t>(pdu, at); };
  const auto readable = [&](std::size_t first, std::size_t count) {
    return within(first, count, limits.first, limits.count);
  };
  const auto writable = [&](std::size_t first, std::size_t count) {
    return within(first, count, limits.writable_first, limits.writable_count);
  };

  switch (std::to_integer<std::uint8_t>(pdu[0])) {
    case kReadHolding:
    case kReadInput:
      if (pdu.size() != 5 || word(3) < 1 || word(3) > kReadMax) return refuse(ExceptionCode::IllegalValue);
      if (!readable(word(1), word(3))) return refuse(ExceptionCode::IllegalAddress);
      return {};
    case kWriteSingle:
      if (pdu.size() != 5) return refuse(ExceptionCode::IllegalValue);
      if (!writable(word(1), 1)) return refuse(ExceptionCode::IllegalAddress);
      return {std::nullopt, WrittenRange{word(1), 1}};
    case kWriteMultiple: {
      if (pdu.size() < 6) return refuse(ExceptionCode::IllegalValue);
      const std::size_t count = word(3);
      const auto byte_count = std::to_integer<std::size_t>(pdu[5]);
      if (count < 1 || count > kWriteMax || byte_count != 2 * count || pdu.size() != 6 + byte_count)
        return refuse(ExceptionCode::IllegalValue);
      if (!writable(word(1), count)) return refuse(ExceptionCode::IllegalAddress);
      return {std::nullopt, WrittenRange{word(1), word(3)}};
    }
    case kReadWriteMultiple: {
      if (pdu.size() < 10) return refuse(ExceptionCode::IllegalValue);
      const std::size_t read_count = word(3);
      const std::size_t write_count = word(7);
      const auto byte_count = std::to_integer<std::size_t>(pdu[9]);
      if (read_count < 1 || read_count > kReadMax || write_count < 1 || write_count > kReadWriteWriteMax ||
          byte_count != 2 * write_count || pdu.size() != 10 + byte_count)
        return refuse(ExceptionCode::IllegalValue);
      if (!readable(word(1), read_count) || !writable(word(5), write_count))
        return refuse(ExceptionCode::IllegalAddress);
      return {std::nullopt, WrittenRange{word(5), word(7)}};
    }
    case kDiagnostics:
      if (pdu.size() < 3) return refuse(ExceptionCode::IllegalValue);
      if (word(1) != 0) return refuse(ExceptionCode::IllegalFunction);
      return {Bytes(adu.begin(), adu.end()), std::nullopt};
    default:
      return refuse(ExceptionCode::IllegalFunction);
  }
}
}  // namespace binpick::plc::modbus
