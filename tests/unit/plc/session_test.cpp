#include "plc/session.hpp"

#include <gtest/gtest.h>

#include "tests/unit/plc/rig.hpp"

namespace binpick::plc {
namespace {
using test::Rig;
using namespace std::chrono_literals;

const std::array kAllStates{State::NotReady,  State::Ready,       State::Scanning,
                            State::Detecting, State::ResultValid, State::Fault};

float f32(const Rig& rig, std::uint16_t offset) {
  return f32_from_words(rig.word(offset), rig.word(static_cast<std::uint16_t>(offset + 1)), WordOrder::HighWordFirst);
}
}  // namespace

TEST(Session, OnePickWordByWord) {
  Rig rig;
  rig.session.set_not_ready(0, rig.now);
  EXPECT_EQ(rig.status(), status::kReady);
  rig.control(control::kRobotClear);
  rig.request(5, 2, 3);
  EXPECT_EQ(rig.status(), status::kAck | status::kBusy);
  EXPECT_EQ(rig.word(at("ack_sequence")), 5);
  EXPECT_EQ(rig.word(at("not_ready")), 1 << 6);
  EXPECT_EQ(rig.events(), "C A5 ");
  rig.drop();
  EXPECT_EQ(rig.status(), status::kBusy);
  rig.session.on_scan_done(rig.now);
  EXPECT_EQ(rig.status(), status::kBusy | status::kScanDone);
  rig.session.publish(Rig::pick(), rig.now);
  EXPECT_EQ(rig.status(), status::kResultValid | status::kScanDone);
  EXPECT_EQ(rig.word(at("result_sequence")), 5);
  EXPECT_EQ(rig.word(at("result_sequence_tail")), 5);
  EXPECT_EQ(rig.code(), ResultCode::PickFound);
  EXPECT_EQ(rig.word(at("pick_id")), 77);
  EXPECT_EQ(rig.word(at("result_part_id")), 1);
  EXPECT_EQ(rig.word(at("result_supply_id")), 3);
  EXPECT_EQ(rig.word(at("objects_left")), 4);
  EXPECT_EQ(rig.word(at("fill_level")), 35);
  EXPECT_EQ(f32(rig, at("score")), 0.875F);
  EXPECT_EQ(f32(rig, at("approach_x")), 1.0F);
  EXPECT_EQ(f32(rig, at("approach_y")), -0.25F);
  EXPECT_EQ(f32(rig, at("approach_z")), 0.5F);
  EXPECT_EQ(f32(rig, at("grasp_z")), 0.4F);
  EXPECT_EQ(f32(rig, at("retreat_x")), 1.03125F);
  EXPECT_EQ(f32(rig, at("retreat_y")), -0.3125F);
  EXPECT_EQ(f32(rig, at("retreat_z")), 0.46875F);
  EXPECT_EQ(rig.word(at("sweep_ms")), 1200);
  EXPECT_EQ(rig.word(at("profiles")), 430);
  EXPECT_EQ(rig.word(at("points")), 1);
  EXPECT_EQ(rig.word(at("points") + 1), 68000 - 65536);
  EXPECT_EQ(rig.word(at("hypotheses") + 1), 312);
  EXPECT_EQ(rig.word(at("detection_ms")), 240);
  rig.acknowledge(4);
  EXPECT_TRUE(rig.has(status::kResultValid)) << "another number acknowledges nothing";
  rig.acknowledge(5);
  EXPECT_EQ(rig.status(), status::kReady | status::kScanDone);
  EXPECT_EQ(rig.events(), "k5 ");
  for (std::uint16_t i = kResultFirst; i < kMapLength; ++i) EXPECT_EQ(rig.word(i), 0) << i;
  EXPECT_EQ(rig.word(at("cycles_total")), 1);
  EXPECT_EQ(rig.word(at("picks_total")), 1);
}

TEST(Session, PosesInTheRobotsOwnWords) {
  PickResult result = Rig::pick();
  result.T_base_grasp.iso.linear() = (Eigen::AngleAxisd(30 * M_PI / 180, Eigen::Vector3d::UnitZ()) *
                                      Eigen::AngleAxisd(20 * M_PI / 180, Eigen::Vector3d::UnitY()) *
                                      Eigen::AngleAxisd(10 * M_PI / 180, Eigen::Vector3d::UnitX()))
                                         .toRotationMatrix();
  struct Case {
    PoseConvention convention;
    std::array<float, 6> numbers;
  };
  // 10, 20, 30 as Fanuc writes it, and the same rotation as Kawasaki and Universal Robots write it.
  for (const auto& [convention, numbers] :
       {Case{PoseConvention::UniversalRobots, {1.0F, -0.25F, 0.4F, 0.077525F, 0.384852F, 0.486479F}},
        Case{PoseConvention::Fanuc, {1000, -250, 400, 10, 20, 30}},
        Case{PoseConvention::Kawasaki, {1000, -250, 400, 2.726830F, 22.268744F, 25.505550F}}}) {
    Options o = test::options();
    o.pose_convention = convention;
    Rig rig{o};
    rig.bring_to(State::Detecting);
    rig.session.publish(result, rig.now);
    for (std::uint16_t i = 0; i < 6; ++i)
      EXPECT_NEAR(f32(rig, static_cast<std::uint16_t>(at("grasp_x") + 2 * i)), numbers[i],
                  2e-6 * std::max(1.0F, std::abs(numbers[i])))
          << static_cast<int>(convention) << " " << i;
    const float unit = convention == PoseConvention::UniversalRobots ? 1e-3F : 1;
    EXPECT_FLOAT_EQ(f32(rig, at("retreat_x")), 1031.25F * unit);
    EXPECT_FLOAT_EQ(f32(rig, at("retreat_y")), -312.5F * unit);
    EXPECT_FLOAT_EQ(f32(rig, at("retreat_z")), 468.75F * unit);
    EXPECT_EQ(rig.word(at("pose_convention")), static_cast<int>(convention));
  }
}

TEST(Session, TheThreeEmptyOutcomesDiffer) {
  for (const ResultCode code : {ResultCode::SupplyEmpty, ResultCode::NothingFound, ResultCode::NotReachable}) {
    Rig rig;
    rig.bring_to(State::Detecting);
    PickResult result;
    result.code = code;
    result.part_id = 1;
    result.objects_left = code == ResultCode::NotReachable ? 3 : 0;
    if (code == ResultCode::NotReachable) result.unreachable = Unreachable::Neighbour;
    rig.session.publish(result, rig.now);
    EXPECT_TRUE(rig.has(status::kResultValid));
    EXPECT_EQ(rig.code(), code);
    EXPECT_EQ(rig.word(at("pick_id")), 0);
    EXPECT_EQ(rig.word(at("objects_left")), result.objects_left);
    EXPECT_EQ(rig.word(at("unreachable_reason")), code == ResultCode::NotReachable ? 8 : 0);
    for (std::uint16_t i = at("approach_x"); i < at("sweep_ms"); ++i) EXPECT_EQ(rig.word(i), 0) << "no pose";
    EXPECT_EQ(rig.word(at("picks_total")), 0);
    rig.acknowledge(5);
    EXPECT_TRUE(rig.has(status::kReady));
  }
}

/// The same sequence number once more, in each state.
TEST(Session, RetryInEachState) {
  for (const State state : kAllStates) {
    SCOPED_TRACE(to_string(state));
    Rig rig;
    rig.bring_to(state);
    if (state == State::NotReady || state == State::Ready) {
      // Nothing was accepted yet: make it so, then come back into the state.
      rig.session.set_not_ready(0, rig.now);
      rig.request(5);
      rig.drop();
      rig.session.publish(Rig::pick(), rig.now);
      rig.acknowledge(5);
      rig.session.set_not_ready(state == State::NotReady ? 2 : 0, rig.now);
      rig.events();
    }
    ASSERT_EQ(rig.session.state(), state);
    rig.request(5);
    EXPECT_EQ(rig.events(), "") << "no second sweep";
    EXPECT_TRUE(rig.has(status::kAck));
    EXPECT_EQ(rig.word(at("ack_sequence")), 5);
    if (state == State::Scanning || state == State::Detecting) {
      EXPECT_EQ(rig.session.state(), state);
      EXPECT_FALSE(rig.has(status::kResultValid));
      rig.session.publish(Rig::pick(), rig.now);
    }
    EXPECT_TRUE(rig.has(status::kResultValid));
    EXPECT_EQ(rig.word(at("result_sequence")), 5);
    EXPECT_EQ(rig.word(at("result_sequence_tail")), 5);
    EXPECT_EQ(rig.code(), state == State::Fault ? ResultCode::Fault : ResultCode::PickFound);
    EXPECT_EQ(rig.word(at("pick_id")), state == State::Fault ? 0 : 77);
    rig.drop();
    EXPECT_FALSE(rig.has(status::kAck));
    EXPECT_TRUE(rig.has(status::kResultValid)) << "valid until acknowledged, not until the request falls";
    rig.acknowledge(5);
    EXPECT_FALSE(rig.has(status::kResultValid));
    EXPECT_EQ(rig.word(at("cycles_total")), 1);
  }
}

TEST(Session, AnAcknowledgeLeftOverFromBeforeDoesNotTakeARepeatedResult) {
  Rig rig;
  rig.bring_to(State::ResultValid);
  rig.acknowledge(5);
  ASSERT_FALSE(rig.has(status::kResultValid));
  rig.control(control::kRequest | control::kRobotClear);  // result_ack is still 5
  EXPECT_TRUE(rig.has(status::kResultValid));
  rig.drop();
  EXPECT_TRUE(rig.has(status::kResultValid));
  rig.acknowledge(0);
  rig.acknowledge(5);
  EXPECT_FALSE(rig.has(status::kResultValid));
}

TEST(Session, AbortInEachState) {
  for (const State state : kAllStates) {
    SCOPED_TRACE(to_string(state));
    Rig rig;
    rig.bring_to(state);
    rig.control(control::kAbort | control::kRobotClear);
    EXPECT_TRUE(rig.has(status::kAbortAck)) << "acknowledged by level";
    EXPECT_FALSE(rig.has(status::kResultValid));
    const bool running = state == State::Scanning || state == State::Detecting;
    EXPECT_EQ(rig.events(), running ? "a " : "");
    const State after = running || state == State::ResultValid ? State::Ready : state;
    EXPECT_EQ(rig.session.state(), after);
    rig.write();
    EXPECT_EQ(rig.events(), "") << "held, it acts once";
    rig.session.publish(Rig::pick(), rig.now);
    EXPECT_FALSE(rig.has(status::kResultValid)) << "a late result is dropped";
    // A request under a standing abort is refused.
    rig.block[at("sequence")] = 6;
    rig.block[at("part_id")] = rig.block[at("supply_id")] = 1;
    rig.control(control::kAbort | control::kRequest | control::kRobotClear);
    EXPECT_EQ(rig.code(), ResultCode::Aborted);
    EXPECT_EQ(rig.word(at("result_sequence")), 6);
    rig.control(control::kRobotClear);
    EXPECT_FALSE(rig.has(status::kAbortAck));
    if (running) {
      rig.request(5);
      EXPECT_EQ(rig.code(), ResultCode::Aborted) << "the aborted request's own answer";
      EXPECT_EQ(rig.word(at("result_sequence")), 5);
      EXPECT_EQ(rig.events(), "");
      rig.drop();
      rig.acknowledge(5);
      rig.events();
    }
    if (state == State::Fault || state == State::NotReady) continue;
    rig.request(7);
    EXPECT_EQ(rig.events(), "A7 ") << "and the next request is served";
  }
}

TEST(Session, FaultInEachState) {
  for (const State state : kAllStates) {
    SCOPED_TRACE(to_string(state));
    Rig rig;
    rig.bring_to(state);
    rig.session.fault(Alarm::ScannerNoProfiles, rig.now);
    EXPECT_EQ(rig.session.state(), State::Fault);
    EXPECT_TRUE(rig.has(status::kFault));
    EXPECT_FALSE(rig.has(status::kResultValid)) << "nothing is valid";
    EXPECT_FALSE(rig.has(status::kScanDone));
    for (std::uint16_t i = kResultFirst; i < kMapLength; ++i) EXPECT_EQ(rig.word(i), 0) << i;
    EXPECT_EQ(rig.word(at("not_ready")) & static_cast<int>(NotReady::Alarm), static_cast<int>(NotReady::Alarm));
    rig.request(9);
    EXPECT_EQ(rig.code(), ResultCode::NotReady);
    EXPECT_EQ(rig.word(at("result_sequence")), 9);
    rig.drop();
    rig.control(control::kReset | control::kRobotClear);
    EXPECT_TRUE(rig.has(status::kResetAck));
    EXPECT_FALSE(rig.has(status::kFault));
    EXPECT_EQ(rig.first_alarm(), Alarm::None);
    EXPECT_EQ(rig.events(), "r ");
    rig.session.set_not_ready(0, rig.now);
    EXPECT_TRUE(rig.has(status::kReady));
    rig.control(control::kRobotClear);
    EXPECT_FALSE(rig.has(status::kResetAck));
    rig.request(9);
    EXPECT_EQ(rig.events(), "A9 ") << "a refused number is not used up";
  }
}

TEST(Session, WrongRequestsAreAnsweredAtOnce) {
  struct Case {
    std::uint16_t sequence, part, supply;
    ResultCode code;
  };
  for (const State state : kAllStates) {
    SCOPED_TRACE(to_string(state));
    for (const auto& c : {Case{8, 9, 1, ResultCode::UnknownPart}, Case{8, 0, 1, ResultCode::UnknownPart},
                          Case{8, 1, 2, ResultCode::UnknownSupply}, Case{65535, 1, 9, ResultCode::UnknownSupply}}) {
      Rig rig;
      rig.bring_to(state);
      rig.request(c.sequence, c.part, c.supply);
      EXPECT_TRUE(rig.has(status::kAck));
      EXPECT_TRUE(rig.has(status::kResultValid));
      EXPECT_EQ(rig.code(), c.code);
      EXPECT_EQ(rig.word(at("ack_sequence")), c.sequence);
      EXPECT_EQ(rig.word(at("result_sequence")), c.sequence);
      EXPECT_EQ(rig.word(at("result_part_id")), c.part);
      EXPECT_EQ(rig.events(), "");
      rig.drop();
      rig.acknowledge(c.sequence);
      EXPECT_FALSE(rig.has(status::kResultValid));
      if (state == State::Scanning || state == State::Detecting) {
        EXPECT_EQ(rig.session.state(), state) << "what runs is not disturbed";
        rig.session.publish(Rig::pick(), rig.now);
        EXPECT_EQ(rig.word(at("result_sequence")), 5);
      }
    }
  }
}

TEST(Session, TheSameNumberWithAnotherPartIsABadSequence) {
  Rig rig;
  rig.bring_to(State::ResultValid);
  rig.request(5, 2);
  EXPECT_EQ(rig.code(), ResultCode::BadSequence);
  EXPECT_EQ(rig.events(), "");
  rig.drop();
  rig.request(5, 1);
  EXPECT_EQ(rig.code(), ResultCode::PickFound) << "its own answer is still stored";
}

TEST(Session, WhileBusyOrNotReadyARequestIsRefusedWithNotReady) {
  for (const State state : {State::NotReady, State::Scanning, State::Detecting, State::Fault}) {
    SCOPED_TRACE(to_string(state));
    Rig rig;
    rig.bring_to(state);
    rig.request(6);
    EXPECT_EQ(rig.code(), ResultCode::NotReady);
    EXPECT_EQ(rig.word(at("result_sequence")), 6);
    EXPECT_EQ(rig.session.state(), state);
    EXPECT_EQ(rig.events(), "");
  }
  Rig rig;
  rig.bring_to(State::ResultValid);
  rig.session.set_not_ready(static_cast<std::uint16_t>(NotReady::Pivot), rig.now);
  rig.request(6);
  EXPECT_EQ(rig.code(), ResultCode::NotReady) << "a device went while the result waited";
  rig.drop();
  rig.acknowledge(6);
  EXPECT_EQ(rig.session.state(), State::NotReady);
}

TEST(Session, TheNextRequestTakesAnUnacknowledgedResultsPlace) {
  Rig rig;
  rig.bring_to(State::ResultValid);
  rig.request(6);
  EXPECT_EQ(rig.events(), "A6 ");
  EXPECT_FALSE(rig.has(status::kResultValid));
  EXPECT_FALSE(rig.has(status::kScanDone));
}

TEST(Session, SequenceZeroIsNoRequestAndNumbersWrap) {
  Rig rig;
  rig.bring_to(State::Ready);
  rig.request(0);
  EXPECT_EQ(rig.status(), status::kReady);
  EXPECT_EQ(rig.events(), "");
  rig.request(65535);
  EXPECT_EQ(rig.events(), "A65535 ") << "the level still stands when the number comes";
  rig.drop();
  rig.session.publish(Rig::pick(), rig.now);
  rig.request(1);
  EXPECT_EQ(rig.events(), "A1 ");
}

TEST(Session, ANumberThatChangesUnderAStandingRequestIsNotTaken) {
  Rig rig;
  rig.bring_to(State::Ready);
  rig.request(5);
  rig.session.publish(Rig::pick(), rig.now);
  rig.request(6);
  EXPECT_EQ(rig.events(), "A5 ");
  EXPECT_EQ(rig.word(at("ack_sequence")), 5);
  rig.drop();
  rig.request(6);
  EXPECT_EQ(rig.events(), "A6 ");
}

TEST(Session, ARequestStandingAtTheStartIsNotCarriedOut) {
  for (const bool ready : {false, true}) {
    Rig rig;
    if (ready) rig.session.set_not_ready(0, rig.now);
    rig.request(5);
    EXPECT_EQ(rig.code(), ResultCode::ControllerRestarted);
    EXPECT_EQ(rig.word(at("result_sequence")), 5);
    EXPECT_EQ(rig.word(at("ack_sequence")), 5);
    EXPECT_TRUE(rig.has(status::kAck));
    EXPECT_EQ(rig.events(), "C ");
    // Not by waiting, not by another number, not by a new connection: only by 0.
    rig.request(6);
    rig.session.on_closed(1, rig.now);
    ASSERT_TRUE(rig.session.on_accept(1, "127.0.0.1", 2, rig.now));
    rig.request(6);
    rig.session.set_not_ready(0, rig.now);
    EXPECT_EQ(rig.events(), "");
    rig.drop();
    EXPECT_FALSE(rig.has(status::kAck));
    rig.request(6);
    EXPECT_EQ(rig.events(), "A6 ");
  }
}

TEST(Session, AllIsZeroAfterAStart) {
  for (const State state : kAllStates) {
    Rig before;
    before.bring_to(state);
    const Rig after{test::options(), 8};  // the restarted controller
    for (std::uint16_t i = 0; i < kMapLength; ++i) {
      const bool constant =
          i == at("map_version") || i == at("map_length") || (i >= at("test_f32") && i < at("boot_count"));
      if (constant || i == at("boot_count") || i == at("not_ready")) continue;
      EXPECT_EQ(after.word(i), 0) << i;
    }
    EXPECT_EQ(after.word(at("boot_count")), 8);
    EXPECT_EQ(after.word(at("not_ready")), 1 << 8) << "starting";
  }
}

TEST(Session, ALostConnectionDropsTheLevelsAndARetryIsHarmless) {
  Rig rig;
  rig.bring_to(State::Ready);
  rig.request(5);
  EXPECT_EQ(rig.events(), "A5 ");
  rig.session.on_closed(1, rig.now);
  EXPECT_FALSE(rig.has(status::kAck));
  EXPECT_TRUE(rig.session.robot_clear()) << "where the robot stands does not change with the line";
  ASSERT_TRUE(rig.session.on_accept(2, "127.0.0.1", 2, rig.now));
  rig.write(2);
  EXPECT_TRUE(rig.has(status::kAck));
  EXPECT_TRUE(rig.has(status::kBusy));
  EXPECT_EQ(rig.events(), "") << "the same request again: no second sweep";
}

TEST(Session, ScanAndDetectionHaveTheirTimes) {
  Options o = test::options();
  o.scan_timeout = 8s;
  o.detect_timeout = 3s;
  struct Case {
    State state;
    bool clear;
    Duration after;
    Alarm alarm;
  };
  for (const auto& c :
       {Case{State::Scanning, true, 8s, Alarm::ScanTimeout}, Case{State::Scanning, false, 8s, Alarm::RobotNotClear},
        Case{State::Detecting, true, 3s, Alarm::DetectTimeout}}) {
    Rig rig{o};
    rig.bring_to(c.state);
    if (!c.clear) rig.control(0);
    rig.run_for(c.after - 1ms);
    EXPECT_EQ(rig.session.state(), c.state);
    rig.events();
    rig.run_for(1ms);
    EXPECT_EQ(rig.session.state(), State::Fault);
    EXPECT_EQ(rig.events(), "t ");
    EXPECT_EQ(rig.first_alarm(), c.alarm);
    rig.session.publish(Rig::pick(), rig.now);
    EXPECT_FALSE(rig.has(status::kResultValid)) << "too late";
    rig.request(5);
    EXPECT_EQ(rig.code(), ResultCode::Fault);
  }
}

TEST(Session, WhereTheRobotCarriesTheScannerNobodyIsSentToMoveItOutOfTheView) {
  Options o = test::options();
  o.awaits_robot_clear = false;
  Rig rig{o};
  rig.bring_to(State::Scanning);
  rig.control(0);
  rig.run_for(o.scan_timeout);
  EXPECT_EQ(rig.session.state(), State::Fault);
  EXPECT_EQ(rig.first_alarm(), Alarm::ScanTimeout);
}

TEST(Session, AResultNeverExpires) {
  Rig rig;
  rig.bring_to(State::ResultValid);
  rig.run_for(1h);
  EXPECT_TRUE(rig.has(status::kResultValid));
  EXPECT_EQ(rig.word(at("pick_id")), 77);
}

TEST(Session, RobotClearIsALevelTheCellHearsOf) {
  Rig rig;
  rig.control(control::kRobotClear);
  EXPECT_EQ(rig.events(), "C ");
  EXPECT_TRUE(rig.session.robot_clear());
  rig.write();
  EXPECT_EQ(rig.events(), "");
  rig.control(0);
  EXPECT_EQ(rig.events(), "c ");
  EXPECT_FALSE(rig.session.robot_clear());
}

TEST(Session, ReconfiguringChangesIdsBetweenCycles) {
  Rig rig;
  rig.bring_to(State::Ready);
  Options o = test::options();
  o.part_ids = {7};
  o.word_order = WordOrder::LowWordFirst;
  rig.session.reconfigure(o, rig.now);
  rig.request(5, 1);
  EXPECT_EQ(rig.code(), ResultCode::UnknownPart);
  rig.drop();
  rig.request(6, 7);
  EXPECT_EQ(rig.events(), "A6 ");
  EXPECT_EQ(rig.word(at("test_f32")), 0x47F1) << "word order waits for a restart";
}

TEST(Session, AskedForItsDeadlineBeforeAnyTimeWasGivenItAsksForATime) {
  Session session{test::options(), 1};
  ASSERT_EQ(session.deadline(), TimePoint{});
  const TimePoint now{5000s};
  session.on_deadline(now);
  EXPECT_EQ(session.deadline(), now + 500ms);
}
}  // namespace binpick::plc
