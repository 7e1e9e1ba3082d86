#pragma once

#include <vector>

#include "vision/rasteriser.hpp"
#include "vision/scene.hpp"

/// Where a scanner may be blind: it looks down from somewhere above, so that what hides a point stands higher, the more
/// the farther away it is.
namespace binpick::vision {
class Shadows {
 public:
  explicit Shadows(const Scene& scene);
  /// Whether something measured may stand between a point and the scanner: within a slant of 22 degrees to the
  /// vertical.
  bool may_hide(int row, int col, float z_mm) const;

 private:
  int rows_, cols_;
  std::vector<float> height_mm_;  ///< Of each cell of 2 × 2 pixels: what lies lower may be hidden.
};

/// Pixels of a drawn part that were not measured although nothing hides them and they face the scanner.
int unseen_pixels(const Scene& scene, const Shadows& shadows, const Rasteriser& part, const Eigen::Matrix3f& R,
                  const Template& drawn);
}  // namespace binpick::vision
