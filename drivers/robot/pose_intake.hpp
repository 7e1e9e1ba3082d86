#pragma once

#include <deque>
#include <optional>

#include "drivers/robot/pose_sample.hpp"
#include "drivers/robot/remote_clock.hpp"

namespace binpick::drivers::robot {
/// What all sources of poses do with a pose and its time stamp, whatever the telegram: the sender's clock, the state,
/// the events. The clock outlives a connection: a robot that reconnects is trusted at once, unless its time began anew.
class PoseIntake {
 public:
  void begin();  ///< A new connection: Starting.
  /// T is absent where the robot knows its time but not its pose (an arm without power).
  void on_pose(double sender_s, const std::optional<Transform<frame::Base, frame::Flange>>& T_base_flange,
               TimePoint now);
  void fail(PoseFailed::Why why, std::string text);

  PoseState state() const { return state_; }
  const RemoteClock& clock() const { return clock_; }
  std::optional<PoseEvent> take_event();

 private:
  void push(PoseEvent event);

  PoseState state_ = PoseState::Offline;
  RemoteClock clock_;
  bool is_first_ = true;  // pose of this connection
  std::deque<PoseEvent> events_;
};
}  // namespace binpick::drivers::robot
