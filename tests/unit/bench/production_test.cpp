#include <cstdio>
#include <filesystem>
#include <fstream>
#include <gtest/gtest.h>
#include <unistd.h>

#include "bench/production/figures.hpp"
#include "bench/production/records.hpp"

namespace binpick::bench {
namespace {
RequestRecord pick(std::uint64_t bin, int request, const std::string& grip, bool wrong = false) {
  RequestRecord r;
  r.bin = bin;
  r.request = request;
  r.answer = "pick";
  r.left_before = 3;
  r.grip = grip;
  r.wrong = wrong;
  r.error_mm = 1 + request;
  r.detection_ms = 100;
  r.first_ms = request == 0 ? 50 : 200;
  r.first_hypotheses = request == 0 ? 10 : 300;
  r.hypotheses = 1000;
  r.scan_s = 3;
  r.robot_s = 4;
  return r;
}
RequestRecord answer(std::uint64_t bin, int request, const std::string& what, int left) {
  RequestRecord r;
  r.bin = bin;
  r.request = request;
  r.answer = what;
  r.left_before = left;
  return r;
}
BinRecord bin(std::uint64_t number, int left, int takeable, const std::string& end) {
  return {number, 4, left, takeable, end, 6};
}

class Records : public testing::Test {
 protected:
  Records() : path_{testing::TempDir() + "production-" + std::to_string(::getpid()) + ".jsonl"} {}
  ~Records() override { std::filesystem::remove(path_); }
  std::string path_;
};

TEST_F(Records, AreReadAsTheyWereWritten) {
  EXPECT_TRUE(read_part_run(path_, "{\"seed\":1}").bins.empty()) << "no file yet";
  write_part_run(path_, {"{\"seed\":1}", {}, {}});
  RequestRecord failed = pick(1, 1, "collision", true);
  failed.why = "the jaw reaches 2.0 mm into \"object\" 3";
  failed.retry = true;
  append_bin(path_, {pick(1, 0, "taken"), failed, answer(1, 2, "empty", 0)}, bin(1, 0, 0, "empty"));
  RequestRecord left = answer(2, 1, "not_reachable", 3);
  left.why = "something lies on it, 7.8 mm wide";
  append_bin(path_, {pick(2, 0, "taken"), left}, bin(2, 3, 1, "not_reachable"));
  const PartRun run = read_part_run(path_, "{\"seed\":1}");
  ASSERT_EQ(run.requests.size(), 5U);
  EXPECT_EQ(run.requests[4].why, left.why);
  ASSERT_EQ(run.bins.size(), 2U);
  EXPECT_EQ(run.picks(), 3);
  EXPECT_EQ(to_json(run.requests[1]), to_json(failed));
  EXPECT_EQ(to_json(run.requests[2]), to_json(answer(1, 2, "empty", 0)));
  EXPECT_EQ(run.bins[1].takeable, 1);
  EXPECT_EQ(run.bins[1].end, "not_reachable");
}

TEST_F(Records, TellOfFaultsAndOfWhereTheSupplyStood) {
  write_part_run(path_, {"{}", {}, {}});
  RequestRecord faulted = answer(1, 0, "alarm 100", 4);
  faulted.fault = FaultRecord{"pivot", "pulled", "sweeping", true, 2.5, "100 101", 0.75, true};
  faulted.closed_wrong = true;
  faulted.cause = "fault";
  RequestRecord located = pick(1, 1, "taken");
  located.place_mm = 1.25;
  located.place_deg = 0.125;
  append_bin(path_, {faulted, located}, bin(1, 0, 0, "empty"));
  const PartRun run = read_part_run(path_, "{}");
  ASSERT_EQ(run.requests.size(), 2U);
  ASSERT_TRUE(run.requests[0].fault);
  EXPECT_EQ(run.requests[0].fault->phase, "sweeping");
  EXPECT_TRUE(run.requests[0].fault->handshake_lost);
  EXPECT_EQ(to_json(run.requests[0]), to_json(faulted));
  EXPECT_FALSE(run.requests[1].fault);
  EXPECT_EQ(to_json(run.requests[1]), to_json(located));
  const ProductionFigures f = figures_of("all", {run}, {1, 1, 1, 5});
  EXPECT_DOUBLE_EQ(f.place_mm.p50, 1.25);
}

TEST_F(Records, ABinThatWasCutOffIsRunAgain) {
  write_part_run(path_, {"{}", {}, {}});
  append_bin(path_, {pick(1, 0, "taken")}, bin(1, 0, 0, "empty"));
  {
    std::ofstream out{path_, std::ios::app};
    out << to_json(pick(2, 0, "taken")) << '\n' << to_json(pick(2, 1, "taken")).substr(0, 20);
  }
  PartRun run = read_part_run(path_, "{}");
  EXPECT_EQ(run.bins.size(), 1U);
  EXPECT_EQ(run.picks(), 1) << "nothing of the second bin";
  write_part_run(path_, run);
  append_bin(path_, {pick(2, 0, "missed")}, bin(2, 0, 0, "empty"));
  run = read_part_run(path_, "{}");
  ASSERT_EQ(run.picks(), 2);
  EXPECT_EQ(run.requests[1].grip, "missed");
}

TEST_F(Records, RunsThatWereMadeOtherwiseDoNotMix) {
  write_part_run(path_, {"{\"seed\":1}", {}, {}});
  EXPECT_THROW(read_part_run(path_, "{\"seed\":2}"), std::runtime_error);
}

TEST(ProductionFigures, CountWhatTheRecordsSay) {
  PartRun run;
  run.requests = {pick(1, 0, "taken"),
                  pick(1, 1, "collision", true),
                  answer(1, 2, "empty", 0),
                  pick(2, 0, "missed"),
                  answer(2, 1, "empty", 2),
                  answer(3, 0, "not_reachable", 1),
                  answer(4, 0, "not_reachable", 1),
                  answer(5, 0, "alarm 203", 4)};
  run.requests[1].scanned = false;
  run.bins = {bin(1, 0, 0, "empty"), bin(2, 2, 2, "empty"), bin(3, 1, 0, "not_reachable"),
              bin(4, 1, 1, "not_reachable")};
  const ProductionFigures f = figures_of("all", {run}, {1, 1, 1, 5});
  EXPECT_EQ(f.picks, 3);
  EXPECT_EQ(f.requests, 8);
  EXPECT_EQ(f.taken, 1);
  EXPECT_EQ(f.missed, 1);
  EXPECT_EQ(f.collisions, 1);
  EXPECT_EQ(f.wrong, 1);
  EXPECT_EQ(f.scans, 7);
  EXPECT_EQ(f.available, 4) << "three picks and one true empty";
  EXPECT_EQ(f.truly_unreachable, 1);
  EXPECT_NEAR(f.left_percent(), 100.0 * 4 / 16, 1e-9);
  EXPECT_NEAR(f.cpu_s_per_pick(), 8, 1e-9);
  EXPECT_NEAR(f.cycle_s.p50, 9, 1e-9) << "the sweep of 3 s hides behind the 5 s of placing";
  EXPECT_NEAR(f.cycle_without_overlap_s.p50, 12, 1e-9);
}

TEST(ProductionFigures, DemandsLookInTheirDirection) {
  ProductionFigures f;
  f.picks = f.requests = 1000;
  f.objects = 1000;
  f.taken = 980;
  f.wrong = 3;
  f.collisions = 11;
  f.left = 30;
  f.available = 1000;
  f.cpu_s = 500;
  const auto asked = demands(f);
  ASSERT_EQ(asked.size(), 6U);
  const bool must[] = {true, true, false, true, true, true}, aim[] = {false, true, false, false, true, true};
  for (std::size_t i = 0; i < 6; ++i) {
    EXPECT_EQ(asked[i].meets_must(), must[i]) << asked[i].what;
    EXPECT_EQ(asked[i].meets_aim(), aim[i]) << asked[i].what;
  }
  const std::string table = to_table({f}, f);
  EXPECT_NE(table.find("| right picks % | 98.00 | >= 97 | 99 | must reached |"), std::string::npos) << table;
  EXPECT_NE(table.find("| collisions % | 1.10 | <= 1 | 0.3 | MISSED |"), std::string::npos) << table;
}

TEST(ProductionFigures, SpreadOfNothingIsNothing) {
  EXPECT_EQ(spread({}).p95, 0);
  EXPECT_EQ(spread({3, 1, 2}).p50, 2);
  EXPECT_EQ(spread({3, 1, 2}).p95, 3);
}
}  // namespace
}  // namespace binpick::bench
