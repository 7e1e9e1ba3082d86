#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
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

/// Part of the supply's floor plane that a depth image covers.
struct DepthWindow {
  Eigen::Vector2d min_mm = Eigen::Vector2d::Zero();
  Eigen::Vector2d max_mm = Eigen::Vector2d::Zero();
};
/// The window that holds the points where no supply size is known. Points far outside the bulk (beyond the 1 % and 99 %
/// quantiles by more than their distance) do not count: one wild point must not make a picture of a square kilometre.
/// Points that are not finite are ignored; without any finite point both corners are zero.
DepthWindow window_of(std::span<const Eigen::Vector3f> points_supply_mm);
/// The supply's own window: its inner size, the origin in the middle.
DepthWindow window_of(const SupplyBox& supply);

/// Collects registered points while a sweep runs; image() may be asked at any time.
class DepthImageBuilder {
 public:
  /// Rows and columns of the largest picture; a larger window is cropped around its middle.
  static constexpr int kPixelsMax = 4096;

  /// The window is the supply's inner size where known, else it must be given by the points (see window_of).
  DepthImageBuilder(double pixel_mm, const Eigen::Vector2d& min_mm, const Eigen::Vector2d& max_mm);
  /// Points in the supply frame, mm; not finite or outside the window: ignored. Each pixel keeps a robust highest
  /// value: the mean of its highest surface, where one stray point above a well-measured surface is no surface.
  void add(std::span<const Eigen::Vector3f> points_supply_mm);
  /// Points that fell into the window.
  std::size_t points() const { return points_; }
  /// Small holes (up to two pixels) filled from their surroundings.
  DepthImage image() const;

 private:
  /// Points of one pixel that lie within one band of height.
  struct Surface {
    float mean_mm = 0;
    std::uint32_t count = 0;
  };
  struct Pixel {
    Surface top, below;
  };
  void add_height(Pixel& pixel, float z_mm) const;

  double pixel_mm_;
  float band_mm_;  ///< Heights closer than this belong to one surface.
  Eigen::Vector2d origin_mm_;
  int rows_ = 0, cols_ = 0;
  std::size_t points_ = 0;
  std::vector<Pixel> pixels_;
};
}  // namespace binpick::vision
