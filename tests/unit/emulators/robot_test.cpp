#include "tests/emulators/robot/robot.hpp"

#include <gtest/gtest.h>
#include <map>
#include <string>
#include <vector>

#include "base/log.hpp"
#include "base/rotation.hpp"
#include "drivers/robot/session.hpp"

namespace binpick::emulators {
namespace {
using namespace std::chrono_literals;
using drivers::robot::Dialect;
using drivers::robot::NoPick;
using drivers::robot::Pick;
using drivers::robot::Session;

/// The cell's session and the emulated robot on one wire, in virtual time, in each dialect. The cell side gives one
/// pick after another.
class RobotPair : public testing::TestWithParam<Dialect> {
 protected:
  RobotPair() {
    log::set_sink([](log::Level, std::string_view, std::string_view) {});
    robot.on_grasp = [this](const Pick& pick) {
      ++grasps[pick.pick_id];
      return object_is_there;
    };
  }
  ~RobotPair() override { log::set_sink({}); }

  void offer() {
    ++last_id;
    Pick pick{last_id, last_id, 1, 5, {}, {}, {}};
    pick.T_base_approach.iso.translation() = Eigen::Vector3d{-100, 200, 400};
    pick.T_base_approach.iso.linear() = from_wpr_deg({175, -12, -100});
    pick.T_base_grasp.iso.translation() = Eigen::Vector3d{100, 200, 300};
    pick.T_base_grasp.iso.linear() = from_wpr_deg({180, 0, 45});  // straight down
    pick.T_base_retreat.iso.translation() = Eigen::Vector3d{130, 160, 390};
    pick.T_base_retreat.iso.linear() = pick.T_base_grasp.iso.linear();
    session.offer(pick);
  }

  void deliver(const Bytes& answer) {
    if (!byte_by_byte) return robot.on_bytes(answer, now);
    for (const std::byte byte : answer) robot.on_bytes(Bytes{byte}, now);
  }

  void pump() {
    for (int rounds = 0; rounds < 100; ++rounds) {
      bool any = false;
      if (!linked && robot.wants_link() && now >= link_again) {
        linked = any = true;
        session.on_connected(now);
        robot.on_connected(now);
      }
      for (const Bytes& bytes : {robot.take_output()})
        if (linked && !bytes.empty()) any = true, session.on_bytes(bytes, now);
      for (const Bytes& bytes : {session.take_output()})
        if (linked && !bytes.empty()) any = true, deliver(bytes);
      const bool closed_here = session.take_reopen(), closed_there = robot.take_reopen();
      if (linked && (closed_here || closed_there)) {
        linked = false;
        any = true;
        link_again = now + 200ms;
        session.on_disconnected(now);
        robot.on_disconnected(now);
      }
      if (session.deadline() && *session.deadline() <= now) any = true, session.on_deadline(now);
      if (robot.deadline() && *robot.deadline() <= now) any = true, robot.on_deadline(now);
      while (const auto event = session.take_event()) {
        any = true;
        if (const auto* reported = std::get_if<drivers::robot::Reported>(&*event)) {
          ++(reported->done ? done : failed)[reported->pick_id];
          if (offers_more) offer();
        }
        if (std::holds_alternative<drivers::robot::PathBegun>(*event)) session.let_go();
        paths_ended += std::holds_alternative<drivers::robot::PathEnded>(*event);
        paths_broken += std::holds_alternative<drivers::robot::PathBroken>(*event);
        if (const auto* lost_event = std::get_if<drivers::robot::Lost>(&*event)) lost.push_back(lost_event->text);
      }
      while (auto event = robot.take_event()) events.push_back(std::move(*event));
      if (!any) return;
    }
    ADD_FAILURE() << "the two never come to rest";
  }

  void run_for(Duration time) {
    const TimePoint end = now + time;
    while (true) {
      pump();
      auto next = earlier(session.deadline(), robot.deadline());
      if (!linked && robot.wants_link()) next = earlier(next, link_again);
      if (!next || *next > end) break;
      now = std::max(*next, now + 1us);
    }
    now = end;
    pump();
  }

  template <class E>
  int count() const {
    int n = 0;
    for (const auto& event : events) n += std::holds_alternative<E>(event);
    return n;
  }
  int total(const std::map<std::uint16_t, int>& counts) const {
    int n = 0;
    for (const auto& [id, count] : counts) n += count;
    return n;
  }
  void expect_each_pick_once() const {
    for (std::uint16_t id = 1; id < last_id; ++id) {
      const int reports = (done.contains(id) ? done.at(id) : 0) + (failed.contains(id) ? failed.at(id) : 0);
      EXPECT_EQ(reports, 1) << "pick " << id;
      const int grasped = grasps.contains(id) ? grasps.at(id) : 0;
      EXPECT_LE(grasped, 1) << "pick " << id;
      EXPECT_GE(grasped, done.contains(id) ? 1 : 0) << "pick " << id;
    }
  }

