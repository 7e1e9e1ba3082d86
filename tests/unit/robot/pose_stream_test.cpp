#include "drivers/robot/pose_stream.hpp"

#include <cstdio>
#include <gtest/gtest.h>

#include "base/log.hpp"
#include "drivers/robot/codec.hpp"
#include "drivers/robot/pose_source.hpp"
#include "tests/emulators/robot/pose_sender.hpp"
#include "tests/emulators/robot/rtde_device.hpp"
#include "tests/unit/robot/pose_link.hpp"

namespace binpick::drivers::robot {
namespace {
using namespace std::chrono_literals;
using emulators::PoseSender;
using Why = PoseFailed::Why;

// One pose in the conventions of the makes: the rotation of the last of the vectors in
// tests/unit/base/rotation_test.cpp.
struct LineBytes {
  Dialect dialect;
  const char* text;
};
const LineBytes kLines[] = {
    {Dialect::Fanuc, "pose 17 123456.0 1234.568 -250.000 600.000 175.0000 -12.0000 -100.0000\r\n"},
    {Dialect::Kawasaki, "pose 17 123456.0 1234.568 -250.000 600.000 -122.8212 167.0141 157.7046\r\n"},
    {Dialect::UniversalRobots, "pose 17 123456.0 1.234568 -0.250000 0.600000 1.8690257 -2.2482907 0.0997368\r\n"},
};

PoseLine example() {
  PoseLine line{17, 123456, Eigen::Isometry3d::Identity()};
  line.T_base_sent.translation() = Eigen::Vector3d{1234.568, -250, 600};
  line.T_base_sent.linear() = from_wpr_deg({175, -12, -100});
  return line;
}

std::string bare(std::string text) {
  while (!text.empty() && text.back() < ' ') text.pop_back();
  return text;
}

class PoseStreamTest : public testing::TestWithParam<Dialect> {
 protected:
  using Link = PoseLink<PoseStream, PoseSender>;
  PoseStreamTest() {
    log::set_sink([](log::Level, std::string_view, std::string_view) {});
  }
  ~PoseStreamTest() override { log::set_sink({}); }

