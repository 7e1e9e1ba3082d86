#include "drivers/scanner/lps36/pairing.hpp"

#include <gtest/gtest.h>
#include <random>

namespace binpick::drivers::lps36 {
namespace {
using namespace std::chrono_literals;
using Counts = Pairing::Counts;
using Part = Measured::Part;

struct Bench {
  Pairing pairing{30ms};
  TimePoint now = TimePoint{} + 1h;
  std::vector<std::uint16_t> scans;

  void say(Part part, std::uint16_t scan) {
    Measured m;
    m.part = part;
    m.scan = scan;
    m.encoder = 1000U + scan;
    if (part != Part::X) m.z.assign(376, scan);
    if (part != Part::Z) m.x.assign(376, static_cast<std::int16_t>(-scan));
    pairing.add(m, now);
    take();
  }
  void z(std::uint16_t scan) { say(Part::Z, scan); }
  void x(std::uint16_t scan) { say(Part::X, scan); }
  void both(std::uint16_t scan) { z(scan), x(scan); }
  void wait(Duration time) {
    now += time;
    pairing.on_deadline(now);
    take();
  }
  void take() {
    while (const auto line = pairing.take_line()) {
      scans.push_back(line->scan);
      EXPECT_EQ(line->encoder, 1000U + line->scan);
      EXPECT_EQ(line->z.at(0), line->scan);
      EXPECT_EQ(line->x.at(0), static_cast<std::int16_t>(-line->scan));
    }
  }
  void expect(const std::vector<std::uint16_t>& handed_out, Counts counts) {
    EXPECT_EQ(scans, handed_out);
    counts.lines = handed_out.size();
    EXPECT_EQ(pairing.counts(), counts);
  }
};

TEST(Lps36Pairing, ZAndXOfTheSameScanAreALine) {
  Bench bench;
  bench.z(7);
  EXPECT_TRUE(bench.scans.empty());
  bench.x(7);
  bench.both(8);
  bench.expect({7, 8}, {});
  EXPECT_EQ(bench.pairing.deadline(), std::nullopt);
}

TEST(Lps36Pairing, TheNumberWraps) {
  Bench bench;
  for (const int scan : {65534, 65535, 0, 1}) bench.both(static_cast<std::uint16_t>(scan));
  bench.expect({65534, 65535, 0, 1}, {});
}

TEST(Lps36Pairing, OvertakenHalvesAreWaitedForAndTheOrderIsKept) {
  Bench bench;
  bench.both(1);
  bench.z(2);
  bench.both(3);
  bench.x(4);
  EXPECT_EQ(bench.scans.size(), 1U) << "3 waits for 2";
  bench.wait(20ms);
  bench.x(2);
  bench.z(4);
  bench.expect({1, 2, 3, 4}, {.overtaken = 2});
}

TEST(Lps36Pairing, WhatIsMissingIsGivenUpAfterItsTime) {
  Bench bench;
  bench.both(1);
  bench.z(2);  // its X is lost; 3 is lost as a whole
  bench.wait(10ms);
  EXPECT_EQ(bench.pairing.deadline(), std::nullopt) << "nothing newer has come";
  bench.both(4);
  EXPECT_EQ(bench.pairing.deadline(), bench.now + 30ms);
  bench.wait(29ms);
  EXPECT_EQ(bench.scans.size(), 1U);
  bench.wait(1ms);
  bench.expect({1, 4}, {.lost = 2, .halves = 1});
}

TEST(Lps36Pairing, WhatComesTooLateAndWhatComesTwiceAreToldApart) {
  Bench bench;
  bench.both(1);
  bench.x(1);  // again, after it was handed out
  bench.z(2);
  bench.z(2);  // again, while it waits
  bench.both(3);
  bench.wait(30ms);
  bench.x(2);  // late
  bench.x(2);  // and again
  bench.z(2);
  bench.expect({1, 3}, {.lost = 1, .halves = 1, .late = 1, .duplicates = 4});
}

TEST(Lps36Pairing, BeforeTheFirstLineNothingIsLost) {
  Bench bench;
  bench.x(10);  // its Z went before we listened
  bench.z(12);
  bench.z(9);  // older, in time
  bench.wait(30ms);
  bench.x(12);
  bench.expect({12}, {.overtaken = 1});
}

TEST(Lps36Pairing, TheFirstLineMayBeOlderThanTheFirstTelegram) {
  Bench bench;
  bench.z(11);
  bench.both(10);
  bench.x(11);
  bench.expect({10, 11}, {.overtaken = 2});
}

TEST(Lps36Pairing, AZxTelegramIsAWholeLine) {
  Bench bench;
  bench.say(Part::Both, 5);
  bench.say(Part::Both, 5);
  bench.say(Part::Both, 7);
  bench.wait(30ms);
  bench.expect({5, 7}, {.lost = 1, .duplicates = 1});
}

TEST(Lps36Pairing, AStrayNumberIsPutAsideAndASecondOneBeginsAnew) {
  Bench bench;
  bench.both(20000);
  bench.z(5);
  bench.both(20001);
  bench.expect({20000, 20001}, {.strays = 1});
  bench.z(0);  // the sensor was switched off and on
  bench.x(0);
  bench.both(1);
  bench.expect({20000, 20001, 0, 1}, {.strays = 1, .jumps = 1});
}

TEST(Lps36Pairing, ARepeatedStrayIsNoNewBeginning) {
  Bench bench;
  bench.both(20000);
  bench.z(5);
  bench.z(5);
  bench.both(20001);
  bench.expect({20000, 20001}, {.strays = 2});
}

TEST(Lps36Pairing, FlushHandsOutWhatIsWholeAndForgetsTheRest) {
  Bench bench;
  bench.both(1);
  bench.z(2);
  bench.both(3);
  bench.z(4);  // stopped between Z and X
  bench.pairing.flush();
  bench.take();
  bench.expect({1, 3}, {.lost = 1, .halves = 1});
  EXPECT_EQ(bench.pairing.deadline(), std::nullopt);
}

TEST(Lps36Pairing, WaitsForNoMoreThanAFewLines) {
  Bench bench;
  bench.both(1);
  for (std::uint16_t scan = 3; scan < 80; ++scan) bench.both(scan);  // all at once: no time passes
  EXPECT_EQ(bench.scans.size(), 78U);
  EXPECT_EQ(bench.pairing.counts().lost, 1U);
}

/// Any order, any loss: every scan is handed out at most once and in order, and the counts add up.
TEST(Lps36Pairing, CountsAddUpWhateverComes) {
  for (std::uint64_t seed = 1; seed <= 200; ++seed) {
    SCOPED_TRACE(seed);
    std::mt19937_64 random{seed};
    Bench bench;
    std::uint64_t telegrams = 0;
    for (int i = 0; i < 2000; ++i) {
      const auto scan = static_cast<std::uint16_t>(65000 + i / 4 + static_cast<int>(random() % 13) - 6);
      ++telegrams;
      bench.say(random() % 2 == 0 ? Part::Z : Part::X, scan);
      if (random() % 3 == 0) bench.wait(std::chrono::milliseconds(random() % 12));
    }
    bench.both(static_cast<std::uint16_t>(65000 + 2000 / 4 + 10));
    telegrams += 2;
    bench.wait(1s);
    const Counts counts = bench.pairing.counts();
    ASSERT_FALSE(bench.scans.empty());
    for (std::size_t i = 1; i < bench.scans.size(); ++i) {
      const auto step = static_cast<std::uint16_t>(bench.scans[i] - bench.scans[i - 1]);
      EXPECT_TRUE(step > 0 && step < 256) << i;
    }
    const auto span = static_cast<std::uint16_t>(bench.scans.back() - bench.scans.front());
    EXPECT_EQ(counts.lines, bench.scans.size());
    EXPECT_EQ(counts.lines + counts.lost, span + 1U);
    EXPECT_EQ(counts.strays + counts.jumps, 0U);
    EXPECT_LE(2 * counts.lines + counts.halves + counts.late + counts.duplicates, telegrams);
  }
}
}  // namespace
}  // namespace binpick::drivers::lps36
