#include "bench/scenes/comparison.hpp"

#include <gtest/gtest.h>

namespace binpick::bench {
namespace {
void add(RunFolder& run, const std::string& detector, std::uint64_t number, const std::string& split = "tune") {
  SceneLine line;
  line.detector = detector;
  line.scanner = "lps36hi";
  line.part = "nozzle";
  line.split = split;
  line.number = number;
  line.pile = number;
  line.truths.push_back({Eigen::Isometry3d::Identity(), 1, true});
  run.scenes.emplace(line.key(), line);
}

TEST(Comparison, OnlyScenesThatAllSawAreCompared) {
  RunFolder run;
  for (const std::uint64_t n : {0, 1, 2}) add(run, "votes", n);
  for (const std::uint64_t n : {1, 2, 3}) add(run, "exhaustive", n);
  add(run, "opencv", 1);
  const RunFolder common = seen_by_all(run, {"votes", "exhaustive"});
  EXPECT_EQ(common.scenes.size(), 4U);
  for (const auto& [key, scene] : common.scenes) EXPECT_TRUE(scene.number == 1 || scene.number == 2) << key;
}

TEST(Comparison, ScenesWithoutThePartAreNoSceneToFindItIn) {
  RunFolder run;
  add(run, "binpick", 0);
  add(run, "binpick", 0, "alarms-tune");
  const auto classes = collected(run, "binpick");
  ASSERT_EQ(classes.size(), 1U);
  ASSERT_EQ(classes[0].parts.size(), 1U);
  EXPECT_EQ(classes[0].parts[0].scenes, 1U);
  EXPECT_EQ(of_split(run, "alarms-tune").scenes.size(), 1U);
}

TEST(Comparison, TheDeepSupplyIsAClassOfItsOwn) {
  RunFolder run;
  for (const char* part : {"track_link", "track_link_deep"}) {
    SceneLine line;
    line.scanner = "lms400";
    line.part = part;
    run.scenes.emplace(line.key(), line);
  }
  const auto classes = collected(run, "binpick");
  ASSERT_EQ(classes.size(), 2U);
  EXPECT_EQ(classes[0].name, "lms400");
  EXPECT_EQ(classes[1].parts[0].name, "track_link_deep");
}

TEST(Comparison, ADifferenceIsTakenDrawByDraw) {
  const Estimate d = difference({0.9, {0.8, 1.0}}, {0.7, {0.6, 0.8}});
  EXPECT_NEAR(d.value, 0.2, 1e-12);
  EXPECT_NEAR(d.interval().high - d.interval().low, 0, 1e-12) << "both fell with the same piles";
  EXPECT_EQ(with_interval({0.5, {}}, "%.2f"), "0.50");
  EXPECT_EQ(with_interval({0.5, {0.25, 0.25}}, "%.2f"), "0.50 [0.25, 0.25]");
}
}  // namespace
}  // namespace binpick::bench
