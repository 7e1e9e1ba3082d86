#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "base/bytes.hpp"
#include "base/expected.hpp"

/// What stands between the world and libmodbus: frames that are whole, well-formed and allowed get through, and nothing
/// else. libmodbus 3.1.6 checks neither protocol id nor header length, waits for missing bytes in the middle of a frame
/// and sleeps before it answers a bad one; none of that may happen to the loop.
/// Sources: MODBUS Messaging on TCP/IP Implementation Guide V1.0b (header), MODBUS Application Protocol V1.1b3
/// (functions).
namespace binpick::plc::modbus {
inline constexpr std::size_t kHeaderBytes = 7;  ///< Transaction, protocol, length, unit.
inline constexpr std::size_t kAduBytesMax = 260;
/// Bytes that may wait per connection: a master has one request under way, a few when it pipelines.
inline constexpr std::size_t kPendingBytesMax = 4096;

enum class ExceptionCode : std::uint8_t { IllegalFunction = 1, IllegalAddress = 2, IllegalValue = 3, Busy = 6 };

/// Why a connection's bytes can never become a frame again.
struct FrameError {
  enum class Kind { ProtocolId, Length, TooMuch } kind = Kind::ProtocolId;
  std::size_t value = 0;  ///< The offending field, or the bytes waiting.
};
std::string to_string(const FrameError& error);

/// Cuts one connection's stream into frames. Holds at most kPendingBytesMax bytes.
class FrameBuffer {
 public:
  void append(ByteView bytes);
  /// Moves the first whole frame out; nullopt while it is incomplete (then nothing is consumed). An error is final.
  Expected<std::optional<Bytes>, FrameError> take_frame();
  /// A frame (or an error) can be taken without further bytes.
  bool has_frame() const;
  std::size_t size() const { return bytes_.size() - begin_; }

 private:
  ByteView pending() const { return ByteView{bytes_}.subspan(begin_); }
  Bytes bytes_;
  std::size_t begin_ = 0;  // frames before it are taken
  bool too_much_ = false;
};

/// The words that exist and those that may be written, in 0-based Modbus addresses.
struct Limits {
  std::uint16_t first = 0;
  std::uint16_t count = 0;
  std::uint16_t writable_first = 0;
  std::uint16_t writable_count = 0;
};

struct WrittenRange {
  std::uint16_t first = 0;
  std::uint16_t count = 0;
};

/// What to do with a whole frame: answer it here, or let libmodbus answer it.
struct Verdict {
  std::optional<Bytes> answer;          ///< Ours: an exception, or the echo of 8/0.
  std::optional<WrittenRange> written;  ///< Set when libmodbus will write.
};

/// Functions 3, 4, 6, 16 and 23 with counts, byte counts and addresses in bounds pass; 8/0 is echoed; all else is an
/// exception. `adu` is a whole frame as FrameBuffer gives it.
Verdict check(ByteView adu, const Limits& limits);

/// The exception answer to `adu`.
Bytes exception_answer(ByteView adu, ExceptionCode code);
}  // namespace binpick::plc::modbus
