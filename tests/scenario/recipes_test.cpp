#include <algorithm>
#include <cstdio>
#include <fstream>
#include <gtest/gtest.h>
#include <string>

#include "tests/support/cell_file.hpp"
#include "tests/support/emulated_cell.hpp"
#include "tests/support/scenes.hpp"

/// What the PLC may change from one request to the next: the part, and the supply.
namespace binpick::support {
namespace {
using namespace std::chrono_literals;

/// Of this process, in MiB: "RssAnon" is what it has for itself, "RssFile" what it sees of mapped files.
double memory_mib(const std::string& what) {
  std::ifstream status{"/proc/self/status"};
  for (std::string word; status >> word;)
    if (word == what + ":") {
      double kib = 0;
      status >> kib;
      return kib / 1024;
    }
  return 0;
}

double ms_of(std::vector<Duration> times, double share) {
  std::ranges::sort(times);
  return in_ms(times.at(static_cast<std::size_t>(share * static_cast<double>(times.size() - 1))));
}
}  // namespace

TEST(Recipes, ADozenAlternatedOverAHundredPicks) {
  constexpr int kRecipes = 12, kPicks = 100;
  CellFile file = coarse_cell();
  file.own_copies = true;
  file.parts.clear();
  for (int i = 0; i < kRecipes; ++i) file.parts.emplace_back(i % 2 == 0 ? "track_link" : "gear_shaft");
  const auto data = test_folder().load(file);
  EmulatedCell cell{data, empty_scene(), 5};
  ASSERT_TRUE(cell.run_until_ready());
  const emulators::World links = scene_of("track_link", 4, 11), shafts = scene_of("gear_shaft", 6, 12);
  double anon_before = 0;
  for (int k = 0; k < kPicks; ++k) {
    const auto part = static_cast<std::uint16_t>(1 + 5 * k % kRecipes);  // each another one than the one before
    const bool is_link = part % 2 == 1;
    cell.world = is_link ? links : shafts;
    const auto result = cell.pick(part);
    ASSERT_TRUE(result.has_value());
    ASSERT_EQ(result->code, plc::ResultCode::PickFound) << "pick " << k << ", part " << part;
    const auto& seen = cell.results().back();
    const auto& chosen = seen.report.detections[seen.choice.reachable.front().detection];
    const auto& base = data->knowledge_bases[part - 1U];
    EXPECT_LT(error_to_nearest(cell.world, base, chosen.T_supply_object).centroid_mm, 10) << "of the part asked for";
    ASSERT_TRUE(cell.run_until([&] { return cell.robot.picks_done() == static_cast<std::uint64_t>(k + 1); }));
    if (k == 4 * kRecipes) anon_before = memory_mib("RssAnon");
  }
  const double anon = memory_mib("RssAnon"), seen_of_files = memory_mib("RssFile");
  std::printf(
      "12 recipes, %.0f MiB of knowledge bases mapped; 100 picks, each with another recipe than the one before: taken "
      "up "
      "within %.2f ms (p50 %.3f ms); memory of the process %.1f MiB after 49 picks, %.1f MiB after 100, files %.0f "
      "MiB\n",
      data->knowledge_mib, ms_of(cell.took_up(), 1), ms_of(cell.took_up(), 0.5), anon_before, anon, seen_of_files);
  ASSERT_EQ(cell.took_up().size(), static_cast<std::size_t>(kPicks));
  EXPECT_LT(ms_of(cell.took_up(), 0.5), 5.0);
  EXPECT_LT(anon, 1.05 * anon_before + 1);
}

TEST(Recipes, TwoSuppliesInTurn) {
  CellFile file;
  file.second_supply = true;
  const auto data = test_folder().load(file);
  EmulatedCell cell{data, scene_of("track_link", 3, 21), 7};
  const emulators::World beside = scene_of("track_link", 3, 22, {600, 600, 300});
  for (const auto& object : beside.objects()) {
    Transform<frame::Supply, frame::Object> T = object.T_supply_object;
    T.iso.pretranslate(kBeside_mm);
    cell.world.add(object.part, object.mesh, T);
  }
  ASSERT_TRUE(cell.run_until_ready());
  std::uint64_t picked = 0;
  for (const int id : {1, 2, 2, 1, 2}) {
    const auto supply = static_cast<std::uint16_t>(id);
    const auto result = cell.pick(1, supply);
    ASSERT_TRUE(result.has_value());
    ASSERT_EQ(result->code, plc::ResultCode::PickFound) << "supply " << supply;
    const auto& seen = cell.results().back();
    EXPECT_GE(seen.report.detections.size(), 2U);
    const auto& chosen = seen.report.detections[seen.choice.reachable.front().detection];
    // The world is told in the first supply's frame.
    Transform<frame::Supply, frame::Object> T = chosen.T_supply_object;
    if (supply == 2) T.iso.pretranslate(kBeside_mm);
    const auto error = error_to_nearest(cell.world, data->knowledge_bases.front(), T);
    EXPECT_LT(error.centroid_mm, 5.0) << "supply " << supply;
    EXPECT_LT(Angle::rad(error.angle_rad).in_deg(), 3.0);
    const double y_mm = result->T_base_grasp.iso.translation().y();
    EXPECT_EQ(y_mm > 600, supply == 2) << y_mm;
    ++picked;
    ASSERT_TRUE(cell.run_until([&] { return cell.robot.picks_done() == picked; }));
  }
}
}  // namespace binpick::support
