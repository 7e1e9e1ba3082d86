#include <cstdio>
#include <gtest/gtest.h>

#include "base/log.hpp"
#include "drivers/robot/rtde/session.hpp"
#include "tests/emulators/robot/rtde_device.hpp"
#include "tests/unit/robot/pose_link.hpp"

namespace binpick::drivers::rtde {
namespace {
using namespace std::chrono_literals;
using emulators::RtdeDevice;
using robot::kLinkStart;
using robot::PoseFailed;
using robot::PoseState;
using Why = PoseFailed::Why;

/// A tcp that is turned against the flange, so that a wrong order of the product shows.
Transform<frame::Flange, frame::Tcp> gripper() {
  Transform<frame::Flange, frame::Tcp> T;
  T.iso.translation() = Eigen::Vector3d{10, -20, 180};
  T.iso.linear() = from_wpr_deg({5, -10, 90});
  return T;
}

class RtdeSession : public testing::Test {
 protected:
  using Link = robot::PoseLink<Session, RtdeDevice>;
  RtdeSession() {
    log::set_sink([this](log::Level, std::string_view, std::string_view text) { log += std::string(text) + "\n"; });
  }
  ~RtdeSession() override { log::set_sink({}); }

  static RtdeDevice::Options device_options() {
    RtdeDevice::Options o;
    o.clock.started = kLinkStart - 1h;
    o.clock.drift_ppm = 50;
    o.T_flange_tcp = gripper();
    return o;
  }
  static Link link(const Options& options = {}, const RtdeDevice::Options& device = device_options()) {
    return Link{Session{options}, RtdeDevice{robot::swing, device}};
  }
  void expect_failed(Link& l, Why why, const std::string& words) {
    ASSERT_FALSE(l.failed.empty());
    EXPECT_EQ(l.failed[0].why, why) << l.failed[0].text;
    EXPECT_NE(l.failed[0].text.find(words), std::string::npos) << l.failed[0].text;
    EXPECT_TRUE(l.samples.empty());
  }
  std::string log;
};

TEST_F(RtdeSession, StreamsTheFlangeAtTheRateOfTheController) {
  Link l = link();
  l.run_for(20s);
  EXPECT_EQ(l.source.state(), PoseState::Streaming);
  ASSERT_EQ(l.ready.size(), 1U);
  EXPECT_TRUE(l.failed.empty());
  EXPECT_EQ(l.sender.asked()->frequency_hz, 500);
  EXPECT_GT(l.samples.size(), 6500U);
  EXPECT_LT(l.samples.size(), 7600U) << "none before the clock is known";
  EXPECT_LT(l.worst_mm(), 0.35);
  std::printf("  worst %.3f mm at up to 314 mm/s, uncertainty %.3f ms\n", l.worst_mm(), in_ms(*l.source.uncertainty()));
  for (const auto& s : l.samples)
    ASSERT_TRUE(s.T_base_flange.iso.linear().isApprox(robot::swing(s.at).iso.linear(), 2e-3));
  EXPECT_TRUE(l.source.trouble().empty());
}

TEST_F(RtdeSession, AsksOlderControllersForTheirRateAndForNoMoreThanWanted) {
  auto device = device_options();
  device.version = {3, 15, 8, 0};
  Link cb3 = link({}, device);
  cb3.run_for(100ms);
  EXPECT_EQ(cb3.sender.asked()->frequency_hz, 125);
  Link slow = link({.frequency_hz = 100});
  slow.run_for(100ms);
  EXPECT_EQ(slow.sender.asked()->frequency_hz, 100);
  Link fast = link({.frequency_hz = 400}, device);
  fast.run_for(100ms);
  EXPECT_EQ(fast.sender.asked()->frequency_hz, 125);
}

TEST_F(RtdeSession, SlowSamplesAreNoSilence) {
  Link l = link({.frequency_hz = 2});
  l.run_for(30s);
  EXPECT_TRUE(l.failed.empty());
  EXPECT_EQ(l.ready.size(), 1U);
}

TEST_F(RtdeSession, AProgramMayChangeTheTcp) {
  Link l = link();
  l.run_for(8s);
  l.sender.T_flange_tcp = {};
  l.run_for(2s);
  EXPECT_EQ(l.ready.size(), 1U);
  EXPECT_LT(l.worst_mm(), 0.35);
}

TEST_F(RtdeSession, WithoutATcpOffsetOfTheControllerTheCellFilesIsTaken) {
  auto device = device_options();
  device.version = {3, 7, 0, 0};
  Link l = link({.T_flange_tcp = gripper()}, device);
  l.sender.types["tcp_offset"] = "NOT_FOUND";
  l.run_for(10s);
  EXPECT_EQ(l.ready.size(), 1U);
  EXPECT_EQ(l.connections, 1);
  EXPECT_EQ(l.sender.asked()->names.size(), 5U);
  EXPECT_LT(l.worst_mm(), 0.35);

  Link none = link({}, device);
  none.sender.types["tcp_offset"] = "NOT_FOUND";
  none.run_for(3s);
  expect_failed(none, Why::Refused, "software 3.7.0 does not tell its tcp offset");
}

TEST_F(RtdeSession, RefusalsSayWhatAndWhatToDo) {
  Link version = link();
  version.sender.accepts_version = false;
  version.run_for(300ms);
  expect_failed(version, Why::Refused, "does not speak protocol version 2; update");

  Link start = link();
  start.sender.accepts_start = false;
  start.run_for(300ms);
  expect_failed(start, Why::Refused, "refuses to start");

  for (const auto& [type, words] : {std::pair{"NOT_FOUND", "actual_TCP_pose is NOT_FOUND instead of VECTOR6D"},
                                    std::pair{"IN_USE", "actual_TCP_pose is IN_USE"},
                                    std::pair{"VECTOR3D", "actual_TCP_pose is VECTOR3D instead of VECTOR6D"}}) {
    Link output = link({.T_flange_tcp = gripper()});
    output.sender.types["actual_TCP_pose"] = type;
    output.run_for(300ms);
    expect_failed(output, Why::Refused, words);
  }
}

TEST_F(RtdeSession, SilenceInEachStepOfTheHandshakeIsNoticedInTime) {
  // Bytes that the controller sends before it falls silent: nothing, its answers to V, v, O, S.
  for (const std::size_t before : {0U, 4U, 4U + 19U, 4U + 19U + 50U}) {
    Session session{{}};
    RtdeDevice device{robot::swing, device_options()};
    TimePoint now = kLinkStart;
    device.on_connected(now);
    session.on_connected(now);
    std::size_t heard = 0;
    for (int i = 0; i < 3000; ++i, now += 1ms) {
      device.on_deadline(now);
      device.on_bytes(session.take_output(), now);
      Bytes out = device.take_output();
      out.resize(std::min(out.size(), before - std::min(before, heard)));
      heard += out.size();
      session.on_bytes(out, now);
      if (session.deadline() && *session.deadline() <= now) session.on_deadline(now);
      if (session.take_reopen()) break;
    }
    EXPECT_LT(now - kLinkStart, 1100ms) << before;
    const auto event = session.take_event();
    ASSERT_TRUE(event.has_value());
    EXPECT_EQ(std::get<PoseFailed>(*event).why, Why::NoReply) << before;
    EXPECT_EQ(session.state(), PoseState::Offline);
    EXPECT_FALSE(session.deadline().has_value());
  }
}

TEST_F(RtdeSession, SilenceWhileStreamingIsAFaultAndTheNextConnectionShakesHandsAgain) {
  Link l = link();
  l.run_for(8s);
  l.sender.faults.silent = true;
  l.run_for(260ms);
  ASSERT_EQ(l.failed.size(), 1U);
  EXPECT_EQ(l.failed[0].why, Why::Silent);
  EXPECT_EQ(l.source.state(), PoseState::Offline);
  l.sender.faults.silent = false;
  const std::size_t before = l.samples.size();
  l.run_for(2s);
  EXPECT_EQ(l.connections, 2);
  EXPECT_EQ(l.ready.size(), 2U) << "its clock is still known: no settling again";
  EXPECT_GT(l.samples.size(), before + 500);
  EXPECT_LT(l.worst_mm(), 0.35);
}

TEST_F(RtdeSession, ALostConnectionIsTakenUpAgainAtOnce) {
  Link l = link();
  l.run_for(8s);
  l.sender.cut();
  l.run_for(1s);
  ASSERT_EQ(l.failed.size(), 1U);
  EXPECT_EQ(l.failed[0].why, Why::LinkLost);
  EXPECT_EQ(l.ready.size(), 2U);
  l.sender.faults.unplugged = true;
  l.run_for(5s);
  EXPECT_EQ(l.source.state(), PoseState::Offline);
  l.sender.faults.unplugged = false;
  l.run_for(1s);
  EXPECT_EQ(l.source.state(), PoseState::Streaming);
  EXPECT_LT(l.worst_mm(), 0.35);
}

TEST_F(RtdeSession, ACutAfterAnyByteOfTheHandshakeHeals) {
  for (std::size_t bytes = 1; bytes < 200; ++bytes) {
    Link l = link();
    l.sender.faults.disconnect_after_bytes = bytes;
    l.run_for(1200ms);
    EXPECT_EQ(l.connections, 2) << bytes;
    ASSERT_EQ(l.failed.size(), 1U) << bytes;
    EXPECT_EQ(l.failed[0].why, Why::LinkLost) << bytes;
    EXPECT_EQ(l.source.state(), PoseState::Starting) << bytes;
  }
}

TEST_F(RtdeSession, ItDoesNotMatterHowTheStreamIsCutIntoPieces) {
  auto device = device_options();
  device.greets = true;
  Link l = link({.frequency_hz = 50}, device);
  l.sender.faults.split_every_byte = true;
  l.run_for(8s);
  EXPECT_TRUE(l.failed.empty());
  EXPECT_EQ(l.ready.size(), 1U);
  EXPECT_NE(log.find("the controller says: welcome"), std::string::npos);
}

TEST_F(RtdeSession, ARestartOfTheControllerIsLearntAnew) {
  Link l = link();
  l.run_for(8s);
  const std::size_t before = l.samples.size();
  l.sender.restart(l.now);
  l.run_for(3s);
  EXPECT_EQ(l.samples.size(), before) << "the old clock tells nothing of the new time stamps";
  l.run_for(5s);
  EXPECT_EQ(l.ready.size(), 2U);
  ASSERT_EQ(l.failed.size(), 1U);
  EXPECT_EQ(l.failed[0].why, Why::LinkLost);
  EXPECT_LT(l.worst_mm(), 0.35);
}

TEST_F(RtdeSession, TimeStampsThatStandStillAreAFault) {
  Link l = link();
  l.run_for(8s);
  l.sender.time_stands_still = true;
  l.run_for(800ms);
  ASSERT_EQ(l.failed.size(), 1U);
  EXPECT_EQ(l.failed[0].why, Why::ClockStopped);
}

TEST_F(RtdeSession, AnArmWithoutPowerHasNoPoseAndTheReasonIsTold) {
  Link l = link();
  l.sender.robot_mode = 3;
  l.run_for(8s);
  EXPECT_EQ(l.ready.size(), 1U);
  EXPECT_TRUE(l.samples.empty());
  EXPECT_NE(l.source.trouble().find("no power"), std::string::npos);
  l.sender.robot_mode = 7;
  l.run_for(100ms);
  EXPECT_FALSE(l.samples.empty());
  EXPECT_EQ(l.source.trouble(), "");
  for (const auto& [mode, words] : {std::pair{3, "protective stop"}, std::pair{7, "emergency stop"},
                                    std::pair{5, "safeguard stop"}, std::pair{9, "fault"}, std::pair{22, "22"}}) {
    l.sender.safety_mode = mode;
    l.run_for(50ms);
    EXPECT_NE(l.source.trouble().find(words), std::string::npos) << l.source.trouble();
  }
  l.sender.safety_mode = 2;
  l.sender.runtime_state = 4;
  l.run_for(50ms);
  EXPECT_NE(l.source.trouble().find("no program runs"), std::string::npos);
}

TEST_F(RtdeSession, GarbageNeverMakesAPoseFarFromTheTruthWithoutBeingNoticed) {
  // The protocol has no checksum; TCP has. What a corrupted byte can do is bounded: a fault, or one odd value.
  Link l = link({.frequency_hz = 50});
  l.run_for(8s);
  l.sender.faults.garbage = true;
  l.run_for(10s);
  EXPECT_FALSE(l.failed.empty());
  for (const auto& s : l.samples) ASSERT_TRUE(s.T_base_flange.iso.matrix().allFinite());
  l.sender.faults.garbage = false;
  l.run_for(20s);
  EXPECT_EQ(l.source.state(), PoseState::Streaming) << l.failed.back().text;
}

TEST_F(RtdeSession, AnotherServiceOnThePortIsNoRobot) {
  Session session{{}};
  session.on_connected(kLinkStart);
  session.on_bytes(as_bytes("Connected: Universal Robots Dashboard Server\n"), kLinkStart + 1ms);
  const auto event = session.take_event();
  ASSERT_TRUE(event.has_value());
  EXPECT_EQ(std::get<PoseFailed>(*event).why, Why::BadTelegram);
  EXPECT_NE(std::get<PoseFailed>(*event).text.find("30004"), std::string::npos);
  EXPECT_TRUE(session.take_reopen());
  EXPECT_FALSE(session.take_reopen());
}

TEST_F(RtdeSession, AnswersOutOfTurnAndForeignRecipesAreFaults) {
  for (const Reply& reply : std::vector<Reply>{StartAnswer{true}, ControllerVersion{5, 1, 1, 1},
                                               OutputsAnswer{1, {"DOUBLE"}}, Values{1, {}}, PauseAnswer{true}}) {
    Session session{{}};
    session.on_connected(kLinkStart);
    session.on_bytes(encode(reply), kLinkStart + 1ms);
    EXPECT_EQ(session.state(), PoseState::Offline) << reply.index();
  }
  Link l = link();
  l.run_for(8s);
  l.source.on_bytes(encode(Values{2, {}}), l.now);
  l.run_for(1ms);
  ASSERT_EQ(l.failed.size(), 1U);
  EXPECT_NE(l.failed[0].text.find("recipe 2"), std::string::npos);
}

TEST_F(RtdeSession, AnHourAtFiftyPpmDoesNotLoseAMoment) {
  Link l = link({.frequency_hz = 50});
  for (int i = 0; i < 60; ++i) {
    l.run_for(60s);
    EXPECT_LT(l.worst_mm(), 0.35) << i;
    l.samples.clear();
  }
  EXPECT_EQ(l.ready.size(), 1U);
  EXPECT_TRUE(l.failed.empty());
}
}  // namespace
}  // namespace binpick::drivers::rtde
