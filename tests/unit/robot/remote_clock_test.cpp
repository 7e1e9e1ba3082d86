#include "drivers/robot/remote_clock.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <gtest/gtest.h>
#include <limits>
#include <random>

namespace binpick::drivers::robot {
namespace {
using namespace std::chrono_literals;
using Reading = RemoteClock::Reading;
constexpr TimePoint kStart = TimePoint{} + 1000h;
constexpr double kOffset_s = 0.037;

/// A sender with a clock of its own and a network that keeps the order of its messages.
struct Sender {
  double drift_ppm = 0;
  double least_delay_s = 0.0002, most_delay_s = 0.005;
  double burst_every_s = 0, burst_s = 0;  ///< Nothing gets through for burst_s, then all at once. 0: never.
  std::mt19937_64 random{1};
  TimePoint last_arrival{};

  double stamp(double true_s) const { return 4711.25 + (true_s + kOffset_s) * (1 + 1e-6 * drift_ppm); }
  TimePoint arrival(double true_s) {
    std::uniform_real_distribution<double> delay_s{least_delay_s, most_delay_s};
    double at_s = true_s + delay_s(random);
    if (burst_every_s > 0) {
      const double in_period_s = std::fmod(true_s, burst_every_s);
      if (in_period_s < burst_s) at_s += burst_s - in_period_s;
    }
    last_arrival = std::max(last_arrival, kStart + from_s(at_s));
    return last_arrival;
  }
};

/// Error of at() for the newest stamp, network delay included, in ms.
double error_ms(const RemoteClock& clock, const Sender& sender, double true_s) {
  return in_ms(clock.at(sender.stamp(true_s)) - (kStart + from_s(true_s)));
}

struct Case {
  const char* name;
  double rate_hz, drift_ppm, burst_every_s, burst_s;
};
class EightHours : public testing::TestWithParam<Case> {};
INSTANTIATE_TEST_SUITE_P(Senders, EightHours,
                         testing::Values(Case{"500Hz_fast", 500, 50, 0, 0}, Case{"125Hz_slow", 125, -50, 0, 0},
                                         Case{"100Hz_bursts", 100, 50, 20, 0.3}, Case{"20Hz_fast", 20, 50, 0, 0},
                                         Case{"20Hz_slow_bursts", 20, -50, 7, 0.5}),
                         [](const auto& each) { return each.param.name; });

TEST_P(EightHours, TimesStayWithinHalfAMillisecond) {
  const Case& c = GetParam();
  Sender sender{.drift_ppm = c.drift_ppm, .burst_every_s = c.burst_every_s, .burst_s = c.burst_s};
  RemoteClock clock;
  double worst_ms = 0, worst_last_hour_ms = 0, worst_early_ms = 0;
  const auto steps = static_cast<std::int64_t>(8 * 3600 * c.rate_hz);
  for (std::int64_t k = 0; k <= steps; ++k) {
    const double true_s = static_cast<double>(k) / c.rate_hz;
    const TimePoint arrival = sender.arrival(true_s);
    ASSERT_EQ(clock.add(sender.stamp(true_s), arrival), Reading::Good) << true_s;
    ASSERT_LE(clock.at(sender.stamp(true_s)), arrival + 1us);
    if (!clock.settled()) continue;
    const double error = std::abs(error_ms(clock, sender, true_s));
    if (true_s < 60)
      worst_early_ms = std::max(worst_early_ms, error);
    else
      worst_ms = std::max(worst_ms, error);
    if (true_s > 7 * 3600) worst_last_hour_ms = std::max(worst_last_hour_ms, error);
  }
  std::printf("  %s: worst error %.3f ms (first minute %.3f, last hour %.3f), drift %.2f ppm, uncertainty %.3f ms\n",
              c.name, worst_ms, worst_early_ms, worst_last_hour_ms, clock.drift_ppm(), in_ms(*clock.uncertainty()));
  EXPECT_LT(worst_ms, 0.5) << "of which 0.2 ms are the least delay, which cannot be seen";
  EXPECT_LT(worst_early_ms, 1.5);
  EXPECT_NEAR(clock.drift_ppm(), c.drift_ppm, 3);
  EXPECT_LT(*clock.uncertainty(), 1ms);
}
}  // namespace

TEST(RemoteClock, SettlesWithinSixSeconds) {
  RemoteClock clock;
  Sender sender{.drift_ppm = 50};
  double settled_s = 0;
  for (int k = 0; k < 1000 && !clock.settled(); ++k) {
    settled_s = 0.02 * k;
    clock.add(sender.stamp(settled_s), sender.arrival(settled_s));
  }
  EXPECT_TRUE(clock.settled());
  EXPECT_LT(settled_s, 6.5);
  EXPECT_GT(settled_s, 4.5);
}

TEST(RemoteClock, ARestartOfTheSenderBeginsAnew) {
  RemoteClock clock;
  Sender sender;
  for (int k = 0; k < 1000; ++k) clock.add(sender.stamp(0.01 * k), sender.arrival(0.01 * k));
  ASSERT_TRUE(clock.settled());
  EXPECT_EQ(clock.add(0.5, kStart + 12s), Reading::Jumped);
  EXPECT_FALSE(clock.settled());
  EXPECT_FALSE(clock.uncertainty().has_value());
  EXPECT_EQ(clock.at(0.5), kStart + 12s);
  EXPECT_EQ(clock.add(0.51, kStart + 12s + 10ms), Reading::Good);
}

TEST(RemoteClock, AJumpAheadIsFoundAtOnceWhenSettled) {
  RemoteClock clock;
  Sender sender;
  for (int k = 0; k < 1000; ++k) clock.add(sender.stamp(0.01 * k), sender.arrival(0.01 * k));
  EXPECT_EQ(clock.add(sender.stamp(10 + 0.05), sender.arrival(10)), Reading::Jumped) << "50 ms before it was sent";
}

TEST(RemoteClock, AJumpBackThatGoesOnIsFoundWithinSeconds) {
  RemoteClock clock;
  Sender sender;
  for (int k = 0; k < 1000; ++k) clock.add(sender.stamp(0.01 * k), sender.arrival(0.01 * k));
  int jumped_at = 0;
  for (int k = 1000; k < 3000 && jumped_at == 0; ++k)  // the clock rested for 0.4 s: its stamps still go up
    if (k > 1040 && clock.add(sender.stamp(0.01 * k - 0.4), sender.arrival(0.01 * k)) == Reading::Jumped) jumped_at = k;
  EXPECT_GT(jumped_at, 1500) << "might have been a burst of delay";
  EXPECT_LT(jumped_at, 2200);
}

TEST(RemoteClock, StandingStampsAreToldOnce) {
  RemoteClock clock;
  EXPECT_EQ(clock.add(7, kStart), Reading::Good);
  int told = 0;
  for (int k = 1; k < 200; ++k) {
    const Reading reading = clock.add(7, kStart + k * 10ms);
    EXPECT_TRUE(reading == Reading::Repeated || reading == Reading::Stopped);
    if (reading == Reading::Stopped) {
      ++told;
      EXPECT_EQ(k, 50);
    }
  }
  EXPECT_EQ(told, 1);
}

TEST(RemoteClock, AFirstMessageThatIsVeryLateDoesNoHarm) {
  RemoteClock clock;
  Sender sender;
  EXPECT_EQ(clock.add(sender.stamp(0), kStart + 900ms), Reading::Good);
  for (int k = 1; k < 1000; ++k)
    ASSERT_EQ(clock.add(sender.stamp(0.01 * k), std::max(kStart + 900ms, sender.arrival(0.01 * k))), Reading::Good);
  EXPECT_LT(std::abs(error_ms(clock, sender, 9.99)), 1.0);
}

TEST(RemoteClock, AfterASilenceOfMinutesItLearnsAnewWithoutComplaint) {
  RemoteClock clock;
  Sender sender{.drift_ppm = 50};
  for (int k = 0; k < 1000; ++k) clock.add(sender.stamp(0.01 * k), sender.arrival(0.01 * k));
  EXPECT_EQ(clock.add(sender.stamp(4000), sender.arrival(4000)), Reading::Good);
  EXPECT_FALSE(clock.settled());
}

TEST(RemoteClock, AShorterSilenceChangesNothing) {
  RemoteClock clock;
  Sender sender{.drift_ppm = 50};
  for (int k = 0; k < 6000; ++k) clock.add(sender.stamp(0.01 * k), sender.arrival(0.01 * k));
  EXPECT_EQ(clock.add(sender.stamp(160), sender.arrival(160)), Reading::Good);
  EXPECT_TRUE(clock.settled());
  EXPECT_LT(std::abs(error_ms(clock, sender, 160)), 1.0);
}

TEST(RemoteClock, ALateMessageAfterAPauseIsNoJump) {
  RemoteClock clock;
  Sender sender;
  for (int k = 0; k < 1000; ++k) clock.add(sender.stamp(0.01 * k), sender.arrival(0.01 * k));
  EXPECT_EQ(clock.add(sender.stamp(40), kStart + 40s + 300ms), Reading::Good) << "held back while the link came up";
  EXPECT_TRUE(clock.settled());
  EXPECT_LT(std::abs(error_ms(clock, sender, 40)), 1.0);
}

TEST(RemoteClock, StampsThatAreNoNumbersTeachNothing) {
  RemoteClock clock;
  EXPECT_EQ(clock.add(std::numeric_limits<double>::quiet_NaN(), kStart), Reading::Jumped);
  clock.add(1, kStart);
  EXPECT_EQ(clock.add(std::numeric_limits<double>::infinity(), kStart + 1ms), Reading::Repeated);
  EXPECT_EQ(clock.at(1), kStart);
}
}  // namespace binpick::drivers::robot
