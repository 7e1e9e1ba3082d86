#pragma once

#include <cstdint>
#include <vector>

#include "vision/depth_image.hpp"
#include "vision/rasteriser.hpp"
#include "vision/scene.hpp"

/// Where a scanner may be blind: it looks down from somewhere above, so that what hides a point stands higher, the more
/// the farther away it is.
namespace binpick::vision {
class Shadows {
 public:
  /// The supply's walls hide as well, measured or not; unknown ones (size 0) do not.
  Shadows(const Scene& scene, const SupplyBox& supply);
  /// Whether something may stand between a point and the scanner: within a slant of 22 degrees to the vertical.
  bool may_hide(int row, int col, float z_mm) const;
  /// A few pixels without a measurement between two of the same surface: lost points, or a scan that is sparse.
  bool is_hole(int row, int col) const { return holes_(row, col) != 0; }

 private:
  void find_holes(const Scene& scene);

  int rows_, cols_;
  std::vector<float> height_mm_;  ///< Of each cell of 2 × 2 pixels: what lies lower may be hidden.
  Grid<std::uint8_t> holes_;
};

/// What of a drawn part is not there although nothing hides it.
struct Absent {
  int holes = 0;   ///< Pixels between the points of one surface: nothing is known of them, and nothing is odd.
  int unseen = 0;  ///< Pixels that were not measured, though they face the scanner.
  int ends = 0;    ///< Pixels at which the measured surface ends within the part's own: a shorter body lies there.
};
Absent absent_pixels(const Scene& scene, const Shadows& shadows, const Rasteriser& part, const Eigen::Matrix3f& R,
                     const Template& drawn);
}  // namespace binpick::vision
