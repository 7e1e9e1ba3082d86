#include <cmath>
#include <gtest/gtest.h>
#include <string>

#include "base/log.hpp"
#include "drivers/pivot/codec.hpp"
#include "drivers/pivot/state_word.hpp"
#include "tests/unit/pivot/bench.hpp"

namespace binpick::drivers::pivot {
namespace {
using namespace std::chrono_literals;
using State = Session::State;
using emulators::PivotOptions;

TEST(PivotSession, IsIdentifiedReferencedAndReady) {
  Bench bench;
  EXPECT_EQ(bench.session.state(), State::Identifying);
  ASSERT_TRUE(bench.run_until_state(State::Referencing, 100ms));
  ASSERT_TRUE(bench.run_until_state(State::Standing, 5s));
  ASSERT_EQ(bench.count<Ready>(), 1);
  EXPECT_EQ(bench.count<Failed>(), 0);
  const ModuleInfo& info = std::get<Ready>(bench.events.back()).module;
  EXPECT_EQ(info.firmware, 0x3518);
  EXPECT_EQ(info.serial, 12345678U);
  EXPECT_NEAR(info.position_max.in_deg(), 160, 1e-4);
  EXPECT_NEAR(info.velocity_max_rad_s, 2.6, 1e-6);
  EXPECT_NEAR(bench.module.angle_at(bench.now).in_deg(), 0, 0.01);
}

TEST(PivotSession, DoesNotReferenceAModuleThatIs) {
  PivotOptions options;
  options.referenced = true;
  Bench bench{options};
  ASSERT_TRUE(bench.run_until_state(State::Standing, 100ms));
  EXPECT_EQ(bench.module.reference_runs(), 0U);
  EXPECT_NEAR(bench.module.angle_at(bench.now).in_deg(), 25, 1e-9);
}

PivotOptions referenced() {
  PivotOptions options;
  options.referenced = true;
  options.start = Angle::deg(0);
  return options;
}

TEST(PivotSession, MovesToATargetAndStandsThere) {
  Bench bench{referenced()};
  ASSERT_TRUE(bench.run_until_state(State::Standing, 100ms));
  bench.session.move_to(Angle::deg(-20), 0.6, bench.now);
  ASSERT_TRUE(bench.run_until([&] { return bench.count<MoveDone>() == 1; }, 3s));
  EXPECT_EQ(bench.session.state(), State::Standing);
  EXPECT_NEAR(bench.module.angle_at(bench.now).in_deg(), -20, 0.05);
  EXPECT_FALSE(bench.module.moving(bench.now));
  EXPECT_EQ(bench.count<Failed>(), 0);
}
}  // namespace
}  // namespace binpick::drivers::pivot
