#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>
#include <vector>

/// Reading and writing numbers in a stated byte order. Reads do not check the length: the caller has done so.
namespace binpick {
using Bytes = std::vector<std::byte>;
using ByteView = std::span<const std::byte>;

template <class T>
T read_le(ByteView bytes, std::size_t at) {
  std::uint64_t v = 0;
  for (std::size_t i = sizeof(T); i-- > 0;) v = (v << 8) | std::to_integer<std::uint64_t>(bytes[at + i]);
  return static_cast<T>(v);
}

template <class T>
T read_be(ByteView bytes, std::size_t at) {
  std::uint64_t v = 0;
  for (std::size_t i = 0; i < sizeof(T); ++i) v = (v << 8) | std::to_integer<std::uint64_t>(bytes[at + i]);
  return static_cast<T>(v);
}

template <class T>
void append_le(Bytes& out, T value) {
  auto v = static_cast<std::uint64_t>(value);
  for (std::size_t i = 0; i < sizeof(T); ++i, v >>= 8) out.push_back(static_cast<std::byte>(v & 0xFF));
}

template <class T>
void append_be(Bytes& out, T value) {
  const auto v = static_cast<std::uint64_t>(value);
  for (std::size_t i = sizeof(T); i-- > 0;) out.push_back(static_cast<std::byte>((v >> (8 * i)) & 0xFF));
}

inline float read_f32_le(ByteView bytes, std::size_t at) {
  return std::bit_cast<float>(read_le<std::uint32_t>(bytes, at));
}
inline void append_f32_le(Bytes& out, float value) { append_le(out, std::bit_cast<std::uint32_t>(value)); }

inline ByteView as_bytes(std::string_view text) { return std::as_bytes(std::span{text.data(), text.size()}); }
inline std::string_view as_text(ByteView bytes) { return {reinterpret_cast<const char*>(bytes.data()), bytes.size()}; }
inline void append(Bytes& out, ByteView bytes) { out.insert(out.end(), bytes.begin(), bytes.end()); }
}  // namespace binpick
