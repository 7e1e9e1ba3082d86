#include "tests/emulators/scanner/lms400_device.hpp"

#include <algorithm>
#include <gtest/gtest.h>
#include <string>
#include <vector>

namespace binpick::emulators {
namespace {
using namespace std::chrono_literals;
using drivers::lms400::Measured;
using drivers::lms400::Message;
using drivers::lms400::Text;

/// Talks to the device as a terminal would, in virtual time.
struct Terminal {
  TimePoint now = TimePoint{} + 60s;
  Lms400 device;
  std::vector<Measured> telegrams;

  explicit Terminal(const Lms400::Options& options = {})
      : device{[](TimePoint, Angle, Angle, std::size_t points) {
                 return ScanLine{std::vector<float>(points, 1234.F), std::vector<std::uint8_t>(points, 77)};
               },
               options} {
    device.on_connected(now);
  }

  std::vector<std::string> run_for(Duration duration) {
    std::vector<std::string> texts;
    const TimePoint end = now + duration;
    while (device.deadline() && *device.deadline() <= end) {
      now = std::max(now, *device.deadline());
      device.on_deadline(now);
      const Bytes out = device.take_output();
      for (ByteView rest = out; !rest.empty();) {
        const auto one = drivers::lms400::decode(rest).value().value();
        if (const Text* text = std::get_if<Text>(&one.message))
          texts.push_back(text->text);
        else
          telegrams.push_back(std::get<Measured>(one.message));
        rest = rest.subspan(one.consumed);
      }
    }
    now = end;
    return texts;
  }
  std::vector<std::string> say(const std::string& text, Duration wait = 100ms) {
    device.on_bytes(encode(Text{text}), now);
    return run_for(wait);
  }
};
using Answers = std::vector<std::string>;

TEST(Lms400Device, AnswersMethodsTwiceAndVariablesOnce) {
  Terminal terminal;
  EXPECT_EQ(terminal.say("sMN mLRstopdata"), (Answers{"sMA mLRstopdata", "sAN mLRstopdata 00000000"}));
  EXPECT_EQ(terminal.say("sMN SetAccessMode 04 81BE23AA"), (Answers{"sMA SetAccessMode", "sAN SetAccessMode 1"}));
  EXPECT_EQ(terminal.say("sMN SetAccessMode 3 F4724744"), (Answers{"sMA SetAccessMode", "sAN SetAccessMode 1"}));
  EXPECT_EQ(terminal.say("sMN SetAccessMode 4 00000000"), (Answers{"sMA SetAccessMode", "sAN SetAccessMode 0"}));
  EXPECT_EQ(terminal.say("sMN SetAccessMode 4 81BE23AA"), (Answers{"sMA SetAccessMode", "sAN SetAccessMode 1"}));
  EXPECT_EQ(terminal.say("sWN FLsel +13"), Answers{"sWA FLsel"});
  EXPECT_EQ(terminal.say("sWN FLmean 0 5"), Answers{"sWA FLmean"});
  EXPECT_EQ(terminal.say("sWN FLrang +700.000000 +3000.000000"), Answers{"sWA FLrang"});
  EXPECT_EQ(terminal.say("sWN MDblex 1"), Answers{"sWA MDblex"});
  EXPECT_EQ(terminal.say("sWN IOencm 2"), Answers{"sWA IOencm"});
  EXPECT_EQ(terminal.say("sRN EIip"), Answers{"sRA EIip C0 A8 0 1"});
  EXPECT_EQ(terminal.say("sRN EImac "), Answers{"sRA EImac 00-06-77-12-34-56"});
  EXPECT_EQ(terminal.say("sRI 3"), Answers{"sRA 0003 0008 12345678"});
  EXPECT_EQ(terminal.say("sMN mSCsetscanconfig +360.00 +0.25 +55.00 +70.00"),
            (Answers{"sMA mSCsetscanconfig", "sAN mSCsetscanconfig 00000000 43B40000 3E800000 00000008"}));
  EXPECT_EQ(terminal.say("sMN Run"), (Answers{"sMA Run", "sAN Run 1"}));
  EXPECT_FALSE(terminal.device.logged_in());
}

TEST(Lms400Device, RefusesWithTheRightCode) {
  Terminal terminal;
  EXPECT_EQ(terminal.say("sMN mNoSuchThing"), Answers{"sFA 2"});
  EXPECT_EQ(terminal.say("sRN NoSuch"), Answers{"sFA 3"});
  EXPECT_EQ(terminal.say("sWN NoSuch 1"), Answers{"sFA 3"});
  EXPECT_EQ(terminal.say("sXX what"), Answers{"sFA C"});
  EXPECT_EQ(terminal.say("sWN MDblex 1"), Answers{"sFA A"}) << "no login yet";
  EXPECT_EQ(terminal.say("sMN mDCreset "), Answers{"sFA 1"});
  EXPECT_EQ(terminal.say("sMN mSCconfigbyang 04 00000000 +0.250000 01 +55.000000 +70.000000"), Answers{"sFA 1"});
  EXPECT_EQ(terminal.say("sMN mLRreqdata"), Answers{"sFA 8"});
  EXPECT_EQ(terminal.say("sMN mLRreqdata 23"), Answers{"sFA 5"});
  EXPECT_EQ(terminal.say("sMN mSCsetscanconfig +360.00 +0.25"), Answers{"sFA 8"});
  for (const char* arguments :
       {"+100.00 +0.25 +55.00 +70.00", "+360.00 +0.05 +55.00 +70.00", "+360.00 +0.25 +50.00 +70.00",
        "+360.00 +0.25 +60.00 +70.00", "fast +0.25 +55.00 +70.00"})
    EXPECT_EQ(terminal.say(std::string{"sMN mSCsetscanconfig "} + arguments), Answers{"sFA 5"}) << arguments;
  terminal.say("sMN SetAccessMode 4 81BE23AA");
  EXPECT_EQ(terminal.say("sWN MDblex"), Answers{"sFA 8"});
  EXPECT_EQ(terminal.say("sWN MDblex 2"), Answers{"sFA 5"});
  EXPECT_EQ(terminal.say("sWN FLsel +16"), Answers{"sFA 5"});
}

TEST(Lms400Device, IsBusyWhileTheMotorChangesItsSpeed) {
  Terminal terminal;
  EXPECT_EQ(terminal.say("sMN mSCsetscanconfig +250.00 +0.50 +70.00 +40.00"), Answers{"sMA mSCsetscanconfig"});
  EXPECT_EQ(terminal.say("sMN mLRreqdata 20"), Answers{"sFA D"});
  EXPECT_EQ(terminal.say("sRN EIip"), Answers{"sRA EIip C0 A8 0 1"}) << "reading goes on";
  EXPECT_EQ(terminal.run_for(2s), Answers{"sAN mSCsetscanconfig 00000000 437A0000 3F000000 00000008"});
}

TEST(Lms400Device, PairItCannotDoComesBackWithAnError) {
  Terminal terminal;
  EXPECT_EQ(terminal.say("sMN mSCsetscanconfig +500.00 +0.10 +55.00 +70.00"),
            (Answers{"sMA mSCsetscanconfig", "sAN mSCsetscanconfig 00000001 43B40000 3E800000 00000008"}));
}

TEST(Lms400Device, StreamsInEachFormatUntilStopped) {
  for (const auto& [format, has_distance, has_remission] :
       {std::tuple{"20", true, true}, {"0021", true, false}, {"22", false, true}}) {
    Terminal terminal;
    EXPECT_EQ(terminal.say(std::string{"sMN mLRreqdata "} + format),
              (Answers{"sMA mLRreqdata", "sAN mLRreqdata 00000000"}));
    terminal.run_for(900ms);
    ASSERT_GT(terminal.telegrams.size(), 340U);
    for (std::size_t i = 0; i < terminal.telegrams.size(); ++i) {
      const Measured& m = terminal.telegrams[i];
      EXPECT_EQ(m.distance.size(), has_distance ? 280U : 0U);
      EXPECT_EQ(m.remission.size(), has_remission ? 280U : 0U);
      EXPECT_EQ(m.start_1e4deg, 550000);
      EXPECT_EQ(m.step_1e4deg, 2500);
      EXPECT_EQ(m.frequency_hz, 360);
      if (has_distance) {
        EXPECT_EQ(m.distance[9], 1234);
      }
      if (i > 0) {
        EXPECT_EQ(m.counter(), static_cast<std::uint16_t>(terminal.telegrams[i - 1].counter() + 1));
      }
    }
    terminal.say("sMN mLRstopdata");
    const auto count = terminal.telegrams.size();
    terminal.run_for(1s);
    EXPECT_EQ(terminal.telegrams.size(), count);
  }
}

TEST(Lms400Device, LosesScansRatherThanSendsThemLate) {
  Terminal terminal;
  terminal.say("sMN mLRreqdata 20", 1s);
  const auto counted = [&] { return terminal.telegrams.back().counter(); };
  const std::size_t before = terminal.telegrams.size();
  const int last = counted();
  EXPECT_GT(before, 300U);
  terminal.now += 50ms;  // the machine was busy
  terminal.run_for(1ms);
  EXPECT_LE(terminal.telegrams.size(), before + 2);
  EXPECT_NEAR(counted() - last, 18, 1);
}

TEST(Lms400Device, CommandWithAWrongChecksumIsDroppedOrTakenAsSet) {
  for (const bool checks : {true, false}) {
    Lms400::Options options;
    options.checks_checksum = checks;
    Terminal terminal{options};
    Bytes frame = encode(Text{"sMN mLRstopdata"});
    frame.back() ^= std::byte{1};
    terminal.device.on_bytes(frame, terminal.now);
    EXPECT_EQ(terminal.run_for(100ms).size(), checks ? 0U : 2U);
    EXPECT_EQ(terminal.device.commands_dropped() > 0, checks);
    EXPECT_EQ(terminal.say("sMN mLRstopdata").size(), 2U) << "the next one is understood";
  }
}

TEST(Lms400Device, CommandsMayComeInAnySegments) {
  Terminal terminal;
  Bytes both = encode(Text{"sMN mLRstopdata"});
  append(both, encode(Text{"sMN SetAccessMode 4 81BE23AA"}));
  for (const std::byte b : both) terminal.device.on_bytes({&b, 1}, terminal.now);
  EXPECT_EQ(terminal.run_for(100ms).size(), 4U);
}

TEST(Lms400Device, ResetAnswersOnceAndClosesTheConnection) {
  Terminal terminal;
  terminal.say("sMN SetAccessMode 4 81BE23AA");
  terminal.device.on_bytes(encode(Text{"sMN mDCreset "}), terminal.now);
  EXPECT_EQ(drivers::lms400::decode(terminal.device.take_output()).value().value().message,
            Message{Text{"sMA mDCreset"}});
  EXPECT_TRUE(terminal.device.wants_close());
  terminal.device.on_disconnected(terminal.now);
  EXPECT_FALSE(terminal.device.wants_close());
  terminal.device.on_connected(terminal.now);
  EXPECT_FALSE(terminal.device.logged_in());
}
}  // namespace
}  // namespace binpick::emulators
