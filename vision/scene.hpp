#pragma once

#include <Eigen/Core>
#include <cstdint>

#include "vision/depth_image.hpp"
#include "vision/kernels.hpp"

/// The measured surface as detection looks at it: smoothed within each piece of surface, with slopes, bend and depth
/// edges.
namespace binpick::vision {
template <class T>
using Grid = Eigen::Array<T, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

struct Scene {
  double pixel_mm = 1;
  Eigen::Vector2d origin_mm = Eigen::Vector2d::Zero();  ///< Supply x, y of the centre of pixel (0, 0).
  double noise_mm = 0.5;                                ///< 1 sd of one measured height.
  float jump_mm = 1;  ///< Neighbouring pixels further apart in height belong to different surfaces.

  Grid<float> measured_mm;  ///< Single heights without specks; NaN = nothing there.
  Grid<float> z_mm;         ///< Plane through the pixel and its neighbours on the same surface, at the pixel; NaN.
  Grid<float> slope_x;      ///< dz/dx of a wider plane; 0 where z_mm is NaN.
  Grid<float> slope_y;
  Grid<float> bend_mm;  ///< Mean second difference over two pixels: > 0 in a valley, < 0 on a ridge; 0 flat or unknown.

  /// Edges are pixels on the upper side of a depth jump (or beside a wide hole).
  Grid<std::uint8_t> edge;
  Grid<float> edge_distance_px;        ///< To the nearest edge pixel, at most kEdgeReachPx.
  Grid<std::int32_t> nearest_edge;     ///< Its index row * cols + col, -1: none in reach.
  Grid<float> edge_out_x, edge_out_y;  ///< At an edge: unit direction in which the surface ends.

  int rows() const { return static_cast<int>(z_mm.rows()); }
  int cols() const { return static_cast<int>(z_mm.cols()); }
  bool inside(int row, int col) const { return row >= 0 && col >= 0 && row < rows() && col < cols(); }
};
inline constexpr int kEdgeReachPx = kernels::kEdgeReachPx;

/// Values that are not finite, or absurd (over a kilometre), count as not measured. The result does not depend on the
/// number of threads. `memory`: a scene that is done with; to get memory anew from the system takes longer than to
/// prepare the scene.
Scene prepare_scene(const DepthImage& image, double noise_mm, int threads = 1,
                    const kernels::Table& loops = kernels::table(), Scene memory = {});
/// Height difference of neighbouring pixels that is a jump rather than noise or slope.
float jump_of(double noise_mm, double pixel_mm);
}  // namespace binpick::vision
