#include <cstdio>
#include <gtest/gtest.h>
#include <numbers>

#include "tests/support/cell_file.hpp"
#include "tests/support/emulated_cell.hpp"
#include "tests/support/known_block.hpp"
#include "tests/support/scenes.hpp"

/// A known block on the floor, scanned through the whole chain: do its planes lie where they are?
namespace binpick::support {
namespace {
BlockErrors measure(const char* pivot, double speed_deg_s, double latency_ms) {
  CellFile file;
  file.pivot = pivot;
  file.sweep_speed_deg_s = speed_deg_s;
  file.scanner_latency_ms = latency_ms;
  EmulatedCell cell{test_folder().load(file), scene_with_block(), 9};
  EXPECT_TRUE(cell.run_until_ready());
  EXPECT_TRUE(cell.pick().has_value());
  return errors_of_block(cell.last_image());
}
}  // namespace

// The emulated device sends a line when its mirror's turn is over; its middle was half a turn before.
constexpr double kRightLatency_ms = 0.5e3 / 360;

TEST(Registration, PlanesOfAKnownBlockAreRightAtTwoSpeedsAndWrongWithAWrongLatency) {
  std::printf("%-22s %-14s %-14s %s\n", "sweep", "floor, mm", "block top, mm", "block's middle, mm");
  for (const double speed_deg_s : {12.0, 34.0}) {
    const BlockErrors good = measure("powercube", speed_deg_s, kRightLatency_ms);
    std::printf("%2.0f deg/s                %-14.2f %-14.2f %.2f\n", speed_deg_s, good.floor_mm, good.top_mm,
                good.centre_mm);
    EXPECT_LT(good.floor_mm, 1.0);
    EXPECT_LT(good.top_mm, 1.0);
    EXPECT_LT(good.centre_mm, 1.5);
    const BlockErrors late = measure("powercube", speed_deg_s, kRightLatency_ms + 20);
    std::printf("%2.0f deg/s, 20 ms wrong   %-14.2f %-14.2f %.2f\n", speed_deg_s, late.floor_mm, late.top_mm,
                late.centre_mm);
    // 20 ms at this speed, seen from 1.76 m above the block's top.
    const double expected_mm = 0.020 * speed_deg_s * std::numbers::pi / 180 * 1700;
    EXPECT_NEAR(late.centre_mm, expected_mm, 0.25 * expected_mm);
    // A module of the other protocol is as good.
    const BlockErrors motion = measure("motion", speed_deg_s, kRightLatency_ms);
    std::printf("%2.0f deg/s, Motion Prot.  %-14.2f %-14.2f %.2f\n", speed_deg_s, motion.floor_mm, motion.top_mm,
                motion.centre_mm);
    EXPECT_LT(motion.floor_mm, 1.0);
    EXPECT_LT(motion.top_mm, 1.0);
    EXPECT_LT(motion.centre_mm, 1.5);
  }
}
}  // namespace binpick::support
