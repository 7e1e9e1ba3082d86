#pragma once

#include <Eigen/Geometry>
#include <array>
#include <cstdint>
#include <memory>
#include <vector>

#include "vision/mesh.hpp"
#include "vision/renderer.hpp"

namespace binpick::vision {
/// One pose of the part on the pixel grid of a depth image, cut to its own bounding box. A margin around the box is
/// outside the silhouette too, so that a pixel's neighbours can be read without a question.
struct Template {
  static constexpr int kMarginPx = 2;
  int row0 = 0, col0 = 0;  ///< Of its first pixel, in the depth image; may lie outside of it.
  int rows = 0, cols = 0;
  int stride = 0;                      ///< From row to row.
  std::vector<float> top_mm;           ///< Highest surface, NaN outside the silhouette.
  std::vector<std::int32_t> triangle;  ///< Of the highest surface; -1 outside.

  std::size_t at(int row, int col) const {
    return static_cast<std::size_t>(row + kMarginPx) * static_cast<std::size_t>(stride) +
           static_cast<std::size_t>(col + kMarginPx);
  }
};

/// Rasteriser for small templates: a few thousand triangles on some 50 × 50 pixels, where OSMesa's set-up and read-back
/// would take most of the time. Eight triangles are set up at once and eight pixels drawn (Pineda, 1988: half planes).
/// Same picture as the reference renderer (tests/unit/detect). Immutable: many threads may draw at once, each into its
/// own Template.
class Rasteriser {
 public:
  explicit Rasteriser(const Mesh& mesh);
  /// Draws the mesh at R, t (supply from object, mm) on the grid given by pixel size and the centre of pixel (0, 0).
  void draw(const Eigen::Matrix3f& R, const Eigen::Vector3f& t, double pixel_mm, const Eigen::Vector2d& origin_mm,
            Template& out) const;
  /// Unit normal of a triangle, object frame.
  Eigen::Vector3f normal(std::int32_t triangle) const {
    const float* n = normals_.data() + triangle;
    return {n[0], n[triangle_count()], n[2 * triangle_count()]};
  }
  /// Of all of them as the inner loops want them: x of all, y of all, z of all.
  const std::vector<float>& normals() const { return normals_; }
  /// A multiple of eight; the last ones may be empty.
  std::size_t triangle_count() const { return triangles_.size() / 3; }

 private:
  std::size_t points_ = 0;               // a multiple of eight
  std::vector<float> vertices_mm_;       // x of all, y of all, z of all
  std::vector<std::int32_t> triangles_;  // first corners, second corners, third corners
  bool outward_ = false;                 // every body is closed and turns its outside out
  std::vector<float> normals_;
};

/// The working rasteriser with the face of the reference renderer.
std::unique_ptr<DepthRenderer> make_working_renderer(const Mesh& mesh);
}  // namespace binpick::vision
