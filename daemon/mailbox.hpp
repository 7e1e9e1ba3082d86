#pragma once

#include <condition_variable>
#include <cstddef>
#include <deque>
#include <mutex>
#include <optional>

#include "base/clock.hpp"

namespace binpick::daemon {
/// Values on their way from one thread to another; bounded. The only lock of the program.
template <class T>
class Mailbox {
 public:
  explicit Mailbox(std::size_t limit) : limit_{limit} {}

  /// False when it is full or closed; the value is then still the caller's.
  bool try_push(T&& value) {
    const std::lock_guard lock{mutex_};
    if (closed_ || values_.size() >= limit_) return false;
    values_.push_back(std::move(value));
    ready_.notify_one();
    return true;
  }
  std::optional<T> try_pop() {
    const std::lock_guard lock{mutex_};
    return pop();
  }
  /// Waits at most `patience`; nothing when it is over or the box is closed.
  std::optional<T> pop_for(Duration patience) {
    std::unique_lock lock{mutex_};
    ready_.wait_for(lock, patience, [&] { return closed_ || !values_.empty(); });
    return pop();
  }
  void close() {
    const std::lock_guard lock{mutex_};
    closed_ = true;
    ready_.notify_all();
  }
  bool closed() const {
    const std::lock_guard lock{mutex_};
    return closed_;
  }

 private:
  std::optional<T> pop() {
    if (values_.empty()) return std::nullopt;
    T value = std::move(values_.front());
    values_.pop_front();
    return value;
  }

  const std::size_t limit_;
  mutable std::mutex mutex_;
  std::condition_variable ready_;
  std::deque<T> values_;
  bool closed_ = false;
};
}  // namespace binpick::daemon
