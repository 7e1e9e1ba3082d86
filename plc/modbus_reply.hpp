#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "base/bytes.hpp"

struct _modbus;

namespace binpick::plc::modbus {
/// libmodbus as a function from request to answer: it writes into one end of a private socket pair, we read the other.
/// Holding and input registers are the same words, and the mapping starts at address 0, whatever the base address
/// (libmodbus's check of a write below the mapping's start was wrong once, CVE-2022-0367).
class Reply {
 public:
  /// Words 0 … words-1 exist. Throws std::runtime_error when the system gives no socket pair or memory.
  explicit Reply(std::size_t words);
  ~Reply();
  Reply(const Reply&) = delete;
  Reply& operator=(const Reply&) = delete;

  /// `adu` has passed the guard. The answer is empty when libmodbus has none.
  Bytes answer(ByteView adu);
  std::span<std::uint16_t> words() { return words_; }
  std::span<const std::uint16_t> words() const { return words_; }

 private:
  std::vector<std::uint16_t> words_;
  _modbus* context_ = nullptr;
  int ours_ = -1;    // we read answers here
  int theirs_ = -1;  // libmodbus writes them here
};
}  // namespace binpick::plc::modbus
