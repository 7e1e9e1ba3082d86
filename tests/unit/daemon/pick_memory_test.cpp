#include "daemon/pick_memory.hpp"

#include <gtest/gtest.h>

namespace binpick::daemon {
namespace {
using namespace std::chrono_literals;
constexpr PickMemory::Place kPlace{1, 7};
constexpr TimePoint kScanned{100s};

/// Objects of 20 × 20 mm in a row, at these x; the best first.
DetectResult scan_of(std::initializer_list<double> xs) {
  DetectResult result;
  result.part_width_mm = 20;
  for (const double x : xs) {
    vision::Detection detection;
    detection.score = 0.9;
    result.choice.reachable.push_back({.detection = result.report.detections.size(),
                                       .T_supply_grasp = {},
                                       .T_supply_approach = {},
                                       .T_supply_retreat = {}});
    result.report.detections.push_back(detection);
    result.centres_mm.emplace_back(x, 0, 10);
    result.footprints.push_back({{{x - 10, -10}, {x + 10, -10}, {x + 10, 10}, {x - 10, 10}}});
  }
  return result;
}

struct PickMemoryTest : testing::Test {
  PickMemory memory;
  config::Picks options{.per_scan = 3, .scan_valid = 60s, .margin_mm = 5, .failed_scans = 4};
  std::uint16_t id = 100;

