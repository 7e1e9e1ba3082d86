#pragma once

#include <Eigen/Geometry>
#include <array>
#include <cstdint>
#include <memory>
#include <vector>

#include "vision/mesh.hpp"
#include "vision/renderer.hpp"

namespace binpick::vision {
/// One pose of the part on the pixel grid of a depth image, cut to its own bounding box.
struct Template {
  int row0 = 0, col0 = 0;  ///< Of its first pixel, in the depth image; may lie outside of it.
  int rows = 0, cols = 0;
  std::vector<float> top_mm;           ///< Highest surface, NaN outside the silhouette.
  std::vector<float> bottom_mm;        ///< Lowest surface.
  std::vector<std::int32_t> triangle;  ///< Of the highest surface; -1 outside.

  std::size_t at(int row, int col) const {
    return static_cast<std::size_t>(row) * static_cast<std::size_t>(cols) + static_cast<std::size_t>(col);
  }
};

/// Scan-line rasteriser for small templates: a few thousand triangles on some 50 × 50 pixels, where OSMesa's set-up
/// and read-back would take most of the time. Same picture as the reference renderer (tests/unit/detect). Immutable:
/// many threads may draw at once, each into its own Template.
class Rasteriser {
 public:
  explicit Rasteriser(const Mesh& mesh);
  /// Draws the mesh at R, t (supply from object, mm) on the grid given by pixel size and the centre of pixel (0, 0).
  void draw(const Eigen::Matrix3f& R, const Eigen::Vector3f& t, double pixel_mm, const Eigen::Vector2d& origin_mm,
            Template& out) const;
  /// Unit normal of a triangle, object frame.
  const Eigen::Vector3f& normal(std::int32_t triangle) const { return normals_[static_cast<std::size_t>(triangle)]; }

 private:
  std::vector<Eigen::Vector3f> vertices_mm_;
  std::vector<std::array<std::uint32_t, 3>> triangles_;
  std::vector<Eigen::Vector3f> normals_;
};

/// The rasteriser with the face of the reference renderer.
std::unique_ptr<DepthRenderer> make_scan_line_renderer(const Mesh& mesh);
}  // namespace binpick::vision
