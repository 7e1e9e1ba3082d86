#include "drivers/sweep/robot_carrier.hpp"

#include <gtest/gtest.h>

#include "drivers/robot/codec.hpp"

namespace binpick::drivers::sweep {
namespace {
constexpr TimePoint kStart{std::chrono::hours(1)};

TEST(RobotCarrier, NumbersItsScansFromWhereItIsToldAndNeverZero) {
  robot::Session session{robot::Options{}};
  robot::PoseSource poses{robot::PoseSource::Options{}};
  session.on_connected(kStart);
  RobotCarrier carrier{session, poses, 65534};
  for (const int scan : {65535, 1, 2}) {
    carrier.go_to_start(kStart);
    session.on_bytes(as_bytes("fetch\n"), kStart);
    const Bytes output = session.take_output();
    const auto answer = robot::decode_reply(as_text(output), robot::Dialect::UniversalRobots);
    ASSERT_TRUE(answer && *answer);
    EXPECT_EQ((*answer)->reply.status, robot::Status::Scan);
    EXPECT_EQ((*answer)->reply.pick.pick_id, scan);
  }
}
}  // namespace
}  // namespace binpick::drivers::sweep
