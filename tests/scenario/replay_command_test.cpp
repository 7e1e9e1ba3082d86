#include <CLI/CLI.hpp>
#include <algorithm>
#include <filesystem>
#include <fstream>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>
#include <sstream>

#include "daemon/cycle/record_codec.hpp"
#include "daemon/cycle/replay.hpp"
#include "tests/support/cell_file.hpp"
#include "tests/support/emulated_cell.hpp"
#include "tests/support/scenes.hpp"
#include "tools/commands.hpp"
#include "vision/file.hpp"

/// binpick replay, as it is typed.
namespace binpick::support {
namespace {
namespace fs = std::filesystem;

struct Answer {
  int exit_status = 0;
  std::string out, err;
};
Answer replay(std::vector<std::string> words) {
  CLI::App app;
  Answer answer;
  tools::add_replay(app, answer.exit_status);
  words.insert(words.begin(), "replay");
  std::ranges::reverse(words);  // CLI11 takes them from the back
  testing::internal::CaptureStdout();
  testing::internal::CaptureStderr();
  app.parse(words);
  answer.out = testing::internal::GetCapturedStdout();
  answer.err = testing::internal::GetCapturedStderr();
  return answer;
}

daemon::Record recorded_cycle() {
  CellFile file = coarse_cell();
  file.record_dir = "records";
  EmulatedCell cell{test_folder().load(file), scene_of("track_link", 3, 2)};
  EXPECT_TRUE(cell.run_until_ready() && cell.pick().has_value());
  return cell.cell().take_record().value();
}

/// One cycle is enough for all of it.
class ReplayCommand : public testing::Test {
 protected:
  void SetUp() override {
    static const daemon::Record kRecorded = recorded_cycle();
    record = kRecorded;
    ASSERT_TRUE(record.result.has_value());
    ASSERT_FALSE(record.result->choice.reachable.empty());
  }
  static std::string path(const std::string& name) { return test_folder().path() + "/" + name; }
  static std::string save(const std::string& name, const daemon::Record& record) {
    EXPECT_TRUE(vision::write_file(path(name), daemon::encode(record)).has_value());
    return path(name);
  }
  static nlohmann::json json_of(const std::string& text) { return nlohmann::json::parse(text, nullptr, false); }

