#include "bench/production/fault_plan.hpp"

#include <gtest/gtest.h>
#include <map>
#include <set>
#include <utility>

namespace binpick::bench {
namespace {
using support::CyclePhase;
using Pair = std::pair<std::string, CyclePhase>;

TEST(FaultPlan, NothingGoesWrongWithoutOne) {
  for (std::uint64_t request = 0; request < 200; ++request) EXPECT_FALSE(FaultPlan{}.at(request));
}

TEST(FaultPlan, EveryFiftiethRequestHasOne) {
  const FaultPlan plan{50, 1, 0};
  for (std::uint64_t request = 0; request < 500; ++request)
    EXPECT_EQ(plan.at(request).has_value(), request % 50 == 49) << request;
}

TEST(FaultPlan, EachDeviceAndPhaseComesUpInEveryTwentyFour) {
  for (const std::uint64_t seed : {1, 2, 77}) {
    std::set<Pair> met;
    for (std::uint64_t k = 0; k < 24; ++k) {
      const auto fault = FaultPlan{10, seed, 2}.at(10 * k + 9);
      met.emplace(fault->device, fault->phase);
      EXPECT_GE(fault->lasts_s, 0.05);
      EXPECT_LE(fault->lasts_s, 8);
      EXPECT_GE(std::min(fault->where, fault->which), 0);
      EXPECT_LT(std::max(fault->where, fault->which), 1);
    }
    EXPECT_EQ(met.size(), kFaultDevices.size() * support::kCyclePhases.size());
  }
}

TEST(FaultPlan, FourPartsShareThem) {
  std::map<Pair, int> met;
  for (std::size_t part = 0; part < 4; ++part)
    for (std::uint64_t k = 0; k < 6; ++k) {
      const auto fault = FaultPlan{50, 1, part}.at(50 * k + 49);
      ++met[{fault->device, fault->phase}];
    }
  EXPECT_EQ(met.size(), 24U);
}

TEST(FaultPlan, TheSeedDecides) {
  const auto text = [](std::uint64_t seed) {
    std::string all;
    for (std::uint64_t k = 0; k < 12; ++k) {
      const auto fault = FaultPlan{50, seed, 1}.at(50 * k + 49);
      all += fault->device + to_text(fault->phase) + std::to_string(fault->which) + std::to_string(fault->where) +
             std::to_string(fault->lasts_s);
    }
    return all;
  };
  EXPECT_EQ(text(1), text(1));
  EXPECT_NE(text(1), text(2));
}
}  // namespace
}  // namespace binpick::bench
