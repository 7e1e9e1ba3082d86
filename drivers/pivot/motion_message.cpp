#include "drivers/pivot/motion_message.hpp"

#include <algorithm>
#include <utility>

#include "base/check.hpp"

namespace binpick::drivers::pivot::motion {
namespace {
constexpr std::size_t kWholeMax = 7;    // D-Len of a message in one frame
constexpr std::size_t kStartBytes = 5;  // parameters in the first fragment
constexpr std::size_t kNextBytes = 6;   // in a further one

CanFrame frame_of(std::uint32_t can_id, std::size_t d_len, std::uint8_t command, ByteView bytes) {
  CanFrame frame;
  frame.id = can_id;
  frame.payload[0] = static_cast<std::uint8_t>(d_len);
  frame.payload[1] = command;
  for (std::size_t i = 0; i < bytes.size(); ++i) frame.payload[2 + i] = std::to_integer<std::uint8_t>(bytes[i]);
  frame.length = static_cast<std::uint8_t>(2 + bytes.size());
  return frame;
}

void take_bytes(Bytes& into, const CanFrame& frame, std::size_t from) {
  for (std::size_t i = from; i < frame.length; ++i) into.push_back(std::byte{frame.payload[i]});
}
}  // namespace

std::vector<CanFrame> frames_of(std::uint32_t can_id, const Message& message) {
  const ByteView bytes{message.parameters};
  const std::size_t d_len = 1 + bytes.size();
  BINPICK_CHECK(d_len <= 255);
  if (d_len <= kWholeMax) return {frame_of(can_id, d_len, message.command, bytes)};
  Bytes first{std::byte{message.command}};
  append(first, bytes.first(kStartBytes));
  std::vector<CanFrame> frames{frame_of(can_id, d_len, kFragmentStart, first)};
  for (std::size_t at = kStartBytes; at < bytes.size();) {
    const std::size_t left = bytes.size() - at;
    const std::size_t here = std::min(left, kNextBytes);
    frames.push_back(
        frame_of(can_id, left, left > kNextBytes ? kFragmentMiddle : kFragmentEnd, bytes.subspan(at, here)));
    at += here;
  }
  return frames;
}

Expected<std::optional<Message>, DecodeError> Assembler::take(const CanFrame& frame) {
  using Kind = DecodeError::Kind;
  const auto error = [&](Kind kind) {
    begun_.reset();
    return unexpected(DecodeError{kind, frame.id, frame.length, frame.length > 1 ? frame.payload[1] : std::uint8_t{0}});
  };
  if (frame.length < 2 || frame.length > frame.payload.size()) return error(Kind::BadLength);
  const std::size_t d_len = frame.payload[0];
  const std::uint8_t command = frame.payload[1];
  const bool full = frame.length == frame.payload.size();
  if (command == kFragmentStart) {
    if (d_len <= kWholeMax || !full) return error(Kind::BadFragment);
    begun_ = Message{frame.payload[2], {}};
    take_bytes(begun_->parameters, frame, 3);
    left_ = d_len - 1 - kStartBytes;
    return std::optional<Message>{};
  }
  if (command == kFragmentMiddle) {
    if (!begun_ || d_len != left_ || left_ <= kNextBytes || !full) return error(Kind::BadFragment);
    take_bytes(begun_->parameters, frame, 2);
    left_ -= kNextBytes;
    return std::optional<Message>{};
  }
  if (command == kFragmentEnd) {
    if (!begun_ || d_len != left_ || frame.length != 2 + left_) return error(Kind::BadFragment);
    take_bytes(begun_->parameters, frame, 2);
    return std::exchange(begun_, std::nullopt);
  }
  // A whole message between the fragments of another (an impulse may come at any time) leaves them as they are.
  if (d_len + 1 != frame.length) return error(Kind::BadLength);
  Message message{command, {}};
  take_bytes(message.parameters, frame, 2);
  return std::optional{message};
}
}  // namespace binpick::drivers::pivot::motion