  static PoseSender::Options sender_options(Dialect dialect) {
    PoseSender::Options o;
    o.dialect = dialect;
    o.clock = {.drift_ppm = -50, .first_s = 77.7, .started = kLinkStart - 1h};
    return o;
  }
  Link link(PoseSender::Options options) const {
    return Link{PoseStream{{.dialect = options.dialect, .T_flange_tcp = options.T_flange_tcp}},
                PoseSender{swing, options}};
  }
  Link link() const { return link(sender_options(GetParam())); }
};
INSTANTIATE_TEST_SUITE_P(Makes, PoseStreamTest, testing::Values(Dialect::Fanuc, Dialect::Kawasaki),
                         [](const auto& each) { return each.param == Dialect::Fanuc ? "fanuc" : "kawasaki"; });
}  // namespace

TEST(PoseLine, EachLineIsTheseBytesAndIsReadBack) {
  for (const LineBytes& l : kLines) {
    const std::string text = encode(example(), l.dialect);
    EXPECT_EQ(text, l.text);
    const auto line = decode_pose_line(bare(l.text), l.dialect);
    ASSERT_TRUE(line.has_value()) << to_string(line.error());
    EXPECT_EQ(line->sequence, 17);
    EXPECT_EQ(line->time_ms, 123456);
    EXPECT_TRUE(line->T_base_sent.isApprox(example().T_base_sent, 1e-5));
    EXPECT_LE(text.size(), 126U);
  }
}

TEST(PoseLine, WhatControllersWriteIsRead) {
  // Blanks in front of numbers ($ENCODE, CNV_REAL_STR), whole numbers, no fraction, angles beyond half a turn.
  const auto line = decode_pose_line("pose     5   99.   1000.00    -3.5    .5  180  0.00 -180.00  ", Dialect::Fanuc);
  ASSERT_TRUE(line.has_value());
  EXPECT_EQ(line->sequence, 5);
  EXPECT_EQ(line->time_ms, 99);
  EXPECT_TRUE(decode_pose_line("pose 0 0 0 0 0 359.9 0 0", Dialect::Kawasaki).has_value());
}

TEST(PoseLine, WhatIsNoPoseSaysWhy) {
  using Kind = BadPoseLine::Kind;
  const auto kind = [](std::string_view text) { return decode_pose_line(text, Dialect::Fanuc).error().kind; };
  EXPECT_EQ(kind(""), Kind::NotAPose);
  EXPECT_EQ(kind("fetch"), Kind::NotAPose);
  EXPECT_EQ(kind("pose"), Kind::NotAPose);
  EXPECT_EQ(kind("poses 1 2 3 4 5 6 7 8"), Kind::NotAPose);
  EXPECT_EQ(kind("pose 1 2 3 4 5 6 7"), Kind::WrongCount);
  EXPECT_EQ(kind("pose 1 2 3 4 5 6 7 8 9"), Kind::WrongCount);
  EXPECT_EQ(kind("pose 1 2 3 4 5 6 7 x"), Kind::WrongCount);
  EXPECT_EQ(kind("pose 1 2 3 4 5 6 7 nan"), Kind::WrongCount);
  EXPECT_EQ(kind("pose 1 2 3 4 5 6 7 1e3"), Kind::WrongCount);
  EXPECT_EQ(kind("pose 1 2 3 4 ****** 6 7 8"), Kind::WrongCount) << "what AS writes where a field is too narrow";
  EXPECT_EQ(kind("pose 10000 2 3 4 5 6 7 8"), Kind::BadNumber);
  EXPECT_EQ(kind("pose 1.5 2 3 4 5 6 7 8"), Kind::BadNumber);
  EXPECT_EQ(kind("pose -1 2 3 4 5 6 7 8"), Kind::BadNumber);
  EXPECT_EQ(kind("pose 1 10000000 3 4 5 6 7 8"), Kind::BadNumber);
  EXPECT_EQ(kind("pose 1 2 100000 4 5 6 7 8"), Kind::BadNumber);
  EXPECT_EQ(kind("pose 1 2 3 4 5 361 7 8"), Kind::BadNumber);
  EXPECT_EQ(kind("pose 1 2 3 4 5 6 7 8" + std::string(120, ' ')), Kind::TooLong);
  for (const Kind k : {Kind::TooLong, Kind::NotAPose, Kind::WrongCount, Kind::BadNumber})
    EXPECT_FALSE(to_string(BadPoseLine{k}).empty());
}

TEST(PoseLine, EachPrefixWaitsAndEachSplitIsTheSame) {
  for (const LineBytes& l : kLines) {
    const std::string text = l.text;
    for (std::size_t split = 0; split <= text.size(); ++split) {
      PoseStream stream{{.dialect = l.dialect}};
      stream.on_connected(kLinkStart);
      stream.on_bytes(as_bytes(text.substr(0, split)), kLinkStart + 1ms);
      EXPECT_EQ(stream.deadline(), kLinkStart + (split >= text.size() - 1 ? 501ms : 500ms)) << split;
      stream.on_bytes(as_bytes(text.substr(split)), kLinkStart + 2ms);
      EXPECT_EQ(stream.bad_lines(), 0U);
      EXPECT_EQ(stream.deadline(), kLinkStart + (split >= text.size() - 1 ? 501ms : 502ms)) << split;
    }
  }
}

TEST(PoseLine, EachCorruptedByteIsRefusedOrAPoseInRange) {
  for (const LineBytes& l : kLines) {
    const std::string good = bare(l.text);
    for (std::size_t at = 0; at < good.size(); ++at)
      for (int value = 0; value < 256; ++value) {
        std::string corrupted = good;
        corrupted[at] = static_cast<char>(value);
        const auto line = decode_pose_line(corrupted, l.dialect);
        if (!line) continue;
        ASSERT_LT(line->sequence, kPoseSequences);
        ASSERT_LT(line->T_base_sent.translation().cwiseAbs().maxCoeff(), kLengthMax_mm);
        const Eigen::Matrix3d R = line->T_base_sent.linear();
        ASSERT_TRUE((R * R.transpose()).isIdentity(1e-9));
      }
  }
}

TEST_P(PoseStreamTest, StreamsPosesWithTheTimeOfTheFlange) {
  Link l = link();
  l.run_for(60s);
  EXPECT_EQ(l.source.state(), PoseState::Streaming);
  ASSERT_EQ(l.ready.size(), 1U);
  EXPECT_TRUE(l.failed.empty());
  EXPECT_GT(l.samples.size(), 2600U);
  EXPECT_EQ(l.source.lines_lost(), 0U);
  EXPECT_EQ(l.source.bad_lines(), 0U);
  // 314 mm/s: the clock's step of 2 ms is 0.63 mm of that.
  EXPECT_LT(l.worst_mm(), 1.0);
  std::printf("  worst %.3f mm at up to 314 mm/s with a clock step of 2 ms\n", l.worst_mm());
}

TEST_P(PoseStreamTest, AFineClockGivesFineTimes) {
  auto options = sender_options(GetParam());
  options.clock_step_ms = 0.1;
  Link l = link(options);
  l.run_for(60s);
  EXPECT_LT(l.worst_mm(), 0.35);
  std::printf("  worst %.3f mm at up to 314 mm/s with a clock step of 0.1 ms\n", l.worst_mm());
}

TEST_P(PoseStreamTest, ThePoseOfATcpIsTakenBackToTheFlange) {
  auto options = sender_options(GetParam());
  options.T_flange_tcp.iso.translation() = Eigen::Vector3d{10, -20, 180};
  options.T_flange_tcp.iso.linear() = from_wpr_deg({5, -10, 90});
  Link l = link(options);
  l.run_for(10s);
  ASSERT_FALSE(l.samples.empty());
  EXPECT_LT(l.worst_mm(), 1.0);
}

TEST_P(PoseStreamTest, LostAndBadLinesAreCountedAndDoNoHarm) {
  Link l = link();
  l.run_for(8s);
  l.sender.lose(3);
  l.run_for(1s);
  EXPECT_EQ(l.source.lines_lost(), 3U);
  const std::size_t before = l.samples.size();
  l.source.on_bytes(as_bytes("pose 1 2 3\r\n\x01\x02\r\n" + std::string(300, '9') + "\r\n"), l.now);
  l.run_for(1s);
  EXPECT_EQ(l.source.bad_lines(), 3U);
  EXPECT_GT(l.samples.size(), before + 40);
  EXPECT_TRUE(l.failed.empty());
  EXPECT_LT(l.worst_mm(), 1.0);
}

TEST_P(PoseStreamTest, LineNumbersAndTimeWrapWithoutALoss) {
  auto options = sender_options(GetParam());
  options.clock.first_s = 9990;
  options.clock.started = kLinkStart;
  Link l = link(options);
  l.run_for(240s);  // the clock begins anew at 10 000 s, the line numbers at 200 s
  EXPECT_EQ(l.ready.size(), 1U);
  EXPECT_TRUE(l.failed.empty()) << l.failed[0].text;
  EXPECT_EQ(l.source.lines_lost(), 0U);
  EXPECT_LT(l.worst_mm(), 1.0);
}

TEST_P(PoseStreamTest, SilenceIsAFaultAndSaysWhetherLinesCame) {
  Link l = link();
  l.run_for(8s);
  l.sender.faults.silent = true;
  l.run_for(510ms);
  ASSERT_EQ(l.failed.size(), 1U);
  EXPECT_EQ(l.failed[0].why, Why::Silent);
  EXPECT_NE(l.failed[0].text.find("background program runs"), std::string::npos);

  PoseStream other{{.dialect = GetParam()}};
  other.on_connected(kLinkStart);
  for (int i = 0; i < 10; ++i) other.on_bytes(as_bytes("hello\r\n"), kLinkStart + i * 40ms);
  other.on_deadline(kLinkStart + 500ms);
  const auto event = other.take_event();
  ASSERT_TRUE(event.has_value());
  EXPECT_NE(std::get<PoseFailed>(*event).text.find("10 lines that are none"), std::string::npos);
  EXPECT_TRUE(other.take_reopen());
}

TEST_P(PoseStreamTest, ANewConnectionReplacesTheOldOneAndIsTrustedAtOnce) {
  Link l = link();
  l.run_for(8s);
  l.source.on_connected(l.now);  // the controller lost its power; nobody closed the old connection
  l.sender.restart(false, l.now);
  l.run_for(1s);
  EXPECT_EQ(l.source.lines_lost(), 0U) << "numbers of another connection say nothing";
  EXPECT_EQ(l.source.state(), PoseState::Streaming);
  EXPECT_GE(l.ready.size(), 2U);
  EXPECT_LT(l.worst_mm(), 1.0);
}

TEST_P(PoseStreamTest, ARestartedClockIsLearntAnew) {
  Link l = link();
  l.run_for(8s);
  l.sender.restart(true, l.now);
  const std::size_t before = l.samples.size();
  l.run_for(3s);
  EXPECT_EQ(l.samples.size(), before);
  l.run_for(5s);
  EXPECT_GT(l.samples.size(), before);
  EXPECT_LT(l.worst_mm(), 1.0);
  ASSERT_EQ(l.failed.size(), 1U);
  EXPECT_EQ(l.failed[0].why, Why::LinkLost);
}

TEST_P(PoseStreamTest, AClockThatJumpsInTheMiddleIsAFault) {
  PoseStream stream{{.dialect = GetParam()}};
  stream.on_connected(kLinkStart);
  PoseLine line = example();
  for (int i = 0; i < 1000; ++i) {
    line.sequence = static_cast<std::uint16_t>(i);
    line.time_ms = 20 * i + (i < 500 ? 0 : 700);
    stream.on_bytes(as_bytes(encode(line, GetParam())), kLinkStart + i * 20ms);
  }
  std::vector<Why> why;
  while (const auto event = stream.take_event())
    if (const auto* failed = std::get_if<PoseFailed>(&*event)) why.push_back(failed->why);
  EXPECT_EQ(why, std::vector<Why>{Why::ClockJumped});
  EXPECT_TRUE(stream.take_reopen());
}

TEST_P(PoseStreamTest, TwoProgramsThatSendAtOnceAreToldOnce) {
  int lines_logged = 0;
  log::set_sink([&](log::Level, std::string_view, std::string_view) { ++lines_logged; });
  PoseStream stream{{.dialect = GetParam()}};
  stream.on_connected(kLinkStart);
  PoseLine line = example();
  for (int i = 0; i < 200; ++i) {
    line.sequence = static_cast<std::uint16_t>(i);
    line.time_ms = 20 * i + (i % 2 == 0 ? 0 : 5000);
    stream.on_bytes(as_bytes(encode(line, GetParam())), kLinkStart + i * 20ms);
  }
  EXPECT_EQ(stream.state(), PoseState::Offline);
  const auto event = stream.take_event();
  ASSERT_TRUE(event.has_value());
  EXPECT_EQ(std::get<PoseFailed>(*event).why, Why::ClockJumped);
  EXPECT_FALSE(stream.take_event().has_value());
  EXPECT_LE(lines_logged, 2);
}

TEST_P(PoseStreamTest, ItDoesNotMatterHowTheLinesAreCut) {
  Link l = link();
  l.sender.faults.split_every_byte = true;
  l.run_for(8s);
  EXPECT_EQ(l.ready.size(), 1U);
  EXPECT_EQ(l.source.bad_lines(), 0U);
  l.sender.faults.split_every_byte = false;
  for (std::size_t bytes = 1; bytes < 160; ++bytes) {
    l.sender.faults.disconnect_after_bytes = bytes;
    l.sender.cut();
    l.run_for(1200ms);
  }
  EXPECT_LT(l.worst_mm(), 1.0);
  EXPECT_EQ(l.source.bad_lines(), 0U) << "half a line of a lost connection is no line";
}

TEST_P(PoseStreamTest, GarbageIsOutlived) {
  Link l = link();
  l.run_for(8s);
  l.sender.faults.garbage = true;
  l.run_for(10s);
  EXPECT_GT(l.source.bad_lines(), 100U);
  for (const auto& s : l.samples) ASSERT_TRUE(s.T_base_flange.iso.matrix().allFinite());
  l.sender.faults.garbage = false;
  l.run_for(20s);
  EXPECT_EQ(l.source.state(), PoseState::Streaming);
}

/// The same sweep would run on either source: nothing of the make is left.
TEST(PoseSource, HasOneFaceForAllMakes) {
  const auto check = [](auto sender, const PoseSource::Options& options, bool cell_connects) {
    PoseLink<PoseSource, decltype(sender)> l{PoseSource{options}, std::move(sender)};
    EXPECT_EQ(l.source.cell_connects(), cell_connects);
    EXPECT_EQ(l.source.state(), PoseState::Offline);
    l.run_for(1s);
    EXPECT_EQ(l.source.state(), PoseState::Starting);
    l.run_for(9s);
    EXPECT_EQ(l.source.state(), PoseState::Streaming);
    EXPECT_EQ(l.ready.size(), 1U);
    EXPECT_GT(l.samples.size(), 100U);
    EXPECT_LT(l.worst_mm(), 1.0);
    EXPECT_TRUE(l.source.uncertainty().has_value());
    EXPECT_EQ(l.source.trouble(), "");
  };
  emulators::RtdeDevice::Options rtde;
  rtde.clock.started = kLinkStart - 1h;
  check(emulators::RtdeDevice{swing, rtde}, rtde::Options{}, true);
  PoseSender::Options lines;
  lines.clock.started = kLinkStart - 1h;
  check(PoseSender{swing, lines}, PoseStreamOptions{}, false);
}
}  // namespace binpick::drivers::robot
