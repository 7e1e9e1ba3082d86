#include "daemon/mailbox.hpp"

#include <chrono>
#include <gtest/gtest.h>
#include <memory>
#include <thread>

namespace binpick::daemon {
TEST(Mailbox, IsBoundedAndKeepsOrder) {
  Mailbox<std::unique_ptr<int>> box{2};
  EXPECT_TRUE(box.try_push(std::make_unique<int>(1)));
  EXPECT_TRUE(box.try_push(std::make_unique<int>(2)));
  auto third = std::make_unique<int>(3);
  EXPECT_FALSE(box.try_push(std::move(third)));
  ASSERT_NE(third, nullptr) << "a refused value stays with the caller";
  EXPECT_EQ(**box.try_pop(), 1);
  EXPECT_EQ(**box.try_pop(), 2);
  EXPECT_FALSE(box.try_pop().has_value());
}

TEST(Mailbox, ClosingWakesWhoeverWaits) {
  Mailbox<int> box{1};
  std::optional<int> got = 7;
  {
    const std::jthread reader{[&] { got = box.pop_for(std::chrono::hours(1)); }};
    box.close();
  }
  EXPECT_FALSE(got.has_value());
  EXPECT_FALSE(box.try_push(1));
}

TEST(Mailbox, CarriesValuesBetweenThreads) {
  Mailbox<int> box{8};
  long sum = 0;
  {
    const std::jthread reader{[&] {
      for (int n = 0; n < 1000;)
        if (const auto value = box.pop_for(std::chrono::seconds(5))) sum += *value, ++n;
    }};
    for (int n = 0; n < 1000;)
      if (box.try_push(int{n})) ++n;
  }
  EXPECT_EQ(sum, 999L * 1000 / 2);
}
}  // namespace binpick::daemon
