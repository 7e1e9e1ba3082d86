#include "drivers/robot/pose_track.hpp"

namespace binpick::drivers::robot {
namespace {
constexpr std::size_t kSamplesMax = 8192;  // 16 s at 500 Hz; a profile waits for its pose for tens of milliseconds

using Pose = Transform<frame::Base, frame::Flange>;

Pose between(const Pose& from, const Pose& to, double part) {
  const Eigen::Quaterniond start{from.iso.linear()}, end{to.iso.linear()};
  Pose pose;
  pose.iso.linear() = start.slerp(part, end).toRotationMatrix();
  pose.iso.translation() = (1 - part) * from.iso.translation() + part * to.iso.translation();
  return pose;
}
}  // namespace

PoseTrack::PoseTrack() : Track{between, gap_max, kSamplesMax} {}
}  // namespace binpick::drivers::robot
