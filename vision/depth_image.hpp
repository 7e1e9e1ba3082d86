#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

namespace binpick::vision {
/// Heights over a regular grid in the supply frame. Deep copies: two images never share pixels.
struct DepthImage {
  Eigen::Array<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>
      z_mm;                                             ///< rows (y) × cols (x), supply z up, NaN = not measured.
  double pixel_mm = 1.0;                                ///< Edge of one square pixel.
  Eigen::Vector2d origin_mm = Eigen::Vector2d::Zero();  ///< Supply x, y of the centre of pixel (0, 0).
};

/// What is known of the supply besides the picture.
struct SupplyBox {
  Eigen::Vector3d size_mm =
      Eigen::Vector3d::Zero();  ///< Inner x, y and wall height; origin in the middle of the floor. 0: unknown.
};

/// Collects registered points while a sweep runs; image() may be asked at any time.
class DepthImageBuilder {
 public:
  /// The window is the supply's inner size where known, else it must be given by the points (see window_of).
  DepthImageBuilder(double pixel_mm, const Eigen::Vector2d& min_mm, const Eigen::Vector2d& max_mm);
  /// Points in the supply frame, mm; not finite or outside the window: ignored. Each pixel keeps a robust highest
  /// value.
  void add(std::span<const Eigen::Vector3f> points_supply_mm);
  std::size_t points() const;
  /// Small holes (up to two pixels) filled from their surroundings.
  DepthImage image() const;

 private:
  double pixel_mm_;
  Eigen::Vector2d origin_mm_;
  int rows_ = 0, cols_ = 0;
  std::size_t points_ = 0;
  std::vector<float> highest_;
};
}  // namespace binpick::vision
