#pragma once

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstddef>
#include <optional>
#include <thread>
#include <vector>

/// Work shared between threads so that the result does not depend on their number: every index writes its own place.
namespace binpick::vision {
/// When detection has to come to an end. Without a deadline it never expires.
class Deadline {
 public:
  explicit Deadline(std::optional<std::chrono::steady_clock::time_point> at = std::nullopt) : at_{at} {}
  bool expired() const {
    if (!at_ || std::chrono::steady_clock::now() < *at_) return false;
    told_.store(true, std::memory_order_relaxed);
    return true;
  }
  /// Somebody who had more to do was told that it has expired.
  bool cut_short() const { return told_.load(std::memory_order_relaxed); }

 private:
  std::optional<std::chrono::steady_clock::time_point> at_;
  mutable std::atomic<bool> told_{false};
};

/// Calls work(index, thread) for 0 … count - 1, each once, on up to `threads` threads, until the deadline expires.
template <class Work>
void share(int threads, std::size_t count, const Deadline& deadline, const Work& work) {
  std::atomic<std::size_t> next{0};
  const auto run = [&](int thread) {
    for (std::size_t i = next.fetch_add(1, std::memory_order_relaxed); i < count && !deadline.expired();
         i = next.fetch_add(1, std::memory_order_relaxed))
      work(i, thread);
  };
  const int team = static_cast<int>(std::min<std::size_t>(static_cast<std::size_t>(std::clamp(threads, 1, 64)), count));
  std::vector<std::jthread> others;
  for (int t = 1; t < team; ++t) others.emplace_back(run, t);
  run(0);
}
}  // namespace binpick::vision
