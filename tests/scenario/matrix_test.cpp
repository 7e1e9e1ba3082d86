#include <algorithm>
#include <array>
#include <gtest/gtest.h>
#include <set>
#include <string>
#include <vector>

#include "tests/emulators/program/scan_paths.hpp"
#include "tests/support/cell_file.hpp"
#include "tests/support/emulated_cell.hpp"
#include "tests/support/scenes.hpp"

/// Every device of the trade's cells in every combination: each one whole pick, from the PLC's request to the robot's
/// report, in virtual time.
namespace binpick::support {
namespace {
using emulators::kLinearPath;
using emulators::kPanPath;
struct Combination {
  const char* scanner;
  std::uint16_t scan_path;  ///< 0: on the pivot; else the robot carries it.
  const char* word_order;   ///< The make of PLC: s7 or logix.
  const char* plc_role;     ///< Of the daemon.
  const char* robot;
};

struct Tolerance {
  double mm, deg;
};
Tolerance tolerance_of(const Combination& c) {
  return std::string{c.scanner} == "lms400" ? Tolerance{5, 3} : Tolerance{1, 1.5};
}

CellFile file_of(const Combination& c) {
  CellFile file;
  file.scanner = c.scanner;
  file.scan_path = c.scan_path;
  file.word_order = c.word_order;
  file.plc_role = c.plc_role;
  file.robot = c.robot;
  file.parts = {file.scanner == "lms400" ? "track_link" : "contact_bridge"};
  return file;
}

emulators::World scene_for(const Combination& c) {
  return std::string{c.scanner} == "lms400" ? scene_of("track_link", 4, 11)
                                            : scene_of("contact_bridge", 6, 11, kSmallBox_mm);
}

struct Matrix : testing::TestWithParam<Combination> {};
}  // namespace

TEST_P(Matrix, OneWholePick) {
  EmulatedCell cell{test_folder().load(file_of(GetParam())), scene_for(GetParam()), 11};
  std::optional<drivers::robot::Pick> grasped;
  cell.robot.on_grasp = [&](const drivers::robot::Pick& pick) {
    grasped = pick;
    return true;
  };
  ASSERT_TRUE(cell.run_until_ready());
  const auto result = cell.pick();
  ASSERT_TRUE(result.has_value());
  ASSERT_EQ(result->code, plc::ResultCode::PickFound);
  ASSERT_TRUE(cell.run_until([&] { return cell.robot.picks_done() == 1; }));
  ASSERT_TRUE(grasped.has_value());
  EXPECT_EQ(grasped->pick_id, result->pick_id);
  EXPECT_LT((grasped->T_base_grasp.iso.translation() - result->T_base_grasp.iso.translation()).norm(), 0.01);

  const auto& seen = cell.results().back();
  const auto& chosen = seen.report.detections[seen.choice.reachable.front().detection];
  const auto error = error_to_nearest(cell.world, cell.cell().data().knowledge_bases.front(), chosen.T_supply_object);
  const Tolerance tolerance = tolerance_of(GetParam());
  EXPECT_LT(error.centroid_mm, tolerance.mm);
  EXPECT_LT(Angle::rad(error.angle_rad).in_deg(), tolerance.deg);
  RecordProperty("error_mm", std::to_string(error.centroid_mm));
  RecordProperty("error_deg", std::to_string(Angle::rad(error.angle_rad).in_deg()));
}

namespace {
std::vector<Combination> all() {
  std::vector<Combination> combinations;
  for (const char* scanner : {"lms400", "lps36"})
    for (const std::uint16_t path : {std::uint16_t{0}, kLinearPath, kPanPath})
      for (const char* robot : {"ur", "fanuc", "kawasaki"})
        for (const char* word_order : {"s7", "logix"})
          for (const char* role : {"server", "client"})
            combinations.push_back({scanner, path, word_order, role, robot});
  return combinations;
}

/// Every value of each axis beside every value of each other one.
std::set<std::string> pairs_of(const Combination& c) {
  const std::array<std::string, 5> values{c.scanner, std::to_string(c.scan_path), c.word_order, c.plc_role, c.robot};
  std::set<std::string> pairs;
  for (std::size_t i = 0; i < values.size(); ++i)
    for (std::size_t k = 0; k < i; ++k) pairs.insert(values[k] + " " + values[i]);
  return pairs;
}

/// As few of all as show every pair, or nearly: the one with the most new pairs first. For a run under the sanitizers.
std::vector<Combination> pairwise() {
  std::set<std::string> shown;
  std::vector<Combination> chosen;
  const auto news = [&](const Combination& c) {
    return std::ranges::count_if(pairs_of(c), [&](const std::string& pair) { return !shown.contains(pair); });
  };
  for (;;) {
    const auto combinations = all();
    const auto best = std::ranges::max_element(combinations, {}, news);
    if (news(*best) == 0) return chosen;
    shown.merge(pairs_of(*best));
    chosen.push_back(*best);
  }
}

std::string name_of(const testing::TestParamInfo<Combination>& one) {
  const Combination& c = one.param;
  const char* carrier = c.scan_path == 0 ? "pivot" : c.scan_path == kLinearPath ? "linear" : "pan";
  return std::string{c.scanner} + "_" + carrier + "_" + c.robot + "_" + c.word_order + "_" + c.plc_role;
}
}  // namespace

TEST(MatrixSubset, IsSmallAndShowsEveryPair) {
  std::set<std::string> of_all, of_subset;
  for (const Combination& c : all()) of_all.merge(pairs_of(c));
  for (const Combination& c : pairwise()) of_subset.merge(pairs_of(c));
  EXPECT_EQ(of_all, of_subset);
  EXPECT_EQ(all().size(), 72U);
  EXPECT_LE(pairwise().size(), 12U);
}

INSTANTIATE_TEST_SUITE_P(All, Matrix, testing::ValuesIn(all()), name_of);
INSTANTIATE_TEST_SUITE_P(Pairwise, Matrix, testing::ValuesIn(pairwise()), name_of);
}  // namespace binpick::support
