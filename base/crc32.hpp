#pragma once

#include <array>
#include <cstdint>

#include "base/bytes.hpp"

namespace binpick {
/// CRC-32 as of Ethernet and zip (reflected polynomial 0xEDB88320, ISO 3309): of "123456789" it is 0xCBF43926.
inline std::uint32_t crc32(ByteView bytes) {
  static constexpr auto kTable = [] {
    std::array<std::uint32_t, 256> table{};
    for (std::uint32_t i = 0; i < table.size(); ++i) {
      std::uint32_t v = i;
      for (int bit = 0; bit < 8; ++bit) v = (v >> 1) ^ ((v & 1) != 0 ? 0xEDB88320U : 0);
      table[i] = v;
    }
    return table;
  }();
  std::uint32_t sum = 0xFFFFFFFFU;
  for (const std::byte byte : bytes) sum = (sum >> 8) ^ kTable[(sum ^ std::to_integer<std::uint32_t>(byte)) & 0xFF];
  return ~sum;
}
}  // namespace binpick
