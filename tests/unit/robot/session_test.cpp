#include "drivers/robot/session.hpp"

#include <gtest/gtest.h>
#include <string>
#include <vector>

#include "base/log.hpp"
#include "drivers/robot/codec.hpp"
#include "drivers/robot/dialect.hpp"

namespace binpick::drivers::robot {
namespace {
using namespace std::chrono_literals;
constexpr TimePoint kStart{1h};

Pick pick(std::uint16_t id) {
  Pick value{id, static_cast<std::uint16_t>(id + 100), 1, 9, {}, {}, {}};
  value.T_base_approach.iso.translation() = Eigen::Vector3d{1000, 20, 400};
  value.T_base_grasp.iso.translation() = Eigen::Vector3d{1000, 20, 300};
  value.T_base_retreat.iso.translation() = Eigen::Vector3d{1030, 20, 390};
  return value;
}

/// A session and what a robot on the other end of the wire sees of it, of each make.
class RobotSession : public testing::TestWithParam<Dialect> {
 protected:
  RobotSession() {
    log::set_sink([this](log::Level, std::string_view, std::string_view) { ++log_lines; });
    session.on_connected(now);
    events();
  }
  ~RobotSession() override { log::set_sink({}); }

  std::string send(std::string_view text) {
    session.on_bytes(as_bytes(text), now);
    return std::string(as_text(session.take_output()));
  }
  /// One request, one answer.
  Reply ask(std::string_view text) {
    const std::string answer = send(text);
    const auto decoded = decode_reply(answer, GetParam());
    if (!decoded || !*decoded) {
      ADD_FAILURE() << "no answer to " << text << ": " << answer;
      return {};
    }
    EXPECT_EQ((*decoded)->consumed + format_of(GetParam()).end.size(), answer.size()) << "exactly one answer";
    EXPECT_EQ(answer.back(), '\n');
    return (*decoded)->reply;
  }
  /// Events in short: "connected", "fetched 1", "done 1", "failed 1", "lost: why".
  std::vector<std::string> events() {
    std::vector<std::string> texts;
    while (const auto event = session.take_event()) {
      if (std::holds_alternative<Connected>(*event)) texts.emplace_back("connected");
      if (const auto* e = std::get_if<Fetched>(&*event)) texts.push_back("fetched " + std::to_string(e->pick_id));
      if (const auto* e = std::get_if<Reported>(&*event))
        texts.push_back((e->done ? "done " : "failed ") + std::to_string(e->pick_id));
      if (const auto* e = std::get_if<Lost>(&*event)) texts.push_back("lost: " + e->text);
    }
    return texts;
  }
  using Texts = std::vector<std::string>;