  static ScanPath straight_path() {
    ScanPath path;
    path.T_base_end.iso.translation() = Eigen::Vector3d{0, 500, 0};
    path.duration = 2s;
    return path;
  }
  double along_path_mm() const { return robot.flange_at(now).iso.translation().y(); }

  TimePoint now{1h};
  Session session{{.dialect = GetParam()}};
  Robot robot{{.dialect = GetParam(), .paths = {{1, straight_path()}}}};
  bool linked = false, offers_more = true, object_is_there = true;
  bool byte_by_byte = false;  // how answers reach the robot
  TimePoint link_again{};
  std::uint16_t last_id = 0;
  int paths_ended = 0, paths_broken = 0;
  std::map<std::uint16_t, int> grasps, done, failed;
  std::vector<std::string> lost;
  std::vector<Robot::Event> events;
};
}  // namespace

INSTANTIATE_TEST_SUITE_P(EachMake, RobotPair,
                         testing::Values(Dialect::UniversalRobots, Dialect::Fanuc, Dialect::Kawasaki));

TEST_P(RobotPair, PicksOneAfterAnother) {
  run_for(1s);
  EXPECT_EQ(count<Robot::NoPickRead>(), 1) << "told when it changes, not at each poll";
  offer();
  run_for(60s);
  EXPECT_GT(total(done), 30);
  EXPECT_EQ(total(failed), 0);
  EXPECT_TRUE(lost.empty());
  expect_each_pick_once();
}

TEST_P(RobotPair, IsInTheViewFromTheStartOfTheApproachToTheEndOfTheRetreat) {
  offers_more = false;
  run_for(1s);
  EXPECT_TRUE(robot.clear_of_view());
  offer();
  run_for(150ms);
  EXPECT_FALSE(robot.clear_of_view());
  run_for(1300ms);
  EXPECT_FALSE(robot.clear_of_view());
  run_for(200ms);
  EXPECT_TRUE(robot.clear_of_view());
  EXPECT_EQ(done[1], 1);
}

TEST_P(RobotPair, ReadsThePoseThatWasOffered) {
  offer();
  run_for(500ms);
  ASSERT_EQ(count<Robot::PickRead>(), 1);
  for (const auto& event : events)
    if (const auto* read = std::get_if<Robot::PickRead>(&event)) {
      EXPECT_TRUE(read->pick.T_base_approach.iso.translation().isApprox(Eigen::Vector3d{-100, 200, 400}, 1e-9));
      EXPECT_TRUE(read->pick.T_base_approach.iso.linear().isApprox(from_wpr_deg({175, -12, -100}), 1e-6));
      EXPECT_TRUE(read->pick.T_base_grasp.iso.translation().isApprox(Eigen::Vector3d{100, 200, 300}, 1e-9));
      EXPECT_TRUE(read->pick.T_base_grasp.iso.linear().isApprox(from_wpr_deg({180, 0, 45}), 1e-6));
      EXPECT_TRUE(read->pick.T_base_retreat.iso.translation().isApprox(Eigen::Vector3d{130, 160, 390}, 1e-9));
      EXPECT_TRUE(read->pick.T_base_retreat.iso.linear().isApprox(from_wpr_deg({180, 0, 45}), 1e-6));
    }
}

TEST_P(RobotPair, AnEmptyGripperIsReportedAsFailed) {
  object_is_there = false;
  offer();
  run_for(10s);
  EXPECT_EQ(total(done), 0);
  EXPECT_GT(total(failed), 3);
  robot.faults.error_code = 1;
  object_is_there = true;
  const int before = total(failed);
  run_for(10s);
  EXPECT_EQ(total(done), 0);
  EXPECT_GT(total(failed), before);
}

TEST_P(RobotPair, AProgramRestartedAtAnyMomentGoesOn) {
  offer();
  for (int i = 0; i < 400; ++i) {
    run_for(std::chrono::milliseconds(37 * (i % 60)));
    robot.restart_program(now);
  }
  run_for(5s);
  EXPECT_GT(total(done), 50);
  EXPECT_GT(total(failed), 50) << "those that were not gripped yet";
  expect_each_pick_once();
}

TEST_P(RobotPair, AConnectionCutAfterAnyByteLosesNothing) {
  offer();
  for (std::size_t n = 0; n < 200; ++n) {
    robot.faults.disconnect_after_bytes = n % 40;
    run_for(3s);
  }
  EXPECT_EQ(total(failed), 0);
  EXPECT_GT(total(done), 200);
  EXPECT_GT(lost.size(), 150U);
  expect_each_pick_once();
}

TEST_P(RobotPair, EmergencyStopAtAnyMomentStopsEverythingAndThenItGoesOn) {
  offer();
  for (int i = 0; i < 100; ++i) {
    run_for(std::chrono::milliseconds(53 * (i % 40)));
    robot.faults.emergency_stop = true;
    run_for(10ms);
    const int before = total(grasps);
    const bool clear = robot.clear_of_view();
    EXPECT_FALSE(session.connected());
    run_for(20s);
    EXPECT_EQ(total(grasps), before);
    EXPECT_EQ(robot.clear_of_view(), clear);
    robot.faults.emergency_stop = false;
    run_for(3s);
    EXPECT_TRUE(session.connected());
  }
  expect_each_pick_once();
}

TEST_P(RobotPair, AScanPathIsRunOnceFromItsBeginningToItsEnd) {
  session.ask_path(1, 1);
  run_for(1500ms);
  EXPECT_GT(along_path_mm(), 0);
  EXPECT_LT(along_path_mm(), 500);
  run_for(10s);
  EXPECT_EQ(paths_ended, 1);
  EXPECT_EQ(paths_broken, 0);
}

TEST_P(RobotPair, AProgramThatIsStoppedAnywhereInAScanStandsAndSaysSoWhenItIsStarted) {
  for (int i = 0; i < 120; ++i) {
    session.ask_path(static_cast<std::uint16_t>(i + 1), 1);
    run_for(150ms + std::chrono::milliseconds(27 * i));  // it has been told of it by now
    robot.faults.emergency_stop = i % 2 == 0;
    if (i % 2 != 0) robot.restart_program(now);
    run_for(1ms);
    const double stopped_mm = along_path_mm();
    run_for(700ms);
    EXPECT_EQ(along_path_mm(), stopped_mm) << i;
    robot.faults.emergency_stop = false;
    run_for(5s);
    EXPECT_EQ(paths_ended + paths_broken, i + 1) << i;
  }
  EXPECT_GT(paths_broken, 60);
  EXPECT_GT(paths_ended, 5) << "those that were over, or not begun";
  offer();
  run_for(3s);
  EXPECT_GT(total(done), 0);
}

TEST_P(RobotPair, ASilentRobotIsTakenForGoneAndComesBack) {
  offer();
  run_for(5s);
  robot.faults.silent = true;
  run_for(70s);
  EXPECT_EQ(lost, std::vector<std::string>{"silent for 60 s"});
  robot.faults.silent = false;
  const int before = total(done);
  run_for(10s);
  EXPECT_GT(total(done), before);
  expect_each_pick_once();
}

TEST_P(RobotPair, UnpluggedAndPluggedAgain) {
  offer();
  run_for(5s);
  robot.faults.unplugged = true;
  run_for(5s);
  EXPECT_FALSE(session.connected());
  robot.faults.unplugged = false;
  const int before = total(done);
  run_for(10s);
  EXPECT_GT(total(done), before);
  expect_each_pick_once();
}

TEST_P(RobotPair, GarbageIsAskedAgainAndNeverBelieved) {
  offer();
  run_for(3s);
  robot.faults.garbage = true;
  const int before = total(done);
  run_for(30s);
  EXPECT_LE(total(done), before + 1);
  EXPECT_GT(session.bad_lines(), 50U);
  robot.faults.garbage = false;
  run_for(10s);
  EXPECT_GT(total(done), before + 3);
  expect_each_pick_once();
}

TEST_P(RobotPair, SlowAndTornLinesAreGoodLines) {
  robot.faults.split_every_byte = true;
  robot.faults.delay = 300ms;
  offer();
  run_for(60s);
  EXPECT_GT(total(done), 10);
  EXPECT_EQ(session.bad_lines(), 0U);
  expect_each_pick_once();
}

TEST_P(RobotPair, AnswersThatComeByteByByteAreGoodAnswers) {
  byte_by_byte = true;
  offer();
  run_for(60s);
  EXPECT_GT(total(done), 30);
  EXPECT_EQ(count<Robot::Trouble>(), 0);
  expect_each_pick_once();
}

TEST_P(RobotPair, AReportUnderAWrongIdIsNotTaken) {
  robot.faults.wrong_id = true;
  offer();
  run_for(10s);
  EXPECT_EQ(total(done) + total(failed), 0);
  robot.faults = {};
  run_for(10s);
  EXPECT_GT(total(done) + total(failed), 3);
}
}  // namespace binpick::emulators
