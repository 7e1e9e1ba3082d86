#pragma once

#include <cstdint>
#include <span>

#include "base/check.hpp"
#include "plc/events.hpp"
#include "plc/options.hpp"
#include "plc/registers.hpp"
#include "plc/words.hpp"

namespace binpick::plc {
/// The words of the map, written by name and type.
class RegisterImage {
 public:
  /// `words` are the map's, from offset 0 on; they outlive this.
  RegisterImage(std::span<std::uint16_t> words, WordOrder order) : words_{words}, order_{order} {
    BINPICK_CHECK(words.size() == kMapLength);
  }

  std::uint16_t word(std::uint16_t offset) const { return words_[offset]; }
  std::span<const std::uint16_t> request() const { return words_.subspan(kRequestFirst, kRequestLength); }
  void put(std::uint16_t offset, std::uint16_t value) { words_[offset] = value; }
  /// A 32-bit value (std::uint32_t or float) in the configured word order.
  template <class T>
  void put_long(std::uint16_t offset, T value) {
    const auto pair = to_words(value, order_);
    words_[offset] = pair[0];
    words_[std::size_t{offset} + 1] = pair[1];
  }

  /// Fills the result block; poses only with a pick, in `convention`.
  void put_result(const PickRequest& request, const PickResult& result, PoseConvention convention);
  void clear_result();

 private:
  std::span<std::uint16_t> words_;
  WordOrder order_;
};
}  // namespace binpick::plc
