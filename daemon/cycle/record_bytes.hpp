#pragma once

#include <bit>
#include <cstdint>
#include <string>
#include <type_traits>
#include <vector>

#include "base/bytes.hpp"
#include "base/clock.hpp"
#include "base/frames.hpp"

/// Fields of a record's sections, in and out. Each `put` has its `take` of the same name and order.
namespace binpick::daemon {
class FieldWriter {
 public:
  template <class T>
  void number(T value) {
    if constexpr (std::is_enum_v<T>) {
      append_le(bytes_, static_cast<std::underlying_type_t<T>>(value));
    } else if constexpr (std::is_same_v<T, bool>) {
      append_le(bytes_, static_cast<std::uint8_t>(value));
    } else if constexpr (std::is_same_v<T, double>) {
      append_le(bytes_, std::bit_cast<std::uint64_t>(value));
    } else if constexpr (std::is_same_v<T, float>) {
      append_f32_le(bytes_, value);
    } else {
      append_le(bytes_, value);
    }
  }
  void count(std::size_t n) { number(static_cast<std::uint32_t>(n)); }
  void text(const std::string& value) {
    count(value.size());
    append(bytes_, as_bytes(value));
  }
  void time(TimePoint at) { duration(at.time_since_epoch()); }
  void duration(Duration d) {
    number(static_cast<std::int64_t>(std::chrono::duration_cast<std::chrono::nanoseconds>(d).count()));
  }
  void isometry(const Eigen::Isometry3d& T) {
    for (Eigen::Index row = 0; row < 3; ++row)
      for (Eigen::Index col = 0; col < 4; ++col) number(T(row, col));
  }
  /// A list, each entry with its length before it.
  template <class List, class Put>
  void list(const List& items, const Put& put) {
    count(items.size());
    for (const auto& item : items) {
      const std::size_t at = bytes_.size();
      count(0);
      put(*this, item);
      const auto length = static_cast<std::uint32_t>(bytes_.size() - at - 4);
      for (std::size_t i = 0; i < 4; ++i) bytes_[at + i] = static_cast<std::byte>(length >> (8 * i));
    }
  }
  Bytes take() { return std::move(bytes_); }

 private:
  Bytes bytes_;
};

/// Reads what FieldWriter wrote. Where the bytes have ended, a value stays what it was; a list that promises more than
/// there are bytes is bad().
class FieldReader {
 public:
  explicit FieldReader(ByteView bytes) : bytes_{bytes} {}

  bool ended() const { return at_ == bytes_.size(); }
  bool bad() const { return bad_; }
  void set_bad() { bad_ = true; }

  template <class T>
  T number() {
    if constexpr (std::is_enum_v<T>) {
      return static_cast<T>(number<std::underlying_type_t<T>>());
    } else if constexpr (std::is_same_v<T, bool>) {
      return number<std::uint8_t>() != 0;
    } else if constexpr (std::is_same_v<T, double>) {
      return std::bit_cast<double>(number<std::uint64_t>());
    } else if constexpr (std::is_same_v<T, float>) {
      return std::bit_cast<float>(number<std::uint32_t>());
    } else {
      if (!holds(sizeof(T))) return T{};
      const T value = read_le<T>(bytes_, at_);
      at_ += sizeof(T);
      return value;
    }
  }
  template <class T>
  void number(T& value) {
    if (!ended()) value = number<T>();
  }
  /// An enumeration whose values are 0 … last.
  template <class T>
  void choice(T& value, T last) {
    if (ended()) return;
    value = number<T>();
    if (value < T{} || value > last) {
      value = T{};
      bad_ = true;
    }
  }
  /// Of things that take `bytes_each` at least.
  std::size_t count(std::size_t bytes_each) {
    const auto n = static_cast<std::size_t>(number<std::uint32_t>());
    if (n <= (bytes_.size() - at_) / bytes_each) return n;
    bad_ = true;
    return 0;
  }
  void text(std::string& value) {
    if (ended()) return;
    const std::size_t n = count(1);
    value = as_text(bytes_.subspan(at_, n));
    at_ += n;
  }
  void time(TimePoint& at) {
    if (ended()) return;
    Duration d{};
    duration(d);
    at = TimePoint{d};
  }
  void duration(Duration& d) {
    if (ended()) return;
    d = std::chrono::duration_cast<Duration>(std::chrono::nanoseconds{number<std::int64_t>()});
  }
  void isometry(Eigen::Isometry3d& T) {
    if (ended()) return;
    for (Eigen::Index row = 0; row < 3; ++row)
      for (Eigen::Index col = 0; col < 4; ++col) number(T(row, col));
  }
  /// An entry takes `bytes_least`: a forged number of empty ones must not take memory that no file has.
  template <class Item, class Take>
  void list(std::vector<Item>& items, std::size_t bytes_least, const Take& take) {
    const std::size_t n = count(4 + bytes_least);
    items.clear();
    for (std::size_t i = 0; i < n && !bad_; ++i) {
      const std::size_t length = count(1);
      FieldReader entry{bytes_.subspan(at_, length)};
      at_ += length;
      take(entry, items.emplace_back());
      bad_ = bad_ || entry.bad_;
    }
  }

 private:
  /// At its end a section has nothing more to say; a part of a number is no number.
  bool holds(std::size_t n) {
    if (bytes_.size() - at_ >= n) return true;
    if (!ended()) bad_ = true;
    at_ = bytes_.size();
    return false;
  }

  ByteView bytes_;
  std::size_t at_ = 0;
  bool bad_ = false;
};
}  // namespace binpick::daemon
