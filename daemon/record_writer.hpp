#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <thread>

#include "config/config.hpp"
#include "daemon/cycle/record.hpp"
#include "daemon/mailbox.hpp"
#include "daemon/record_ring.hpp"

namespace binpick::daemon {
/// The thread that writes records: a slow or full disk costs records, never a cycle.
class RecordWriter {
 public:
  /// `wake_loop` is called from the thread after each record.
  explicit RecordWriter(std::function<void()> wake_loop);
  /// Waits for what was posted: not before idle(), where nobody has the time for a disk that hangs.
  ~RecordWriter();

  /// Never waits: when the disk is too slow, the record is dropped.
  void post(Record record, const config::Records& place);
  /// Whether records are being written, each time that this has changed.
  std::optional<bool> take_change();
  bool idle() const { return pending_ == 0; }
  std::uint64_t written() const { return written_; }

 private:
  struct Order {
    Record record;
    config::Records place;
  };
  void work();
  Expected<void, std::string> write(const Order& order);

  std::function<void()> wake_loop_;
  Mailbox<Order> orders_{4};
  std::atomic<int> pending_{0};
  std::atomic<std::uint64_t> written_{0};
  std::atomic<bool> failing_{false};
  // The loop's own.
  std::uint64_t dropped_ = 0;  // since the last one that found room
  bool told_ = true;
  // The thread's own.
  std::optional<RecordRing> ring_;
  std::uint64_t lost_ = 0;  // since the last one that was written
  std::jthread thread_;
};
}  // namespace binpick::daemon
