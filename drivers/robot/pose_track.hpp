#pragma once

#include "base/track.hpp"
#include "drivers/robot/pose_sample.hpp"

namespace binpick::drivers::robot {
/// Where the flange was, by time: translation linear, rotation by the shortest way (slerp) between samples.
class PoseTrack : public Track<Transform<frame::Base, frame::Flange>> {
 public:
  using Track::add;
  PoseTrack();
  void add(const PoseSample& sample) { add(sample.at, sample.T_base_flange); }

  /// Two steps of the slowest stream, 50 ms. An arm that speeds up by 1 m/s² leaves the straight line by 1.3 mm in it.
  static constexpr Duration gap_max = std::chrono::milliseconds(100);
};
}  // namespace binpick::drivers::robot
