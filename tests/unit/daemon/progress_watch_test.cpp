#include "daemon/progress_watch.hpp"

#include <gtest/gtest.h>

namespace binpick::daemon {
namespace {
using namespace std::chrono_literals;
constexpr TimePoint kStart{1h};
}  // namespace

TEST(ProgressWatch, ADetectionHasTheTimeThatTheConfigurationGrants) {
  ProgressWatch watch;
  EXPECT_TRUE(watch.alive(1, 60s, kStart));
  EXPECT_TRUE(watch.alive(1, 60s, kStart + 60s)) << "detection.deadline_ms = 60000 is allowed";
  EXPECT_FALSE(watch.alive(1, 60s, kStart + 80s));
  EXPECT_TRUE(watch.alive(2, 60s, kStart + 81s));
}

TEST(ProgressWatch, AnIdleWorkerCountsUpOrHangs) {
  ProgressWatch watch;
  for (int half_second = 0; half_second < 1000; ++half_second)
    EXPECT_TRUE(watch.alive(static_cast<std::uint64_t>(half_second), 3s, kStart + half_second * 500ms));
  EXPECT_TRUE(watch.alive(999, 3s, kStart + 500s + 19s));
  EXPECT_FALSE(watch.alive(999, 3s, kStart + 500s + 20s));
}

TEST(ProgressWatch, AWorkerThatNeverBeganHangs) {
  ProgressWatch watch;
  EXPECT_TRUE(watch.alive(0, 3s, kStart));
  EXPECT_FALSE(watch.alive(0, 3s, kStart + 20s));
}
}  // namespace binpick::daemon
