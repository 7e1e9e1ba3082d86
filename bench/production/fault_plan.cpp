#include "bench/production/fault_plan.hpp"

#include <cmath>
#include <random>
#include <utility>

namespace binpick::bench {
namespace {
constexpr std::size_t kPairs = kFaultDevices.size() * support::kCyclePhases.size();
constexpr std::size_t kPartsBetween = kPairs / 4;  // where in the order the next part begins
constexpr double kShortest_s = 0.05, kLongest_s = 8;

/// 0 … 1, the same on any machine: the distributions of the standard library are not.
double share(std::mt19937_64& random) { return static_cast<double>(random() >> 11U) * 0x1p-53; }

std::array<std::size_t, kPairs> order_of(std::uint64_t seed) {
  std::array<std::size_t, kPairs> order{};
  for (std::size_t i = 0; i < kPairs; ++i) order[i] = i;
  std::mt19937_64 random{seed};
  for (std::size_t i = kPairs - 1; i > 0; --i) std::swap(order[i], order[random() % (i + 1)]);
  return order;
}
}  // namespace

std::optional<PlannedFault> FaultPlan::at(std::uint64_t request) const {
  if (every_ == 0 || (request + 1) % every_ != 0) return std::nullopt;
  const std::uint64_t number = request / every_;
  const std::size_t pair = order_of(seed_)[(part_ * kPartsBetween + number) % kPairs];
  std::mt19937_64 random{seed_ * 1'000'003 + part_ * 65'537 + number};
  PlannedFault fault;
  fault.device = kFaultDevices[pair % kFaultDevices.size()];
  fault.phase = support::kCyclePhases[pair / kFaultDevices.size()];
  fault.which = share(random);
  fault.where = share(random);
  fault.lasts_s = kShortest_s * std::pow(kLongest_s / kShortest_s, share(random));
  return fault;
}
}  // namespace binpick::bench
