#include <gtest/gtest.h>
#include <string>

#include "drivers/robot/codec.hpp"
#include "drivers/robot/session.hpp"

/// A robot that carries the scanner: what is said of a scan path, line by line.
namespace binpick::drivers::robot {
namespace {
constexpr TimePoint kStart{std::chrono::hours(1)};

class ScanPath : public testing::TestWithParam<Dialect> {
 protected:
  ScanPath() {
    session.on_connected(kStart);
    events();
  }
  Reply ask(const std::string& line) {
    session.on_bytes(as_bytes(line + "\r\n"), kStart);
    const Bytes output = session.take_output();
    const auto decoded = decode_reply(as_text(output), GetParam());
    if (!decoded || !*decoded) {
      ADD_FAILURE() << "no answer to " << line;
      return {};
    }
    return (*decoded)->reply;
  }
  Status status_of(const std::string& line) { return ask(line).status; }
  std::string events() {
    std::string text;
    while (const auto event = session.take_event()) {
      if (std::holds_alternative<PathBegun>(*event)) text += "begun ";
      if (std::holds_alternative<PathEnded>(*event)) text += "ended ";
      if (std::holds_alternative<PathBroken>(*event)) text += "broken ";
    }
    return text;
  }
  Session session{Options{.dialect = GetParam()}};
};
}  // namespace

TEST_P(ScanPath, FromTheFetchToTheEnd) {
  EXPECT_EQ(status_of("fetch"), Status::NotReady);
  session.ask_path(7, 2);
  const Reply scan = ask("fetch");
  EXPECT_EQ(scan.status, Status::Scan);
  EXPECT_EQ(scan.pick.pick_id, 7);
  EXPECT_EQ(scan.pick.part_id, 2);
  EXPECT_EQ(events(), "");
  EXPECT_EQ(status_of("begin 7"), Status::NotReady);
  EXPECT_EQ(status_of("begin 7"), Status::NotReady) << "the scanner does not measure yet";
  EXPECT_EQ(events(), "begun ") << "once";
  session.let_go();
  EXPECT_EQ(status_of("begin 7"), Status::Go);
  EXPECT_EQ(status_of("end 7"), Status::ReportTaken);
  EXPECT_EQ(events(), "ended ");
  EXPECT_EQ(status_of("end 7"), Status::ReportTaken) << "its answer was lost, say";
  EXPECT_EQ(events(), "");
  EXPECT_EQ(status_of("fetch"), Status::NotReady);
}

TEST_P(ScanPath, WhatIsNotWantedAnyMoreIsSaid) {
  EXPECT_EQ(status_of("begin 7"), Status::UnknownScan);
  session.ask_path(7, 1);
  EXPECT_EQ(status_of("begin 6"), Status::UnknownScan) << "of the scan before";
  session.forget_path();
  for (const char* line : {"begin 7", "end 7", "broken 7"}) EXPECT_EQ(status_of(line), Status::UnknownScan) << line;
  EXPECT_EQ(events(), "");
}

TEST_P(ScanPath, WhatWasSaidOfAForgottenOneDoesNotCountForTheNext) {
  session.ask_path(7, 1);
  session.let_go();
  EXPECT_EQ(status_of("begin 7"), Status::Go);
  EXPECT_EQ(status_of("end 7"), Status::ReportTaken);
  session.forget_path();  // an abort, heard before the robot's words
  session.ask_path(8, 1);
  EXPECT_EQ(events(), "");
  EXPECT_EQ(status_of("end 7"), Status::ReportTaken) << "its answer was lost, say";
  EXPECT_EQ(status_of("begin 8"), Status::NotReady);
  EXPECT_EQ(events(), "begun ");
}

TEST_P(ScanPath, BrokenOffOrEndedBeforeItWasLetGoIsNoScan) {
  session.ask_path(7, 1);
  session.let_go();
  EXPECT_EQ(status_of("begin 7"), Status::Go);
  EXPECT_EQ(status_of("broken 7"), Status::ReportTaken);
  EXPECT_EQ(events(), "begun broken ");
  session.ask_path(8, 1);
  EXPECT_EQ(status_of("end 8"), Status::ReportTaken);
  EXPECT_EQ(events(), "broken ");
}

TEST_P(ScanPath, SurvivesALostConnection) {
  session.ask_path(7, 1);
  EXPECT_EQ(status_of("begin 7"), Status::NotReady);
  session.on_disconnected(kStart);
  session.on_connected(kStart);
  session.let_go();
  EXPECT_EQ(status_of("begin 7"), Status::Go);
}

TEST_P(ScanPath, AnOfferedPickWaitsUntilTheScanIsOver) {
  Pick pick;
  pick.pick_id = 3;
  session.offer(pick);
  session.ask_path(7, 1);
  EXPECT_EQ(status_of("fetch"), Status::Scan);
  session.forget_path();
  EXPECT_EQ(status_of("fetch"), Status::Pick);
}

TEST(ScanPathLines, AreReadAndRefusedLikeTheOthers) {
  using Kind = Request::Kind;
  for (const auto& [line, kind] :
       {std::pair{"begin 4", Kind::Begin}, {"end 65535", Kind::End}, {"broken 1", Kind::Broken}}) {
    const auto request = decode_request(line);
    ASSERT_TRUE(request) << line;
    EXPECT_EQ(request->kind, kind);
    EXPECT_TRUE(request->is_of_scan());
    EXPECT_EQ(encode(*request, Dialect::UniversalRobots), std::string{line} + "\n");
  }
  for (const char* line : {"begin", "end 0", "broken 65536", "begin x", "end 4 5", "begins 4"})
    EXPECT_FALSE(decode_request(line)) << line;
}

INSTANTIATE_TEST_SUITE_P(Makes, ScanPath, testing::Values(Dialect::UniversalRobots, Dialect::Fanuc, Dialect::Kawasaki));
}  // namespace binpick::drivers::robot
