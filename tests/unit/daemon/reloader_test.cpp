#include "daemon/reloader.hpp"

#include <future>
#include <gtest/gtest.h>
#include <stdexcept>

namespace binpick::daemon {
namespace {
using Loaded = Reloader::Loaded;
}

TEST(Reloader, WhatItWakesTheLoopForIsThere) {
  std::promise<bool> there;
  Reloader* reloader_seen = nullptr;
  Reloader reloader{[] { return Loaded{std::make_shared<const CellData>()}; },
                    [&] { there.set_value(reloader_seen->take().has_value()); }};
  reloader_seen = &reloader;
  reloader.start();
  EXPECT_TRUE(there.get_future().get()) << "a loop that finds nothing sleeps on until its next deadline";
  EXPECT_FALSE(reloader.pending());
}

TEST(Reloader, AFailureOfTheSystemIsAFindingAndNotTheEnd) {
  std::promise<void> woken;
  Reloader reloader{[]() -> Loaded { throw std::runtime_error("disk on fire"); }, [&] { woken.set_value(); }};
  reloader.start();
  woken.get_future().get();
  const auto loaded = reloader.take();
  ASSERT_TRUE(loaded.has_value());
  ASSERT_FALSE(loaded->has_value());
  EXPECT_EQ(loaded->error(), std::vector<std::string>{"disk on fire"});
}

TEST(Reloader, AStormOfReloadsIsReadOnceMore) {
  std::promise<void> may_go;
  std::shared_future<void> go = may_go.get_future();
  std::promise<void> woken[2];
  int loads = 0, wakes = 0;
  Reloader reloader{[&, go] {
                      go.get();
                      ++loads;
                      return Loaded{std::make_shared<const CellData>()};
                    },
                    [&] { woken[wakes++].set_value(); }};
  for (int i = 0; i < 100; ++i) reloader.start();
  EXPECT_TRUE(reloader.pending());
  EXPECT_FALSE(reloader.take().has_value());
  may_go.set_value();
  woken[0].get_future().get();
  EXPECT_TRUE(reloader.take().has_value());
  EXPECT_TRUE(reloader.pending()) << "edited while it was read";
  woken[1].get_future().get();
  EXPECT_TRUE(reloader.take().has_value());
  EXPECT_FALSE(reloader.pending());
  EXPECT_EQ(loads, 2);
}
}  // namespace binpick::daemon
