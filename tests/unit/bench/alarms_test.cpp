#include <gtest/gtest.h>
#include <set>

#include "bench/scenes/alarm_scenes.hpp"

namespace binpick::bench {
namespace {
TEST(Alarms, TheWantedPartIsNotThereAndEachHasItsTurn) {
  for (const ClassSetting& setting : class_settings()) {
    std::map<std::string, std::set<std::string>> beside;  // other parts, by the wanted one
    std::array<std::size_t, kAlarmKinds.size()> kinds{};
    for (std::size_t number = 0; number < 120; ++number) {
      const AlarmScene alarm = alarm_scene(setting, "alarms-report", number);
      EXPECT_NE(alarm.there.body.name, alarm.wanted) << number;
      ++kinds[alarm.kind];
      if (alarm.kind == 0) beside[alarm.wanted].insert(alarm.there.body.name);
    }
    for (const std::size_t kind : kinds) EXPECT_EQ(kind, 40U);
    const std::size_t parts = part_names(setting.scanner).size();
    EXPECT_EQ(beside.size(), parts);
    for (const auto& [wanted, others] : beside) EXPECT_EQ(others.size(), parts - 1) << wanted;
  }
}

TEST(Alarms, WhatTheScoreIsTunedOnIsNotWhatItIsJudgedBy) {
  const ClassSetting& setting = class_settings()[0];
  std::set<std::uint64_t> noises;
  for (const char* split : {"alarms-tune", "alarms-report"})
    for (std::size_t number = 0; number < 60; ++number) {
      const AlarmScene alarm = alarm_scene(setting, split, number);
      EXPECT_EQ(alarm.id.pile / 1000, std::string{split} == "alarms-tune" ? 8U : 9U);
      EXPECT_TRUE(noises.insert(alarm.id.noise).second) << "the same scene twice";
    }
}

TEST(Alarms, AreDetectionsAboveOneHalf) {
  RunFolder run;
  SceneLine line;
  line.scanner = "lps36";
  line.part = "nozzle";
  line.split = "alarms-tune";
  line.number = 5;  // foreign bodies
  for (const double score : {0.3, 0.5, 0.6, 0.8}) {
    line.detections.emplace_back().score = score;
  }
  run.scenes[line.key()] = line;
  line.number = 2;
  line.detections.clear();
  run.scenes[line.key()] = line;
  const AlarmCounts counts = alarm_counts(run, "alarms-tune");
  const AlarmCount& foreign = counts.at("lps36").at("nozzle")[2];
  EXPECT_EQ(foreign.scenes, 2);
  EXPECT_EQ(foreign.scenes_with, 1);
  EXPECT_EQ(foreign.detections, 2);
  EXPECT_EQ(foreign.highest, 0.8);
  EXPECT_TRUE(alarm_counts(run, "alarms-report").empty());
}
}  // namespace
}  // namespace binpick::bench