  daemon::Record record;
};
}  // namespace

TEST_F(ReplayCommand, TheSameCycleIsIdentical) {
  const Answer answer = replay({save("same.bpr", record)});
  EXPECT_EQ(answer.exit_status, 0) << answer.err;
  EXPECT_TRUE(answer.out.starts_with(path("same.bpr") + ": cycle 1 of start 1: identical: 3 found, ")) << answer.out;
  EXPECT_EQ(std::ranges::count(answer.out, '\n'), 1) << answer.out;
}

TEST_F(ReplayCommand, AnotherPartFileTellsThenAndNow) {
  // The same part and grasps, but jaws as wide as the box: they fit nowhere.
  const auto& file = record.cell.parts.front();
  std::string text = file.text;
  const auto replace = [&](const std::string& from, const std::string& to) {
    const auto at = text.find(from);
    ASSERT_NE(at, std::string::npos) << from;
    text.replace(at, from.size(), to);
  };
  replace("mesh = \"", "mesh = \"" + fs::path{file.path}.parent_path().string() + "/");
  replace("jaw_size_mm = [7, 14,", "jaw_size_mm = [7, 914,");
  std::ofstream{path("thick.toml")} << text;
  const std::string bpr = save("part.bpr", record);
  const Answer answer = replay({bpr, "--part", path("thick.toml"), "--json", path("part.json")});
  EXPECT_EQ(answer.exit_status, 0) << "a difference is what was asked for: " << answer.err;
  EXPECT_NE(answer.out.find(": differs: 3 found, 0 reachable"), std::string::npos) << answer.out;
  EXPECT_NE(
      answer.out.find("\n  reachable: " + std::to_string(record.result->choice.reachable.size()) + " then, 0 now\n"),
      std::string::npos)
      << answer.out;
  std::stringstream written;
  written << std::ifstream{path("part.json")}.rdbuf();
  const auto json = json_of(written.str());
  ASSERT_TRUE(json.is_array() && json.size() == 1) << written.str();
  EXPECT_FALSE(json[0]["identical"]);
  EXPECT_TRUE(json[0]["reachable"].empty());
  ASSERT_EQ(json[0]["unreachable"].size(), 3U);
  EXPECT_FALSE(json[0]["unreachable"][0]["reason"].get<std::string>().empty());

  const Answer wrong = replay({bpr, "--part", path("part.json")});
  EXPECT_EQ(wrong.exit_status, 1);
  EXPECT_NE(wrong.err.find("is not a good part file"), std::string::npos) << wrong.err;
}

TEST_F(ReplayCommand, JsonOnStdoutIsAllThatIsPrinted) {
  std::ofstream{path("none.bpr")} << "no record";
  const Answer answer = replay({save("json.bpr", record), path("none.bpr"), "--json", "-"});
  EXPECT_EQ(answer.exit_status, 0) << answer.err;
  EXPECT_EQ(answer.err, "binpick replay: skipped: " + path("none.bpr") + " is no record of binpick\n");
  const auto json = json_of(answer.out);
  ASSERT_TRUE(json.is_array() && json.size() == 2) << answer.out;
  EXPECT_EQ(json[0]["part"], "track_link");
  EXPECT_EQ(json[0]["cycle"], 1);
  EXPECT_TRUE(json[0]["identical"]);
  EXPECT_TRUE(json[0]["differences"].empty());
  EXPECT_EQ(json[0]["detections"].size(), 3U);
  const auto& best = json[0]["reachable"][0];
  const auto& then = record.result->choice.reachable.front();
  EXPECT_EQ(best["detection"], then.detection);
  EXPECT_EQ(best["T_supply_grasp"][2][3], then.T_supply_grasp.iso.translation().z());
  EXPECT_TRUE(json[1].contains("skipped"));
}

TEST_F(ReplayCommand, APictureOfTheCycle) {
  const std::string bpr = save("image.bpr", record);
  const Answer answer = replay({bpr, "--image", path("found.png")});
  EXPECT_EQ(answer.exit_status, 0) << answer.err;
  std::ifstream png{path("found.png"), std::ios::binary};
  std::string head(8, '\0');
  png.read(head.data(), 8);
  EXPECT_EQ(head.substr(1, 3), "PNG");
  // One of several records would overwrite the other's, and a name that cannot be drawn to is told.
  const Answer several = replay({bpr, bpr, "--image", path("found.png")});
  EXPECT_EQ(several.exit_status, 2);
  EXPECT_EQ(several.err, "binpick replay: --image is of one record; name one\n");
  const Answer nowhere = replay({bpr, "--image", "/nowhere/found.png"});
  EXPECT_EQ(nowhere.exit_status, 1);
  EXPECT_NE(nowhere.err.find("there is no folder /nowhere"), std::string::npos) << nowhere.err;
  const Answer no_picture = replay({bpr, "--image", path("found.txt")});
  EXPECT_EQ(no_picture.exit_status, 1);
  EXPECT_NE(no_picture.err.find("give a name that ends in .png"), std::string::npos) << no_picture.err;
}

TEST_F(ReplayCommand, WhatTheDeadlineCutShortIsNotCalledDifferent) {
  // The same scan with hardly any time.
  auto replayed = daemon::replay(record, {});
  ASSERT_TRUE(replayed.has_value()) << replayed.error();
  auto hurried = std::make_shared<daemon::CellData>(*replayed->request.cell);
  hurried->config.detection.deadline = std::chrono::milliseconds(1);
  replayed->request.cell = hurried;
  daemon::Record cut = record;
  cut.result = daemon::run_detection(replayed->request);
  ASSERT_TRUE(cut.result->report.cut_short);
  ASSERT_FALSE(daemon::differences(*cut.result, *record.result).empty());
  const Answer answer = replay({save("cut.bpr", cut), save("whole.bpr", record)});
  EXPECT_EQ(answer.exit_status, 0) << answer.out;
  EXPECT_NE(answer.out.find("/cut.bpr: cycle 1 of start 1: cut short by its deadline then, with more time: 3 found, "),
            std::string::npos)
      << answer.out;
  EXPECT_NE(answer.out.find("\n2 records: 1 identical, 0 differ, 0 skipped, 1 cut short by their deadline then\n"),
            std::string::npos)
      << answer.out;

  // A result that differs without such a reason does.
  daemon::Record other = record;
  other.result->report.detections.pop_back();
  const Answer differs = replay({save("other.bpr", other)});
  EXPECT_EQ(differs.exit_status, 1);
  EXPECT_NE(differs.out.find(": differs: 3 found, "), std::string::npos) << differs.out;
  EXPECT_NE(differs.out.find("\n  detection: 2 then, 3 now\n"), std::string::npos) << differs.out;
}

TEST_F(ReplayCommand, ACycleWithoutAResultHasACountOfItsOwn) {
  daemon::Record failed = record;
  failed.result.reset();
  const Answer answer = replay({save("failed.bpr", failed), save("fine.bpr", record)});
  EXPECT_EQ(answer.exit_status, 0) << answer.err;
  EXPECT_NE(answer.out.find("failed.bpr: cycle 1 of start 1: ended without a result then: 3 found"), std::string::npos)
      << answer.out;
  EXPECT_NE(answer.out.find("\n2 records: 1 identical, 0 differ, 0 skipped, 1 without a result then\n"),
            std::string::npos)
      << answer.out;
}
}  // namespace binpick::support
