#include <gtest/gtest.h>

#include "tests/unit/plc/rig.hpp"

/// Who watches whom: heartbeats, a PLC that is gone, and the list of alarms.
namespace binpick::plc {
namespace {
using test::Rig;
using namespace std::chrono_literals;
}  // namespace

TEST(Watch, HeartbeatsBothWays) {
  Rig rig;
  rig.bring_to(State::Ready);
  rig.run_for(10s);
  EXPECT_EQ(rig.word(at("cell_heartbeat")), 20);
  EXPECT_EQ(rig.events(), "");
  rig.run_for(2900ms, false);
  EXPECT_EQ(rig.events(), "");
  rig.run_for(200ms, false);
  EXPECT_EQ(rig.events(), "L ");
  EXPECT_EQ(rig.first_alarm(), Alarm::PlcHeartbeatStopped);
  EXPECT_TRUE(rig.has(status::kAlarm));
  rig.run_for(10s, false);
  EXPECT_EQ(rig.events(), "") << "told once";
  rig.write();
  EXPECT_EQ(rig.events(), "") << "a write without a beat is no beat";
  rig.beat();
  EXPECT_EQ(rig.events(), "B ");
  EXPECT_FALSE(rig.has(status::kAlarm));
  EXPECT_EQ(rig.first_alarm(), Alarm::PlcHeartbeatStopped) << "visible now that the PLC is back";
}

TEST(Watch, APlcThatIsGoneIsAnAlarmOnceItIsBack) {
  Rig rig;
  rig.bring_to(State::Ready);
  rig.session.on_closed(1, rig.now);
  rig.run_for(5s, false);
  EXPECT_EQ(rig.events(), "L ");
  ASSERT_TRUE(rig.session.on_accept(2, "127.0.0.1", 2, rig.now));
  ++rig.block[at("plc_heartbeat")];
  rig.write(2);
  EXPECT_EQ(rig.events(), "B ");
  EXPECT_EQ(rig.first_alarm(), Alarm::PlcLost);
  EXPECT_EQ(static_cast<Alarm>(rig.word(at("last_alarm"))), Alarm::PlcLost);
  EXPECT_EQ(rig.word(at("alarms_total")), 1);
}

TEST(Watch, WithoutAHeartbeatWatchOnlyTheConnectionCounts) {
  Options o = test::options();
  o.heartbeat_timeout = 0ms;
  Rig rig{o};
  rig.bring_to(State::Ready);
  rig.run_for(1h, false);
  EXPECT_EQ(rig.events(), "");
  rig.session.on_closed(1, rig.now);
  rig.run_for(4s, false);
  EXPECT_EQ(rig.events(), "L ");
}

TEST(Watch, TheFirstAlarmStaysFirst) {
  Rig rig;
  rig.bring_to(State::Ready);
  rig.session.raise(Alarm::RobotLost, rig.now);
  rig.session.raise(Alarm::ScannerNoReply, rig.now);
  rig.session.raise(Alarm::RobotLost, rig.now);
  EXPECT_EQ(rig.first_alarm(), Alarm::RobotLost);
  EXPECT_EQ(rig.word(at("alarm_count")), 2);
  EXPECT_EQ(rig.word(at("alarm_2")), 200);
  rig.session.clear(Alarm::RobotLost, rig.now);
  EXPECT_EQ(rig.first_alarm(), Alarm::RobotLost) << "gone, yet not reset";
  rig.control(control::kReset);
  EXPECT_EQ(rig.first_alarm(), Alarm::ScannerNoReply) << "its cause is still there";
  EXPECT_EQ(rig.word(at("alarm_count")), 1);
  EXPECT_EQ(rig.word(at("alarm_2")), 0);
  rig.session.clear(Alarm::ScannerNoReply, rig.now);
  rig.control(0);
  rig.control(control::kReset);
  EXPECT_EQ(rig.first_alarm(), Alarm::None);
  EXPECT_EQ(rig.word(at("alarms_total")), 2);
  EXPECT_TRUE(rig.has(status::kReady)) << "alarms of this kind do not stop the cell";
}

}  // namespace binpick::plc
