#pragma once

#include <atomic>
#include <functional>
#include <thread>

#include "base/clock.hpp"
#include "daemon/cycle/detection.hpp"
#include "daemon/mailbox.hpp"

namespace binpick::daemon {
/// The one thread that looks: takes a DetectRequest, puts a DetectResult back, wakes the loop. After the answer is out
/// it draws the cycle's picture, if the configuration wants one.
class VisionWorker {
 public:
  explicit VisionWorker(std::function<void()> wake_loop);
  /// Closes the mailbox and waits for the running detection.
  ~VisionWorker();

  bool post(DetectRequest request);  ///< False when one is already waiting.
  std::optional<DetectResult> take_result();
  /// Counts up while the worker is alive; stands still when it hangs. The watchdog is fed by its change.
  std::uint64_t progress() const { return progress_; }
  /// In a detection, or in a picture of one.
  bool busy() const { return busy_; }

 private:
  void work();

  std::function<void()> wake_loop_;
  Mailbox<DetectRequest> requests_{1};
  Mailbox<DetectResult> results_{4};
  std::atomic<std::uint64_t> progress_{0};
  std::atomic<bool> busy_{false};
  std::jthread thread_;
};
}  // namespace binpick::daemon
