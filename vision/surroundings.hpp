#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <span>
#include <vector>

#include "vision/depth_image.hpp"
#include "vision/detector.hpp"
#include "vision/rasteriser.hpp"
#include "vision/scene.hpp"

/// What stands around the objects that were found in a scan: solid from the surface down. The surface is what was
/// measured, without specks; where that shows a detection, it is the detection's own, which is sharper.
namespace binpick::vision {
/// A piece of it, with one of the objects taken away.
struct Heights {
  enum class Kind : std::uint8_t {
    Known,    ///< Measured, or of another detection.
    Hole,     ///< Not measured: as high as what surrounds it may hide.
    Beneath,  ///< Under the object that was taken away.
  };
  static constexpr int kBlockPx = 8;
  double pixel_mm = 1;
  Eigen::Vector2d origin_mm = Eigen::Vector2d::Zero();  ///< Of the centre of pixel (0, 0) here.
  Grid<float> z_mm;                                     ///< At least 0, the floor.
  Grid<Kind> kind;
  Grid<float> block_mm;  ///< Greatest of each block of kBlockPx × kBlockPx.

  float x_mm(int col) const { return static_cast<float>(origin_mm.x() + pixel_mm * col); }
  float y_mm(int row) const { return static_cast<float>(origin_mm.y() + pixel_mm * row); }
};

class Surroundings {
 public:
  /// Keeps references to `part` and `detections`. `noise_mm`: 1 sd of one measured height.
  Surroundings(const DepthImage& image, const SupplyBox& supply, const Rasteriser& part,
               std::span<const Detection> detections, double noise_mm);

  /// Of the window, which is cut to the picture.
  Heights without(std::size_t detection, const DepthWindow& window) const;
  /// Of these heights, around `detection`, what no other detection explains: where one stands, or right beside it, only
  /// what is higher than it; else all is free there.
  Heights foreign(Heights heights, std::size_t detection) const;
  float highest_mm() const;
  /// Side of the largest square of a detection, less a pixel, above which something lies that was not found.
  double covered_mm(std::size_t detection) const;
  /// Its lower side: drawn like its upper one, from below.
  Template lower_side(std::size_t detection) const;

 private:
  /// Least and greatest height of a drawn part about a pixel; whether the part goes on all around it.
  struct Around {
    float least, greatest;
    bool inner;
  };
  static Around around(const Template& drawn, int row, int col);
  bool covers(std::size_t detection, int row, int col) const;  ///< Pixel of its template.
  void forget_walls(const SupplyBox& supply);
  void claim(std::size_t detection, Grid<float>& misfit_mm);
  void fill(Heights& heights) const;

  const Rasteriser& part_;
  std::span<const Detection> detections_;
  double noise_mm_;
  double pixel_mm_;
  Eigen::Vector2d origin_mm_;
  float fits_mm_;  ///< A measured height so near to a drawn one shows it.
  Grid<float> measured_mm_;
  Grid<std::int16_t> owner_;  ///< Detection that explains the pixel; -1: none.
  std::vector<Template> drawn_;
};
}  // namespace binpick::vision
