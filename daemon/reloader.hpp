#pragma once

#include <exception>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "base/expected.hpp"
#include "daemon/cycle/cell_data.hpp"
#include "daemon/mailbox.hpp"

namespace binpick::daemon {
/// A reload reads files and verifies knowledge bases: that is too long for the loop, so a thread of its own does it.
class Reloader {
 public:
  using Loaded = Expected<std::shared_ptr<const CellData>, std::vector<std::string>>;

  /// `load` runs in the thread; `wake_loop` is called from it when take() has something to give.
  Reloader(std::function<Loaded()> load, std::function<void()> wake_loop)
      : load_{std::move(load)}, wake_loop_{std::move(wake_loop)} {}

  void start() {
    if (std::exchange(running_, true)) {
      again_ = true;  // an edit during a reload: read once more after it
      return;
    }
    thread_ = std::jthread([this] {
      // The box takes one, and one is under way: it is there before the loop wakes.
      loaded_.try_push(load());
      wake_loop_();
    });
  }
  std::optional<Loaded> take() {
    auto loaded = loaded_.try_pop();
    if (!loaded) return std::nullopt;
    running_ = false;
    if (std::exchange(again_, false)) start();
    return loaded;
  }
  /// Destroying it now would wait for the file system.
  bool pending() const { return running_; }

 private:
  /// A reload that fails leaves the cell running, whatever it was.
  Loaded load() const noexcept {
    try {
      return load_();
    } catch (const std::exception& failure) {
      return unexpected(std::vector<std::string>{failure.what()});
    }
  }

  std::function<Loaded()> load_;
  std::function<void()> wake_loop_;
  Mailbox<Loaded> loaded_{1};
  bool running_ = false, again_ = false;
  std::jthread thread_;
};
}  // namespace binpick::daemon
