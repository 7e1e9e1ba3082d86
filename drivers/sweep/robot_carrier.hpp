#pragma once

#include "drivers/robot/pose_source.hpp"
#include "drivers/robot/pose_track.hpp"
#include "drivers/robot/session.hpp"
#include "drivers/sweep/carrier.hpp"

namespace binpick::drivers::sweep {
/// The robot as the carrier of a sweep: its program runs a taught path and says where it begins and ends (robot's line
/// protocol); where the flange is meanwhile comes from its pose source.
class RobotCarrier final : public Carrier {
 public:
  /// Scans are numbered from after `last_scan` on: a robot that still has one of an earlier run of the daemon must not
  /// take it for ours.
  RobotCarrier(robot::Session& robot, robot::PoseSource& poses, std::uint16_t last_scan = 0)
      : robot_{robot}, poses_{poses}, scan_{last_scan} {}
  /// A pose is this much older than it says.
  void set_latency(Duration latency) { latency_ = latency; }

  /// Of every event of robot and pose source, in a sweep or not; nothing when it does not concern a sweep.
  std::optional<CarrierNews> on(const robot::Event& event);
  std::optional<CarrierNews> on(const robot::PoseEvent& event);

  std::optional<std::string> plan(const Motion& motion) override;
  void go_to_start(TimePoint now) override;
  void go_to_end(TimePoint now) override;
  void stop(TimePoint now) override;
  Duration prepare_max() const override { return path_.prepare_max; }
  Duration path_max() const override { return path_.path_max; }
  std::string overdue() const override;
  std::optional<TimePoint> newest() const override { return track_.newest(); }
  std::optional<CarrierPose> at(TimePoint at) const override;

 private:
  robot::Session& robot_;
  robot::PoseSource& poses_;
  Duration latency_{0};
  RobotPath path_;
  std::uint16_t scan_;
  bool under_way_ = false;
  robot::PoseTrack track_;
};
}  // namespace binpick::drivers::sweep
