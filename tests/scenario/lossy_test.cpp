#include <cstdio>
#include <gtest/gtest.h>
#include <map>

#include "tests/support/cell_file.hpp"
#include "tests/support/emulated_cell.hpp"
#include "tests/support/scenes.hpp"

/// An LPS 36 behind a network that loses, delays and doubles its datagrams.
namespace binpick::support {
namespace {
/// A pose beyond these of every true one is wrong.
constexpr double kWrong_mm = 3, kWrong_deg = 3;
}  // namespace

TEST(Lossy, TwoHundredPicksOverABadNetwork) {
  constexpr int kPicks = 200, kObjects = 12;
  CellFile file;
  file.scanner = "lps36";
  file.parts = {"contact_bridge"};
  const auto data = test_folder().load(file);
  std::uint64_t seed = 31;
  EmulatedCell cell{data, scene_of("contact_bridge", kObjects, seed, kSmallBox_mm), 3};
  cell.lps36.datagrams.lost = 0.10;
  cell.lps36.datagrams.late = 0.05;
  cell.lps36.datagrams.duplicated = 0.01;
  cell.lps36.datagrams.answers_lost = 0.10;
  cell.robot.on_grasp = [&](const drivers::robot::Pick& pick) { return take_nearest(cell.world, *data, pick); };
  ASSERT_TRUE(cell.run_until_ready());
  int picked = 0, wrong = 0;
  std::map<int, int> refused;  // by result code or, above 1000, by alarm
  for (int k = 0; k < kPicks; ++k) {
    if (cell.world.objects().size() < 4) cell.world = scene_of("contact_bridge", kObjects, ++seed, kSmallBox_mm);
    const auto result = cell.pick();
    if (!result) {
      ASSERT_TRUE(cell.plc.fault()) << "pick " << k << ": neither an answer nor a fault";
      ++refused[1000 + static_cast<int>(cell.plc.first_alarm())];
      cell.plc.raise_reset();
      ASSERT_TRUE(cell.run_until_ready());
      continue;
    }
    if (result->code != plc::ResultCode::PickFound) {
      ++refused[static_cast<int>(result->code)];
      continue;
    }
    const auto& seen = cell.results().back();
    const auto& chosen = seen.report.detections[seen.choice.reachable.front().detection];
    const auto error = error_to_nearest(cell.world, data->knowledge_bases.front(), chosen.T_supply_object);
    wrong += error.centroid_mm > kWrong_mm || Angle::rad(error.angle_rad).in_deg() > kWrong_deg;
    ++picked;
    const auto reported = static_cast<std::uint64_t>(picked);
    ASSERT_TRUE(cell.run_until([&] { return cell.robot.picks_done() + cell.robot.picks_failed() == reported; }));
  }
  std::printf(
      "10 %% of the datagrams lost, 5 %% late, 1 %% doubled, 10 %% of the answers lost: %d of %d picks, %d wrong poses",
      picked, kPicks, wrong);
  for (const auto& [why, times] : refused)
    std::printf(", %d refused with %s %d", times, why > 1000 ? "alarm" : "result", why % 1000);
  std::printf("\n");
  EXPECT_GE(picked, kPicks * 95 / 100);
  EXPECT_EQ(wrong, 0);
}
}  // namespace binpick::support
