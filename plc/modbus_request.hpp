#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "base/bytes.hpp"
#include "base/expected.hpp"

/// Requests of a Modbus/TCP client and what comes back. libmodbus has a client too, but one that connects, sends and
/// waits inside its calls, up to its time-out; without a socket it has nothing to offer but these few bytes.
/// Sources: MODBUS Messaging on TCP/IP Implementation Guide V1.0b (header), MODBUS Application Protocol V1.1b3
/// (functions 3 and 16, exceptions).
namespace binpick::plc::modbus {
inline constexpr std::size_t kReadWordsMax = 125, kWriteWordsMax = 123;

struct Request {
  std::uint16_t transaction = 0;
  std::uint8_t unit = 255;
  std::uint16_t first = 0;           ///< 0-based address.
  std::uint16_t count = 0;           ///< Words to be read; of a write, words.size().
  std::vector<std::uint16_t> words;  ///< To be written; empty: a read.

  bool is_read() const { return words.empty(); }
  std::uint8_t function() const { return is_read() ? 3 : 16; }
};
/// "function 16, 74 words at 8".
std::string to_string(const Request& request);

/// The whole frame. At most kReadWordsMax words are read, kWriteWordsMax written.
Bytes encode(const Request& request);

/// Why a frame is not the answer to a request.
struct ReplyError {
  enum class Kind {
    Transaction,  ///< Of another request: a late one, most often.
    Unit,
    Function,
    Length,     ///< The frame, or the byte count in it, is not as long as this answer is.
    Echo,       ///< A write answered with another address or count.
    Exception,  ///< A proper answer: the server refuses.
  };
  Kind kind = Kind::Length;
  std::uint16_t got = 0;
  std::uint16_t expected = 0;
};
std::string to_string(const ReplyError& error);

/// The words that were read, none for a write. `adu` is a whole frame as FrameBuffer gives it.
Expected<std::vector<std::uint16_t>, ReplyError> parse_reply(ByteView adu, const Request& request);
}  // namespace binpick::plc::modbus
