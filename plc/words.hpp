#pragma once

#include <array>
#include <bit>
#include <cstdint>

/// 32-bit values in two 16-bit registers. By shifts from the bit pattern: libmodbus's own float helpers changed their
/// meaning between releases (NEWS.md 3.1.8, 3.1.11) and are never used.
namespace binpick::plc {
enum class WordOrder { HighWordFirst, LowWordFirst };  ///< S7: ABCD; Logix with COP: CDAB.

constexpr std::array<std::uint16_t, 2> to_words(std::uint32_t value, WordOrder order) {
  const auto high = static_cast<std::uint16_t>(value >> 16);
  const auto low = static_cast<std::uint16_t>(value & 0xFFFF);
  return order == WordOrder::HighWordFirst ? std::array{high, low} : std::array{low, high};
}
constexpr std::array<std::uint16_t, 2> to_words(float value, WordOrder order) {
  return to_words(std::bit_cast<std::uint32_t>(value), order);
}

constexpr std::uint32_t u32_from_words(std::uint16_t first, std::uint16_t second, WordOrder order) {
  const std::uint32_t high = order == WordOrder::HighWordFirst ? first : second;
  const std::uint32_t low = order == WordOrder::HighWordFirst ? second : first;
  return (high << 16) | low;
}
constexpr float f32_from_words(std::uint16_t first, std::uint16_t second, WordOrder order) {
  return std::bit_cast<float>(u32_from_words(first, second, order));
}

static_assert(to_words(123456.0F, WordOrder::HighWordFirst) == std::array<std::uint16_t, 2>{0x47F1, 0x2000});
static_assert(to_words(123456.0F, WordOrder::LowWordFirst) == std::array<std::uint16_t, 2>{0x2000, 0x47F1});
}  // namespace binpick::plc
