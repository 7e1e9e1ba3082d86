#include <gtest/gtest.h>
#include <string>
#include <vector>

#include "base/bytes.hpp"
#include "base/clock.hpp"
#include "base/frames.hpp"
#include "base/lock_file.hpp"
#include "base/log.hpp"
#include "base/peer_address.hpp"
#include "base/units.hpp"

namespace binpick {
TEST(Units, AreNamedAtBothEnds) {
  EXPECT_DOUBLE_EQ(Length::m(1.5).in_mm(), 1500.0);
  EXPECT_DOUBLE_EQ(Length::mm(3).in_m(), 0.003);
  EXPECT_NEAR(Angle::deg(180).in_rad(), 3.14159265358979, 1e-14);
  EXPECT_LT(Angle::deg(1), Angle::rad(1));
}

TEST(LockFile, OneHoldsItAndOthersSeeIt) {
  const std::string path = testing::TempDir() + "binpick-lock-test";
  EXPECT_FALSE(LockFile::is_held(path));
  {
    const LockFile first{path};
    EXPECT_FALSE(first.held_by_another());
    EXPECT_TRUE(LockFile::is_held(path));
    const LockFile second{path};
    EXPECT_TRUE(second.held_by_another());
  }
  EXPECT_FALSE(LockFile::is_held(path)) << "whoever ends lets go";
  const LockFile nowhere{"/nonexistent/lock"};
  EXPECT_FALSE(nowhere.held_by_another());
}

TEST(Bytes, BothOrders) {
  Bytes out;
  append_le<std::uint16_t>(out, 0x1234);
  append_be<std::uint32_t>(out, 0xA1B2C3D4);
  ASSERT_EQ(out, (Bytes{std::byte{0x34}, std::byte{0x12}, std::byte{0xA1}, std::byte{0xB2}, std::byte{0xC3},
                        std::byte{0xD4}}));
  EXPECT_EQ(read_le<std::uint16_t>(out, 0), 0x1234);
  EXPECT_EQ(read_be<std::uint32_t>(out, 2), 0xA1B2C3D4);
  EXPECT_EQ(read_le<std::int16_t>(Bytes{std::byte{0xFE}, std::byte{0xFF}}, 0), -2);
}

TEST(Bytes, FloatsByTheirBits) {
  Bytes out;
  append_f32_le(out, 0.5F);
  EXPECT_EQ(out, (Bytes{std::byte{0}, std::byte{0}, std::byte{0}, std::byte{0x3F}}));
  EXPECT_EQ(read_f32_le(out, 0), 0.5F);
}

TEST(Frames, NeighboursCancel) {
  Transform<frame::Base, frame::Scanner> T_base_scanner;
  T_base_scanner.iso.translation() = Eigen::Vector3d{0, 0, 1000};
  Transform<frame::Scanner, frame::Object> T_scanner_object;
  T_scanner_object.iso.translation() = Eigen::Vector3d{1, 2, 3};
  const Transform<frame::Base, frame::Object> T_base_object = T_base_scanner * T_scanner_object;
  EXPECT_TRUE((T_base_object * Eigen::Vector3d::Zero()).isApprox(Eigen::Vector3d{1, 2, 1003}));
  EXPECT_TRUE((T_base_object.inverse() * Eigen::Vector3d{1, 2, 1003}).isZero(1e-12));
}

TEST(Clock, EarlierOfTwoDeadlines) {
  const TimePoint a{std::chrono::seconds(1)};
  const TimePoint b{std::chrono::seconds(2)};
  EXPECT_EQ(earlier(a, b), a);
  EXPECT_EQ(earlier(std::nullopt, b), b);
  EXPECT_EQ(earlier(std::nullopt, std::nullopt), std::nullopt);
}

TEST(Log, OneEventIsOneLineAndThresholdHolds) {
  std::vector<std::string> lines;
  log::set_sink([&](log::Level, std::string_view topic, std::string_view text) {
    lines.emplace_back(topic);
    lines.back().append(": ").append(text);
  });
  BINPICK_LOG(Info, "plc", "request\nraised, cycle=%d", 118);
  BINPICK_LOG(Debug, "plc", "not shown");
  log::set_sink({});
  ASSERT_EQ(lines.size(), 1U);
  EXPECT_EQ(lines[0], "plc: request raised, cycle=118");
}

TEST(PeerAddress, IsAllowedInWhateverSpelling) {
  const std::vector<std::string> allow{"2001:DB8:0::1", "::ffff:10.0.0.5"};
  EXPECT_TRUE(may_connect(allow, "2001:db8::1"));
  EXPECT_TRUE(may_connect(allow, "10.0.0.5"));
  EXPECT_FALSE(may_connect(allow, "10.0.0.6"));
  EXPECT_TRUE(may_connect({}, "127.0.0.1") && may_connect({}, "127.0.1.1") && may_connect({}, "::1"));
  EXPECT_FALSE(may_connect({}, ""));
}
}  // namespace binpick
