#pragma once

#include <Eigen/Core>
#include <memory>
#include <vector>

#include "bench/scenes/judge.hpp"

namespace binpick::bench {
/// OpenCV's surface_matching (point pair features, Drost et al., 2010) on the same points, tuned as well as we could:
/// walls and floor cut away, sampling of .05, a fifth of the points as references, its ICP on the best poses, and of
/// several poses of one object only the strongest.
class OpencvPeer {
 public:
  explicit OpencvPeer(const ScenePart& part, const Judge& judge);
  ~OpencvPeer();
  OpencvPeer(const OpencvPeer&) = delete;
  OpencvPeer& operator=(const OpencvPeer&) = delete;

  /// False where the bench was built without it.
  static bool built();
  double training_s() const;
  /// Detections, scored by their votes.
  void detect(const std::vector<Eigen::Vector3f>& points, SceneLine& line) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};
}  // namespace binpick::bench
