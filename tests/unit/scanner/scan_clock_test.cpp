#include "drivers/scanner/scan_clock.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <gtest/gtest.h>
#include <random>
#include <vector>

namespace binpick::drivers::scanner {
namespace {
using namespace std::chrono_literals;
constexpr TimePoint kStart = TimePoint{} + 1000s;

/// How late telegrams come, order kept. What all of them have in common cannot be told from the measuring device's side
/// and counts as latency: the clock is judged against the smallest delay of the run.
struct Link {
  const char* name;
  double jitter_ms;     ///< Telegrams late each by itself: 0 … this;
  double jittered;      ///< this share of them.
  double wake_ms;       ///< The receiver looks up after 0 … this, again and again; what came meanwhile comes at once.
  double burst_ms;      ///< Or regularly every so often. 0: at once.
  double period_error;  ///< True period against the nominal one.
};
class Jitter : public testing::TestWithParam<Link> {};
INSTANTIATE_TEST_SUITE_P(
    Links, Jitter,
    testing::Values(Link{"clean", 0, 1, 0, 0, 0}, Link{"jitter5", 5, 1, 0, 0, 0}, Link{"jitter20", 20, 0.5, 0, 0, 0},
                    Link{"wakes20", 0, 1, 20, 0, 0}, Link{"wakes20_fast_motor", 0, 1, 20, 0, -5e-4},
                    Link{"wakes20_slow_motor", 0, 1, 20, 0, 5e-4}, Link{"bursts20", 0, 1, 0, 20, 0},
                    Link{"bursts20_slow_motor", 0, 1, 0, 20, 5e-4}, Link{"all_at_once", 15, 0.2, 5, 0, 2e-4}),
    [](const auto& each) { return each.param.name; });

TEST_P(Jitter, TimesAreWithinAMillisecondAfterHalfASecond) {
  const Link& link = GetParam();
  for (const std::uint64_t seed : {1U, 2U, 3U, 4U, 5U}) {
    std::mt19937_64 random{seed};
    std::uniform_real_distribution<double> to_one{0, 1};
    const double nominal_s = 1 / 360.0;
    ScanClock clock{from_s(nominal_s)};
    double previous_s = 0, wake_s = 0, least_delay_ms = 1e9;
    std::vector<double> errors_ms;
    for (int k = 0; k < 360 * 20; ++k) {
      const double true_s = k * nominal_s * (1 + link.period_error);
      const double late_s = to_one(random) < link.jittered ? link.jitter_ms * 1e-3 * to_one(random) : 0;
      double arrival_s = std::max(previous_s, true_s + late_s);
      if (link.burst_ms > 0) arrival_s = std::ceil(arrival_s / (link.burst_ms * 1e-3)) * link.burst_ms * 1e-3;
      if (link.wake_ms > 0) {
        while (wake_s < arrival_s) wake_s += link.wake_ms * 1e-3 * to_one(random);
        arrival_s = wake_s;
      }
      previous_s = arrival_s;
      const TimePoint received = kStart + from_s(arrival_s);
      const auto reading = clock.on_scan(static_cast<std::uint16_t>(60000 + k), received);
      EXPECT_LE(reading.measured_at, received);
      EXPECT_EQ(reading.lost, 0U);
      EXPECT_FALSE(reading.counter_jumped);
      if (true_s < 0.5) continue;
      least_delay_ms = std::min(least_delay_ms, (arrival_s - true_s) * 1e3);
      errors_ms.push_back(in_ms(reading.measured_at - (kStart + from_s(true_s))));
    }
    double worst_ms = 0;
    for (const double e : errors_ms) worst_ms = std::max(worst_ms, std::abs(e - least_delay_ms));
    EXPECT_LT(worst_ms, 1.0) << "seed " << seed;
    std::printf("  %s seed %u: least delay %.2f ms, worst error %.2f ms\n", link.name, static_cast<unsigned>(seed),
                least_delay_ms, worst_ms);
  }
}

TEST(ScanClock, CountsLostScansAcrossTheWrap) {
  ScanClock clock{from_s(0.0025)};
  EXPECT_EQ(clock.on_scan(65533, kStart).lost, 0U);
  EXPECT_EQ(clock.on_scan(65534, kStart + 2500us).lost, 0U);
  EXPECT_EQ(clock.on_scan(1, kStart + 10000us).lost, 2U) << "65535 and 0 are missing";
  EXPECT_EQ(clock.on_scan(2, kStart + 12500us).lost, 0U);
}

TEST(ScanClock, LossesDoNotDisturbTheTimes) {
  std::mt19937_64 random{7};
  ScanClock clock{from_s(0.002)};
  for (int k = 0; k < 5000; ++k) {
    if (random() % 3 == 0) continue;
    const TimePoint at = kStart + k * 2ms;
    const auto reading = clock.on_scan(static_cast<std::uint16_t>(k), at);
    EXPECT_LT(std::abs(in_ms(reading.measured_at - at)), 1e-3);
  }
}

TEST(ScanClock, BeginsAnewWhenTheCounterJumps) {
  ScanClock clock{from_s(0.0025)};
  for (int k = 0; k < 400; ++k) clock.on_scan(static_cast<std::uint16_t>(k), kStart + k * 2500us);
  const TimePoint at = kStart + 400 * 2500us;
  const auto reading = clock.on_scan(30000, at);
  EXPECT_TRUE(reading.counter_jumped);
  EXPECT_EQ(reading.lost, 0U) << "no time has passed in which scans could have been lost";
  EXPECT_EQ(reading.measured_at, at);
  EXPECT_FALSE(clock.on_scan(30001, at + 2500us).counter_jumped);
}

TEST(ScanClock, StandingCounterIsTakenAsOneScanEach) {
  ScanClock clock{from_s(0.0025)};
  for (int k = 0; k < 2000; ++k) {
    const auto reading = clock.on_scan(5, kStart + k * 2500us);
    EXPECT_EQ(reading.lost, 0U);
    EXPECT_FALSE(reading.counter_jumped);
    EXPECT_NEAR(in_ms(reading.measured_at - (kStart + k * 2500us)), 0, 1e-3);
  }
}
}  // namespace
}  // namespace binpick::drivers::scanner
