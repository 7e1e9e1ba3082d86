#include "drivers/link/loop.hpp"

#include <algorithm>
#include <array>
#include <cerrno>
#include <limits>
#include <sys/epoll.h>
#include <sys/eventfd.h>
#include <system_error>
#include <unistd.h>

#include "base/check.hpp"

namespace binpick::drivers::link {
namespace {
/// Descriptors served per wake-up; more wait for the next one, which comes at once.
constexpr int kEventsMax = 64;

/// epoll counts whole milliseconds: rounded up, so that a deadline has passed when its wait ends.
int timeout_ms(std::optional<TimePoint> deadline) {
  if (!deadline) return -1;
  const TimePoint now = std::chrono::steady_clock::now();
  if (*deadline <= now) return 0;
  const auto ms = std::chrono::ceil<std::chrono::milliseconds>(*deadline - now).count();
  return static_cast<int>(std::min<std::int64_t>(ms, std::numeric_limits<int>::max()));
}

std::uint64_t tag(int fd, std::uint32_t registration) {
  return (std::uint64_t{registration} << 32) | static_cast<std::uint32_t>(fd);
}
}  // namespace

Loop::Loop() : epoll_fd_{::epoll_create1(EPOLL_CLOEXEC)}, wake_fd_{::eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK)} {
  if (epoll_fd_ < 0 || wake_fd_ < 0) {
    const int why = errno;
    if (epoll_fd_ >= 0) ::close(epoll_fd_);
    if (wake_fd_ >= 0) ::close(wake_fd_);
    throw std::system_error(why, std::generic_category(), "event loop: epoll_create1 or eventfd");
  }
  watch(wake_fd_, EPOLLIN, [this](std::uint32_t, TimePoint) {
    std::uint64_t wakes = 0;
    while (::read(wake_fd_, &wakes, sizeof wakes) < 0 && errno == EINTR) continue;
  });
}

Loop::~Loop() {
  ::close(epoll_fd_);
  ::close(wake_fd_);
}

void Loop::watch(int fd, std::uint32_t events, Callback callback) {
  BINPICK_CHECK(!watched_.contains(fd));
  Watched watched{++registrations_, std::make_shared<Callback>(std::move(callback))};
  epoll_event event{};
  event.events = events;
  event.data.u64 = tag(fd, watched.registration);
  if (::epoll_ctl(epoll_fd_, EPOLL_CTL_ADD, fd, &event) != 0)
    throw std::system_error(errno, std::generic_category(), "event loop: cannot watch a descriptor");
  watched_.emplace(fd, std::move(watched));
}

void Loop::change(int fd, std::uint32_t events) {
  const auto found = watched_.find(fd);
  BINPICK_CHECK(found != watched_.end());
  epoll_event event{};
  event.events = events;
  event.data.u64 = tag(fd, found->second.registration);
  BINPICK_CHECK(::epoll_ctl(epoll_fd_, EPOLL_CTL_MOD, fd, &event) == 0);
}

void Loop::forget(int fd) {
  if (watched_.erase(fd) == 0) return;
  ::epoll_ctl(epoll_fd_, EPOLL_CTL_DEL, fd,
              nullptr);  // fails when the fd is closed already: then epoll forgot by itself
}

TimePoint Loop::wait(std::optional<TimePoint> deadline) {
  std::array<epoll_event, kEventsMax> ready;
  int count = 0;
  do {
    count = ::epoll_wait(epoll_fd_, ready.data(), kEventsMax, timeout_ms(deadline));
  } while (count < 0 && errno == EINTR);
  BINPICK_CHECK(count >= 0);
  const TimePoint now = std::chrono::steady_clock::now();
  for (int i = 0; i < count; ++i) {
    const epoll_event& event = ready[static_cast<std::size_t>(i)];
    const int fd = static_cast<int>(static_cast<std::uint32_t>(event.data.u64));
    const auto found = watched_.find(fd);
    // An earlier callback of this wake-up may have closed the fd, and the number may already stand for another one.
    if (found == watched_.end() || tag(fd, found->second.registration) != event.data.u64) continue;
    const std::shared_ptr<Callback> callback = found->second.callback;  // lives on if it forgets itself
    (*callback)(event.events, now);
  }
  return now;
}

void Loop::wake() {
  const std::uint64_t one = 1;
  while (::write(wake_fd_, &one, sizeof one) < 0 && errno == EINTR) continue;
}
}  // namespace binpick::drivers::link
