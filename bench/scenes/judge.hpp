#pragma once

#include <span>
#include <vector>

#include "bench/scenes/lines.hpp"
#include "bench/scenes/matching.hpp"
#include "bench/scenes/parts.hpp"
#include "bench/scenes/pose_measure.hpp"
#include "bench/scenes/truth.hpp"

namespace binpick::bench {
/// From here on an object is to be found, if its pose can be told at all.
inline constexpr double kVisibleMin = 0.5;
/// Right is nearer than this share of the diameter.
inline constexpr double kRightDiameters = 0.1;

/// Judges poses of one part in one class.
class Judge {
 public:
  explicit Judge(const ScenePart& part);

  /// `told`: see Truth.
  const PoseMeasure& measure(bool told) const { return told ? exact_ : near_; }
  double diameter_mm() const { return exact_.diameter_mm(); }
  double threshold_mm() const { return kRightDiameters * diameter_mm(); }

  JudgedScene judged(const SceneLine& scene, double threshold_diameters = kRightDiameters) const;
  /// Distance to the nearest truth; infinite without any.
  double nearest_mm(const Eigen::Isometry3d& pose, std::span<const Truth> truths) const;

 private:
  PoseMeasure exact_;
  PoseMeasure near_;  ///< With the near-symmetry taken for a whole one.
};
}  // namespace binpick::bench