  TimePoint now = kStart;
  Options options() const { return {.dialect = GetParam()}; }
  Session session{options()};
  int log_lines = 0;
};
}  // namespace

INSTANTIATE_TEST_SUITE_P(EachMake, RobotSession,
                         testing::Values(Dialect::UniversalRobots, Dialect::Fanuc, Dialect::Kawasaki));

TEST_P(RobotSession, BeforeAPickIsReadyTheAnswerSaysSo) {
  EXPECT_EQ(send("fetch\n"), encode(Reply{}, GetParam()));
  EXPECT_TRUE(events().empty());
}

TEST_P(RobotSession, EachReasonForNoPickHasItsStatus) {
  for (const auto& [reason, status] : {std::pair{NoPick::NotReady, 0},
                                       {NoPick::SupplyEmpty, 10},
                                       {NoPick::NothingFound, 11},
                                       {NoPick::NotReachable, 12},
                                       {NoPick::Fault, 40}}) {
    session.withdraw(reason);
    EXPECT_EQ(static_cast<int>(ask("fetch\n").status), status);
  }
}

TEST_P(RobotSession, TheSamePickUnderTheSameIdUntilItIsReported) {
  session.offer(pick(7));
  const std::string first = send("fetch\n");
  EXPECT_EQ(first, encode(Reply{Status::Pick, pick(7), 0, Outcome::None}, GetParam()));
  EXPECT_EQ(send("fetch\n"), first);
  EXPECT_EQ(events(), (Texts{"fetched 7", "fetched 7"}));
  const Reply taken = ask("done 7\n");
  EXPECT_EQ(taken.status, Status::ReportTaken);
  EXPECT_EQ(taken.pick.pick_id, 7);
  EXPECT_EQ(taken.reported_id, 7);
  EXPECT_EQ(taken.outcome, Outcome::Done);
  EXPECT_EQ(events(), Texts{"done 7"});
  const Reply after = ask("fetch\n");
  EXPECT_EQ(after.status, Status::NotReady);
  EXPECT_EQ(after.reported_id, 7);
}

TEST_P(RobotSession, ARepeatedReportIsAnsweredAgainAndCountsOnce) {
  session.offer(pick(7));
  ask("fetch\n");
  ask("failed 7\n");
  events();
  for (const char* line : {"failed 7\n", "done 7\n"}) {
    const Reply again = ask(line);
    EXPECT_EQ(again.status, Status::ReportTaken);
    EXPECT_EQ(again.outcome, Outcome::Failed) << "the first report stands";
  }
  EXPECT_TRUE(events().empty());
}

TEST_P(RobotSession, AReportOfAnotherPickIsAnsweredAndChangesNothing) {
  session.offer(pick(7));
  ask("fetch\n");
  events();
  for (const char* line : {"done 6\n", "failed 8\n", "done 65535\n"}) {
    EXPECT_EQ(ask(line).status, Status::UnknownPick);
  }
  EXPECT_TRUE(events().empty());
  EXPECT_EQ(ask("fetch\n").pick.pick_id, 7);
  EXPECT_TRUE(session.connected());
}

TEST_P(RobotSession, ARobotThatGotThePickFromThePlcMayReportItHere) {
  session.offer(pick(7));
  EXPECT_EQ(ask("done 7\n").status, Status::ReportTaken);
  EXPECT_EQ(events(), Texts{"done 7"});
}

TEST_P(RobotSession, AWithdrawnPickIsNotGivenButItsReportIsTaken) {
  session.offer(pick(7));
  ask("fetch\n");
  session.withdraw(NoPick::NotReady);
  EXPECT_EQ(ask("fetch\n").status, Status::NotReady);
  events();
  EXPECT_EQ(ask("done 7\n").status, Status::ReportTaken);
  EXPECT_EQ(events(), Texts{"done 7"});
  EXPECT_EQ(ask("done 7\n").status, Status::ReportTaken);
  EXPECT_TRUE(events().empty());
}

TEST_P(RobotSession, ANewOfferClosesTheOldPick) {
  session.offer(pick(7));
  ask("fetch\n");
  session.offer(pick(8));
  EXPECT_EQ(ask("done 7\n").status, Status::UnknownPick);
  EXPECT_EQ(ask("fetch\n").pick.pick_id, 8);
}

TEST_P(RobotSession, AnIdThatComesRoundIsANewPick) {
  session.offer(pick(7));
  ask("fetch\n");
  ask("done 7\n");
  session.offer(pick(7));
  events();
  EXPECT_EQ(ask("fetch\n").reported_id, 0);
  EXPECT_EQ(ask("failed 7\n").outcome, Outcome::Failed);
  EXPECT_EQ(events(), (Texts{"fetched 7", "failed 7"}));
}

TEST_P(RobotSession, HelloTellsWhatIsOnRecord) {
  session.offer(pick(6));
  ask("fetch\n");
  ask("failed 6\n");
  session.offer(pick(7));
  const Reply hello = ask("hello\n");
  EXPECT_EQ(hello.status, Status::Hello);
  EXPECT_EQ(hello.pick.pick_id, 7);
  EXPECT_EQ(hello.reported_id, 6);
  EXPECT_EQ(hello.outcome, Outcome::Failed);
}

TEST_P(RobotSession, EachByteSplitGivesTheSameAnswers) {
  const std::string text = "hello\nfetch\ndone 7\nfetch\n";
  session.offer(pick(7));
  std::string whole;
  {
    Session other{options()};
    other.on_connected(now);
    other.offer(pick(7));
    other.on_bytes(as_bytes(text), now);
    whole = as_text(other.take_output());
  }
  for (std::size_t split = 0; split <= text.size(); ++split) {
    Session other{options()};
    other.on_connected(now);
    other.offer(pick(7));
    other.on_bytes(as_bytes(text.substr(0, split)), now);
    std::string answers{as_text(other.take_output())};
    other.on_bytes(as_bytes(text.substr(split)), now);
    answers += as_text(other.take_output());
    EXPECT_EQ(answers, whole) << split;
  }
}

TEST_P(RobotSession, AProgramRestartedAtAnyByteFindsItsPickAgain) {
  const std::string script = "hello\nfetch\ndone 7\n";
  for (std::size_t cut = 0; cut <= script.size(); ++cut)
    for (const bool reconnects : {true, false}) {
      SCOPED_TRACE("cut at " + std::to_string(cut) + (reconnects ? ", new connection" : ", same connection"));
      session = Session{options()};
      session.on_connected(now);
      session.offer(pick(7));
      send(script.substr(0, cut));
      if (reconnects) {
        session.on_disconnected(now);
        session.on_connected(now);
      }
      events();
      // The restarted program begins anew. On the same connection its first line may be glued to the torn one; then it
      // is told so, and asks again.
      Reply reply = ask("hello\n");
      if (!reconnects && reply.status != Status::Hello) {
        EXPECT_EQ(reply.status, Status::BadRequest);
        reply = ask("hello\n");
      }
      ASSERT_EQ(reply.status, Status::Hello);
      if (cut == script.size()) {
        EXPECT_EQ(reply.reported_id, 7) << "it was reported: nothing to do again";
        EXPECT_EQ(ask("fetch\n").status, Status::NotReady);
        continue;
      }
      EXPECT_EQ(reply.pick.pick_id, 7);
      EXPECT_EQ(ask("fetch\n").pick.pick_id, 7);
      EXPECT_EQ(ask("failed 7\n").outcome, Outcome::Failed);
      EXPECT_EQ(events().back(), "failed 7");
    }
}

TEST_P(RobotSession, GarbageIsAnsweredCountedAndLoggedOnce) {
  for (const char* line : {"GET / HTTP/1.1\r\n", "\xff\xfe\n", "fetch me\n", "done x\n"})
    EXPECT_EQ(ask(line).status, Status::BadRequest) << line;
  EXPECT_EQ(ask(std::string(100'000, 'a') + "\n").status, Status::BadRequest);
  EXPECT_EQ(session.bad_lines(), 5U);
  EXPECT_EQ(log_lines, 1);
  session.offer(pick(7));
  EXPECT_EQ(ask("fetch\n").pick.pick_id, 7);
  EXPECT_TRUE(events().size() == 1 && session.connected());
}

TEST_P(RobotSession, EachCorruptedByteOfAReportIsAnsweredOnceItsLineEnds) {
  const std::string line = "failed 17\n";
  for (std::size_t at = 0; at + 1 < line.size(); ++at)
    for (int value = 0; value < 256; ++value) {
      session = Session{options()};
      session.on_connected(now);
      session.offer(pick(17));
      std::string corrupted = line;
      corrupted[at] = static_cast<char>(value);
      const std::string answers = send(corrupted);
      if (value == '\n' && at == 0) continue;  // an empty line and "ailed 17"
      const auto decoded = decode_reply(answers, GetParam());
      ASSERT_TRUE(decoded && *decoded) << at << " " << value;
      const Status status = (*decoded)->reply.status;
      EXPECT_TRUE(status == Status::ReportTaken || status == Status::UnknownPick || status == Status::BadRequest);
      EXPECT_EQ(status == Status::ReportTaken, (*decoded)->reply.reported_id == 17);
    }
}

TEST_P(RobotSession, SilenceIsNoticedAndTheConnectionClosed) {
  EXPECT_EQ(session.deadline(), kStart + 60s);
  now = kStart + 50s;
  ask("hello\n");
  EXPECT_EQ(session.deadline(), kStart + 110s);
  session.on_deadline(kStart + 109s);
  EXPECT_TRUE(session.connected());
  session.on_deadline(kStart + 110s);
  EXPECT_FALSE(session.connected());
  EXPECT_TRUE(session.take_reopen());
  EXPECT_FALSE(session.take_reopen());
  EXPECT_EQ(events(), Texts{"lost: silent for 60 s"});
  EXPECT_EQ(session.deadline(), std::nullopt);
  session.on_disconnected(now);
  EXPECT_TRUE(events().empty()) << "told once";
}

TEST_P(RobotSession, ANewConnectionReplacesTheOldOneAndKeepsThePick) {
  session.offer(pick(7));
  ask("fetch\n");
  send("don");
  session.on_connected(now);
  EXPECT_EQ(ask("fetch\n").pick.pick_id, 7);
  EXPECT_EQ(session.bad_lines(), 0U) << "half a line of the old connection is forgotten";
}

TEST_P(RobotSession, ADisconnectedRobotIsToldOnceAndComesBack) {
  session.offer(pick(7));
  ask("fetch\n");
  events();
  session.on_disconnected(now);
  EXPECT_EQ(events(), Texts{"lost: connection closed"});
  EXPECT_FALSE(session.connected());
  EXPECT_EQ(send("fetch\n"), "") << "nobody is there";
  session.on_connected(now);
  EXPECT_EQ(ask("done 7\n").status, Status::ReportTaken);
  EXPECT_EQ(events(), (Texts{"connected", "done 7"}));
}

TEST_P(RobotSession, ARobotThatNeverReadsIsDropped) {
  std::string flood;
  for (int i = 0; i < 10'000; ++i) flood += "x\n";
  EXPECT_EQ(send(flood), "");
  EXPECT_FALSE(session.connected());
  EXPECT_TRUE(session.take_reopen());
  EXPECT_EQ(events(), Texts{"lost: it sends requests without reading the answers"});
}
}  // namespace binpick::drivers::robot
