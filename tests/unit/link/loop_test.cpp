#include "drivers/link/loop.hpp"

#include <array>
#include <csignal>
#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/epoll.h>
#include <sys/time.h>
#include <thread>
#include <unistd.h>
#include <vector>

namespace binpick::drivers::link {
namespace {
using namespace std::chrono_literals;

TimePoint in(Duration d) { return std::chrono::steady_clock::now() + d; }

/// A pipe whose read end has something to read.
struct FullPipe {
  std::array<int, 2> fds{-1, -1};
  FullPipe() {
    EXPECT_EQ(::pipe2(fds.data(), O_CLOEXEC | O_NONBLOCK), 0);
    EXPECT_EQ(::write(fds[1], "x", 1), 1);
  }
  ~FullPipe() {
    ::close(fds[0]);
    ::close(fds[1]);
  }
  int reader() const { return fds[0]; }
};
}  // namespace

TEST(Loop, ReturnsAtItsDeadlineAndNotBefore) {
  Loop loop;
  const TimePoint deadline = in(3ms);
  EXPECT_GE(loop.wait(deadline), deadline);
}

TEST(Loop, ServesWhatIsReadyEvenWhenTheDeadlineHasPassed) {
  Loop loop;
  FullPipe pipe;
  TimePoint seen;
  loop.watch(pipe.reader(), EPOLLIN, [&](std::uint32_t events, TimePoint now) {
    EXPECT_TRUE((events & EPOLLIN) != 0);
    seen = now;
  });
  const TimePoint now = loop.wait(in(-1s));
  EXPECT_EQ(seen, now) << "one time stamp per wake-up";
}

TEST(Loop, IsWokenFromAnotherThread) {
  Loop loop;
  std::thread other{[&] { loop.wake(); }};
  const TimePoint limit = in(10s);
  EXPECT_LT(loop.wait(limit), limit);
  other.join();
  const TimePoint deadline = in(2ms);
  EXPECT_GE(loop.wait(deadline), deadline) << "one wake ends one wait";
}

TEST(Loop, ADescriptorMayForgetItselfAndOthersInsideACallback) {
  Loop loop;
  FullPipe a, b;
  int served = 0;
  const auto forget_both = [&](std::uint32_t, TimePoint) {
    ++served;
    loop.forget(a.reader());
    loop.forget(b.reader());
  };
  loop.watch(a.reader(), EPOLLIN, forget_both);
  loop.watch(b.reader(), EPOLLIN, forget_both);
  loop.wait(in(1s));
  EXPECT_EQ(served, 1);
  loop.wait(in(0ms));
  EXPECT_EQ(served, 1);
}

TEST(Loop, AnEventOfAClosedDescriptorNeverReachesItsSuccessor) {
  Loop loop;
  FullPipe a, b;
  std::vector<int> wrongly_served;
  const auto replace = [&](int victim) {
    return [&, victim](std::uint32_t, TimePoint) {
      loop.forget(a.reader());
      loop.forget(b.reader());
      // The same number again, another thing behind it: an empty pipe, which has nothing to be served.
      std::array<int, 2> empty{-1, -1};
      ASSERT_EQ(::pipe2(empty.data(), O_CLOEXEC | O_NONBLOCK), 0);
      ASSERT_EQ(::dup3(empty[0], victim, O_CLOEXEC), victim);
      ::close(empty[0]);
      loop.watch(victim, EPOLLIN, [&, victim](std::uint32_t, TimePoint) { wrongly_served.push_back(victim); });
      ::close(empty[1]);  // hang-up would be seen by the next wait, not by this one
    };
  };
  loop.watch(a.reader(), EPOLLIN, replace(b.reader()));
  loop.watch(b.reader(), EPOLLIN, replace(a.reader()));
  loop.wait(in(1s));
  EXPECT_TRUE(wrongly_served.empty());
}

TEST(Loop, ChangeTurnsServingOffAndOn) {
  Loop loop;
  FullPipe pipe;
  int served = 0;
  loop.watch(pipe.reader(), EPOLLIN, [&](std::uint32_t, TimePoint) { ++served; });
  loop.change(pipe.reader(), 0);
  loop.wait(in(0ms));
  EXPECT_EQ(served, 0);
  loop.change(pipe.reader(), EPOLLIN);
  loop.wait(in(0ms));
  EXPECT_EQ(served, 1);
}

TEST(Loop, ASignalDoesNotEndAWait) {
  static volatile std::sig_atomic_t signals = 0;
  struct sigaction action {};
  action.sa_handler = [](int) { signals = signals + 1; };
  struct sigaction before {};
  ASSERT_EQ(::sigaction(SIGALRM, &action, &before), 0);
  const itimerval every_ms{{0, 1000}, {0, 1000}};
  const itimerval off{};
  ::setitimer(ITIMER_REAL, &every_ms, nullptr);
  Loop loop;
  const TimePoint deadline = in(20ms);
  EXPECT_GE(loop.wait(deadline), deadline);
  ::setitimer(ITIMER_REAL, &off, nullptr);
  ::sigaction(SIGALRM, &before, nullptr);
  EXPECT_GT(signals, 0);
}
}  // namespace binpick::drivers::link
