#include "bench/scenes/lines.hpp"

#include <filesystem>
#include <fstream>
#include <gtest/gtest.h>

#include "bench/scenes/run_file.hpp"

namespace binpick::bench {
namespace {
namespace fs = std::filesystem;

SceneLine a_scene(std::uint64_t number) {
  SceneLine line;
  line.scanner = "lps36";
  line.part = "box_section";
  line.split = "tune";
  line.number = number;
  line.pile = 3;
  line.fill = 0.75;
  line.time_ms = 41.5;
  TruthLine truth;
  truth.T_supply_object.translation() = Eigen::Vector3d{1, -2, 3.25};
  truth.T_supply_object.linear() = Eigen::AngleAxisd{0.7, Eigen::Vector3d{1, 2, 3}.normalized()}.toRotationMatrix();
  truth.visible = 0.6;
  truth.told = false;
  line.truths = {truth};
  DetectionLine detection;
  detection.T_supply_object = truth.T_supply_object;
  detection.score = 0.93;
  for (int r = 0; r < 6; ++r)
    for (int c = 0; c < 6; ++c) detection.covariance(r, c) = (r + 1) * (c + 1);
  line.detections = {detection};
  vision::Evidence evidence;
  evidence[vision::Clue::Edges] = 0.25F;
  line.rejected = {{Eigen::Isometry3d::Identity(), 0.2, 12.5, evidence, "free space seen through it"}};
  line.first = FirstLine{12.5, 7, true};
  line.alive = {{"votes", {0.25}}, {"sparse test", {0.5}}};
  line.stages_ms["votes"] = 3.5;
  line.memory_mib["peak"] = 120.5;
  return line;
}

class Folder : public testing::Test {
 protected:
  Folder() : path_{fs::path{testing::TempDir()} / "binpick_lines"} {
    fs::remove_all(path_);
    fs::create_directories(path_);
  }
  ~Folder() override { fs::remove_all(path_); }
  void write(const std::string& name, const std::string& text) const { std::ofstream{path_ / name} << text; }
  std::string folder() const { return path_.string(); }

 private:
  fs::path path_;
};

TEST_F(Folder, LinesComeBackAsTheyWere) {
  const RunHeader header{"abc", {{"threads", "2"}}};
  write("a.jsonl", to_json(header) + "\n" + to_json(a_scene(4)) + "\n");
  const RunFolder run = read_run(folder());
  ASSERT_TRUE(run.header);
  EXPECT_EQ(*run.header, header);
  ASSERT_EQ(run.scenes.size(), 1U);
  const SceneLine expected = a_scene(4), &line = run.scenes.begin()->second;
  EXPECT_EQ(line.key(), expected.key());
  EXPECT_EQ(line.pile, 3U);
  EXPECT_EQ(line.fill, 0.75);
  ASSERT_EQ(line.truths.size(), 1U);
  EXPECT_TRUE(line.truths[0].T_supply_object.isApprox(expected.truths[0].T_supply_object, 1e-9));
  EXPECT_FALSE(line.truths[0].told);
  ASSERT_EQ(line.detections.size(), 1U);
  EXPECT_EQ(line.detections[0].covariance, expected.detections[0].covariance);
  EXPECT_EQ(line.rejected[0].reason, "free space seen through it");
  EXPECT_EQ(line.rejected[0].nearest_mm, 12.5);
  EXPECT_EQ(line.rejected[0].evidence[vision::Clue::Edges], 0.25F);
  ASSERT_TRUE(line.first);
  EXPECT_EQ(line.first->hypotheses, 7U);
  EXPECT_TRUE(line.first->right);
  EXPECT_EQ(line.alive, expected.alive);
  EXPECT_EQ(line.stages_ms, expected.stages_ms);
  EXPECT_EQ(line.memory_mib, expected.memory_mib);
}

TEST_F(Folder, ShardsMergeAndWhatWasCutShortIsLeftOut) {
  const std::string header = to_json(RunHeader{"abc", {}}) + "\n", whole = to_json(a_scene(1));
  write("0of2.jsonl", header + to_json(a_scene(0)) + "\n" + whole.substr(0, whole.size() / 2));
  write("1of2.jsonl", header + whole + "\n\n" + header + to_json(a_scene(3)) + "\n");
  EXPECT_EQ(read_run(folder()).scenes.size(), 3U);
}

TEST_F(Folder, RunsOfTwoCommitsDoNotMix) {
  write("0of2.jsonl", to_json(RunHeader{"abc", {}}) + "\n");
  write("1of2.jsonl", to_json(RunHeader{"abd", {}}) + "\n");
  try {
    read_run(folder());
    FAIL() << "merged";
  } catch (const std::runtime_error& e) {
    EXPECT_NE(std::string{e.what()}.find("1of2.jsonl:1: made as"), std::string::npos) << e.what();
  }
}

TEST_F(Folder, ARunGoesOnWhereItWasStopped) {
  const RunHeader header{"abc", {}};
  RunFile{folder() + "/new", header, "tune-0of2"}.write(a_scene(4));
  const RunFile other{folder() + "/new", header, "tune-1of2"};
  EXPECT_TRUE(other.has(a_scene(4)));
  EXPECT_FALSE(other.has(a_scene(5)));
  EXPECT_EQ(read_run(folder() + "/new").scenes.size(), 1U);
}

TEST_F(Folder, ARunMadeOtherwiseIsNotGoneOnWith) {
  RunFile{folder(), {"abc", {}}, "a"};
  EXPECT_THROW((RunFile{folder(), {"abc", {{"threads", "1"}}}, "b"}), std::runtime_error);
}

TEST_F(Folder, NothingThereIsAnEmptyRun) { EXPECT_FALSE(read_run(folder() + "/none").header); }
}  // namespace
}  // namespace binpick::bench