  void scan(std::initializer_list<double> xs) { memory.keep(kPlace, scan_of(xs), kScanned); }
  std::optional<std::size_t> pick(TimePoint now = kScanned) {
    const auto next = memory.next(kPlace, options, now);
    if (!next) return std::nullopt;
    memory.answered(kPlace, *next, ++id, options);
    return next->reachable;
  }
  void fail() { memory.on_report(id, false, options); }
  void done() { memory.on_report(id, true, options); }
};
}  // namespace

TEST_F(PickMemoryTest, OneScanGivesWhatStandsApart) {
  scan({0, 22, 100, 50});  // the second touches the first's margin
  EXPECT_EQ(memory.next(kPlace, options, kScanned)->left, 3);
  EXPECT_EQ(pick(), 0);
  done();
  EXPECT_EQ(memory.next(kPlace, options, kScanned)->left, 2);
  EXPECT_EQ(pick(), 2);
  EXPECT_EQ(pick(), 3) << "also while the robot is on its way";
  EXPECT_EQ(pick(), std::nullopt);
}

TEST_F(PickMemoryTest, WhatTouchesANeighbourOfAPickedOneMayHaveMoved) {
  scan({0, 44, 22, 100});  // 0, 22 and 44 stand in a row
  EXPECT_EQ(pick(), 0);
  EXPECT_EQ(pick(), 3);
  EXPECT_EQ(pick(), std::nullopt);
}

TEST_F(PickMemoryTest, WhatLiesOnSomethingMovesWithIt) {
  scan({0, 75, 22, 37, 52, 110});  // 22 touches the picked one, 37 and 52 lie on it and on each other, 75 beside them
  EXPECT_EQ(pick(), 0);
  EXPECT_EQ(pick(), 5);
  EXPECT_EQ(pick(), std::nullopt);
}

TEST_F(PickMemoryTest, NoMoreThanItIsAllowed) {
  options.per_scan = 1;
  scan({0, 100});
  EXPECT_EQ(pick(), 0);
  EXPECT_EQ(pick(), std::nullopt);
  options.per_scan = 2;
  EXPECT_EQ(pick(kScanned + 61s), std::nullopt) << "too old";
  EXPECT_EQ(pick(kScanned + 60s), 1);
}

TEST_F(PickMemoryTest, OfThatSupplyAndPartOnly) {
  scan({0, 100});
  pick();
  EXPECT_FALSE(memory.next({1, 8}, options, kScanned));
  EXPECT_FALSE(memory.next({2, 7}, options, kScanned));
  memory.forget(2);
  EXPECT_TRUE(memory.next(kPlace, options, kScanned));
  memory.forget(1);
  EXPECT_FALSE(memory.next(kPlace, options, kScanned));
}

TEST_F(PickMemoryTest, AFailedPickEndsItsScanAndComesLastInTheNext) {
  scan({0, 100, 200});
  pick();
  fail();
  EXPECT_EQ(pick(), std::nullopt);
  scan({3, 100, 200});  // pushed a little
  EXPECT_EQ(pick(), 1);
  done();
  EXPECT_EQ(pick(), 2);
  done();
  EXPECT_EQ(pick(), std::nullopt) << "a second try wants a new scan";
  scan({3});
  const auto again = memory.next(kPlace, options, kScanned);
  ASSERT_TRUE(again);
  EXPECT_TRUE(again->again);
}

TEST_F(PickMemoryTest, WhatFailedTwiceIsLeftAloneUntilItIsForgotten) {
  scan({0});
  pick();
  fail();
  scan({0});
  EXPECT_EQ(pick(), 0);
  fail();
  for (int scans = 0; scans < options.failed_scans; ++scans) {
    scan({0, 100});
    EXPECT_EQ(memory.passed_over(kPlace).size(), 1);
    EXPECT_EQ(pick(), 1);
    done();
  }
  scan({0});
  EXPECT_EQ(pick(), 0);
}

TEST_F(PickMemoryTest, WhatAnotherOneMayLieOnIsTriedAgainOnlyByAnotherGrasp) {
  for (const bool aslant : {false, true}) {
    memory = {};
    DetectResult result = scan_of({0});
    result.choice.reachable[0].covered_mm = aslant ? 0 : 1;
    result.choice.reachable[0].is_aslant = aslant;
    memory.keep(kPlace, result, kScanned);
    EXPECT_EQ(pick(), 0);
    fail();
    memory.keep(kPlace, result, kScanned);
    EXPECT_EQ(pick(), std::nullopt);
    result.choice.reachable[0].other = vision::Reachable::Other{};
    memory.keep(kPlace, result, kScanned);
    const auto again = memory.next(kPlace, options, kScanned);
    ASSERT_TRUE(again);
    EXPECT_TRUE(again->again && again->other);
    DetectResult elsewhere = result;
    elsewhere.choice.reachable[0].other.reset();
    elsewhere.choice.reachable[0].T_supply_grasp.iso.translation().x() += 20;
    memory.keep(kPlace, elsewhere, kScanned);
    const auto by_first = memory.next(kPlace, options, kScanned);
    ASSERT_TRUE(by_first) << "it is another grasp already";
    EXPECT_TRUE(by_first->again && !by_first->other);
    result.choice.reachable[0].covered_mm = 0;
    result.choice.reachable[0].is_aslant = false;
    result.choice.reachable[0].other.reset();
    memory.keep(kPlace, result, kScanned);
    EXPECT_EQ(pick(), 0) << "nothing may lie on it any more";
  }
}

TEST_F(PickMemoryTest, DoubtfulSecondTriesAreTheLast) {
  scan({0, 100});
  EXPECT_EQ(pick(), 0);
  fail();
  scan({0, 100});
  EXPECT_EQ(pick(), 1);
  fail();
  DetectResult result = scan_of({0, 100});
  result.choice.reachable[0].covered_mm = 1;
  result.choice.reachable[0].other = vision::Reachable::Other{};
  memory.keep(kPlace, result, kScanned);
  EXPECT_EQ(pick(), 1);
  fail();
  memory.keep(kPlace, result, kScanned);
  EXPECT_EQ(pick(), 0);
}

TEST_F(PickMemoryTest, ASecondTryGoesAnotherWay) {
  DetectResult result = scan_of({0});
  vision::Reachable& only = result.choice.reachable[0];
  only.other = vision::Reachable::Other{1, {}, {}, {}};
  only.other->T_supply_grasp.iso.translation().x() = 30;
  memory.keep(kPlace, result, kScanned);
  EXPECT_FALSE(memory.next(kPlace, options, kScanned)->other);
  pick();
  fail();
  memory.keep(kPlace, result, kScanned);
  EXPECT_TRUE(memory.next(kPlace, options, kScanned)->other);
  // The best one is another one this time.
  only.T_supply_grasp.iso.translation().y() = 12;
  memory.keep(kPlace, result, kScanned);
  EXPECT_FALSE(memory.next(kPlace, options, kScanned)->other);
  // There is no other one.
  only.T_supply_grasp = {};
  only.other.reset();
  memory.keep(kPlace, result, kScanned);
  EXPECT_FALSE(memory.next(kPlace, options, kScanned)->other);
  EXPECT_TRUE(memory.next(kPlace, options, kScanned)->again);
}

TEST_F(PickMemoryTest, WithoutMemoryTheSameOneIsTriedAgainAndAgain) {
  options.failed_scans = 0;
  for (int round = 0; round < 5; ++round) {
    scan({0, 100});
    EXPECT_EQ(pick(), 0);
    fail();
  }
}

TEST_F(PickMemoryTest, AReportOfAnotherPickSaysNothingOfThisOne) {
  scan({0, 100});
  pick();
  memory.on_report(5, true, options);
  EXPECT_EQ(pick(), 1);
  memory.on_report(5, false, options);
  EXPECT_EQ(pick(), std::nullopt) << "something was pushed somewhere";
  scan({0, 100});
  EXPECT_EQ(pick(), 0) << "and nobody knows of which object";
}
}  // namespace binpick::daemon
