#include "daemon/progress_watch.hpp"

#include <gtest/gtest.h>

namespace binpick::daemon {
namespace {
using namespace std::chrono_literals;
constexpr TimePoint kStart{1h};
}  // namespace

TEST(ProgressWatch, ADetectionHasTheTimeThatTheConfigurationGrants) {
  ProgressWatch watch;
  EXPECT_TRUE(watch.alive(1, true, 60s, kStart));
  EXPECT_TRUE(watch.alive(1, true, 60s, kStart + 60s)) << "detection.deadline_ms = 60000 is allowed";
  EXPECT_FALSE(watch.alive(1, true, 60s, kStart + 80s));
  EXPECT_TRUE(watch.alive(2, true, 60s, kStart + 81s));
}

TEST(ProgressWatch, AnIdleWorkerIsAlive) {
  ProgressWatch watch;
  EXPECT_TRUE(watch.alive(1, false, 3s, kStart));
  EXPECT_TRUE(watch.alive(1, false, 3s, kStart + 1h));
  EXPECT_TRUE(watch.alive(1, true, 3s, kStart + 1h));
  EXPECT_FALSE(watch.alive(1, true, 3s, kStart + 1h + 20s)) << "as ever with the default deadline";
}
}  // namespace binpick::daemon
