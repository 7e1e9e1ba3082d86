#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <unordered_map>

#include "base/clock.hpp"

/// The one event loop: epoll, one time stamp per wake-up. Everything with a file descriptor is registered here;
/// sessions never are. Not thread-safe, except wake().
namespace binpick::drivers::link {
class Loop {
 public:
  /// `events` are epoll's bits (EPOLLIN …); `now` is the wake-up's one time stamp.
  using Callback = std::function<void(std::uint32_t events, TimePoint now)>;

  Loop();
  ~Loop();
  Loop(const Loop&) = delete;
  Loop& operator=(const Loop&) = delete;

  /// Level-triggered. The caller keeps owning the fd, and forgets it before closing it. Throws std::system_error.
  void watch(int fd, std::uint32_t events, Callback callback);
  void change(int fd, std::uint32_t events);
  /// Safe inside a callback, also for the fd that is being served.
  void forget(int fd);

  /// Waits until a descriptor is ready, wake() is called or `deadline` has passed; serves what is ready; returns the
  /// wake-up's time stamp. A signal does not end it.
  TimePoint wait(std::optional<TimePoint> deadline);
  /// Ends a wait() from another thread (eventfd).
  void wake();

 private:
  struct Watched {
    std::uint32_t registration;  ///< Tells an fd from a later one of the same number.
    std::shared_ptr<Callback> callback;
  };

  int epoll_fd_ = -1;
  int wake_fd_ = -1;
  std::uint32_t registrations_ = 0;
  std::unordered_map<int, Watched> watched_;
};
}  // namespace binpick::drivers::link
