#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "base/bytes.hpp"
#include "base/expected.hpp"
#include "drivers/link/can.hpp"

/// CAN frames in UDP datagrams, cannelloni's data frames version 2. Pure functions. Numbers on the wire are big-endian.
/// Source: mguentner/cannelloni, doc/udp_format.md, parser.cpp.
namespace binpick::drivers::link::cannelloni {
inline constexpr std::uint16_t kDefaultPort = 20000;
inline constexpr std::size_t kHeaderBytes = 5;
/// 112 classic frames of 13 bytes and the header fit a datagram that Ethernet does not cut in two.
inline constexpr std::size_t kFramesMax = 112;
inline constexpr std::size_t kFdLengthMax = 64;

struct Datagram {
  std::uint8_t sequence = 0;  ///< Counts datagrams, wraps at 256.
  std::vector<CanFrame> frames;
  std::size_t fd_frames = 0;  ///< CAN FD frames, which were read over: no device here speaks FD.
};

struct DecodeError {
  enum class Kind { Truncated, Version, Operation, Length, LeftOver } kind = Kind::Truncated;
  std::size_t offset = 0;  ///< Byte at which decoding gave up.
};
std::string to_string(const DecodeError& error);

/// At most kFramesMax frames.
Bytes encode(std::uint8_t sequence, std::span<const CanFrame> frames);
Expected<Datagram, DecodeError> decode(ByteView datagram);

/// Datagrams that got lost between two sequence numbers; 0 for a repetition or one that comes late.
std::size_t lost_between(std::uint8_t last, std::uint8_t next);
}  // namespace binpick::drivers::link::cannelloni
