#include "bench/production/fault_figures.hpp"

#include <gtest/gtest.h>

namespace binpick::bench {
namespace {
RequestRecord request(std::uint64_t bin, int number, const std::string& answer, int left = 5) {
  RequestRecord r;
  r.bin = bin;
  r.request = number;
  r.answer = answer;
  r.left_before = left;
  return r;
}
RequestRecord faulted(RequestRecord r, const std::string& device, const std::string& phase, double recovered_s) {
  r.fault = FaultRecord{device, "silent", phase, true, 2, "100", recovered_s, false};
  return r;
}
RequestRecord wrong(RequestRecord r, const std::string& cause = "") {
  r.wrong = true;
  r.cause = cause;
  r.error_mm = 8;
  return r;
}

FaultFigures of(const std::vector<RequestRecord>& requests) {
  return fault_figures_of({"shaft"}, {{"", requests, {}}});
}

TEST(FaultFigures, CountFaultsByDeviceAndPhase) {
  RequestRecord never = faulted(request(1, 5, "pick"), "robot", "picking", 0);
  never.fault->reached = false;
  const FaultFigures f = of({faulted(request(1, 0, "alarm 100"), "pivot", "sweeping", 1), request(1, 1, "pick"),
                             faulted(request(1, 2, "pick"), "pivot", "sweeping", 3),
                             faulted(request(1, 3, "pick"), "plc", "ready", 2), request(1, 4, "empty", 0), never});
  EXPECT_EQ(f.faults, 3);
  EXPECT_EQ(f.not_reached, 1);
  EXPECT_EQ(f.injected.at("pivot").at(2), 2);
  EXPECT_EQ(f.injected.at("plc").at(0), 1);
  EXPECT_FALSE(f.injected.contains("robot"));
  EXPECT_EQ(f.answers.at("pick"), 2);
  EXPECT_EQ(f.answers.at("alarm 100"), 1);
  EXPECT_DOUBLE_EQ(f.recovered_s.p50, 2);
  EXPECT_DOUBLE_EQ(f.recovered_max_s, 3);
  EXPECT_EQ(f.available, 5);
  EXPECT_EQ(f.asked_again, 1) << "the alarm, and then the pick";
  EXPECT_TRUE(f.meets_must());
}

TEST(FaultFigures, AWrongPoseAtAFaultOrRightAfterItIsTheFaultsUnlessTheSceneMakesItToo) {
  const auto fault = faulted(request(1, 0, "alarm 100"), "pivot", "sweeping", 1);
  EXPECT_EQ(of({fault, wrong(request(1, 1, "pick"), "fault")}).wrong_from_fault(), 1);
  EXPECT_EQ(of({fault, wrong(request(1, 1, "pick"), "scene")}).wrong_from_fault(), 0);
  EXPECT_EQ(of({fault, wrong(request(1, 1, "pick"), "scene")}).wrong.size(), 1U) << "but it is told";
  EXPECT_EQ(of({wrong(faulted(request(1, 0, "pick"), "plc", "ready", 1), "fault")}).wrong_from_fault(), 1);
  const FaultFigures two_later = of({fault, request(1, 1, "pick"), wrong(request(1, 2, "pick"))});
  EXPECT_EQ(two_later.wrong.size(), 0U);
  EXPECT_EQ(two_later.others, 1);
  EXPECT_EQ(two_later.others_wrong, 1);
  EXPECT_EQ(of({fault, wrong(request(2, 0, "pick"))}).wrong.size(), 0U) << "another bin, another cell";
}

TEST(FaultFigures, WhereTheGripperClosedCountsThoughThePlcReadNothing) {
  RequestRecord r = faulted(request(1, 0, "no answer"), "plc", "result pending", 1);
  r.closed_wrong = true;
  r.cause = "fault";
  EXPECT_EQ(of({r}).wrong_from_fault(), 1);
}

TEST(FaultFigures, EmptyThatIsNotIsWrongToo) {
  RequestRecord r = faulted(request(1, 0, "empty", 4), "scanner", "sweeping", 1);
  r.cause = "fault";
  const FaultFigures f = of({r});
  EXPECT_FALSE(f.meets_must());
  EXPECT_EQ(f.available, 0);
  EXPECT_NE(to_table(f).find("\"empty\" with objects left"), std::string::npos);
}

TEST(FaultFigures, ALostHandshakeIsNamedAndMissesTheMust) {
  RequestRecord r = faulted(request(3, 7, "no answer"), "plc", "detecting", 60);
  r.fault->handshake_lost = true;
  const FaultFigures f = of({r});
  EXPECT_FALSE(f.meets_must());
  const std::string table = to_table(f);
  EXPECT_NE(table.find("handshake lost: shaft, bin 3, request 7: plc silent for 2.00 s while detecting"),
            std::string::npos)
      << table;
  EXPECT_NE(table.find("| lost handshakes | 1 | 0 | MISSED |"), std::string::npos) << table;
}
}  // namespace
}  // namespace binpick::bench
