#include "vision/overlaps.hpp"

#include <algorithm>
#include <limits>

namespace binpick::vision {
namespace {
/// Both sides of an object on one grid.
struct Slice {
  Template upper, lower;  ///< `lower` is mirrored: rows run the other way, heights are negative.
  int row0() const { return upper.row0; }
  int col0() const { return upper.col0; }

  /// Twice the middle of its height at a pixel of the grid; NaN outside.
  float middle2(int row, int col) const {
    const float top = at(upper, row, col), below = at(lower, -row, col);
    return top - below;
  }

 private:
  static float at(const Template& drawn, int row, int col) {
    const int r = row - drawn.row0, c = col - drawn.col0;
    if (r < 0 || c < 0 || r >= drawn.rows || c >= drawn.cols) return std::numeric_limits<float>::quiet_NaN();
    return drawn.top_mm[drawn.at(r, c)];
  }
};

Slice slice_of(const Rasteriser& part, const Eigen::Isometry3d& T_supply_object, double pixel_mm) {
  // Turned about x by half a turn the lower side is the upper one.
  const Eigen::Vector3f over{1, -1, -1};
  const Eigen::Matrix3f R = T_supply_object.linear().cast<float>();
  const Eigen::Vector3f t = T_supply_object.translation().cast<float>();
  Slice slice;
  part.draw(R, t, pixel_mm, Eigen::Vector2d::Zero(), slice.upper);
  part.draw(over.asDiagonal() * R, over.asDiagonal() * t, pixel_mm, Eigen::Vector2d::Zero(), slice.lower);
  return slice;
}

/// Side of the largest square of pixels in which `other` stands higher than `object`.
int square_px(const Slice& object, const Slice& other) {
  const int row0 = std::max(object.row0(), other.row0()), col0 = std::max(object.col0(), other.col0());
  const int row1 = std::min(object.row0() + object.upper.rows, other.row0() + other.upper.rows);
  const int col1 = std::min(object.col0() + object.upper.cols, other.col0() + other.upper.cols);
  if (row0 >= row1 || col0 >= col1) return 0;
  // The largest square that ends at each pixel, row by row.
  const auto cols = static_cast<std::size_t>(col1 - col0);
  std::vector<int> before(cols + 1, 0), row(cols + 1, 0);
  int largest = 0;
  for (int r = row0; r < row1; ++r) {
    for (std::size_t c = 0; c < cols; ++c) {
      const int col = col0 + static_cast<int>(c);
      const bool over = other.middle2(r, col) > object.middle2(r, col);
      row[c + 1] = over ? 1 + std::min({before[c], before[c + 1], row[c]}) : 0;
      largest = std::max(largest, row[c + 1]);
    }
    std::swap(before, row);
  }
  return largest;
}
}  // namespace

std::vector<double> overlaps_mm(const Rasteriser& part, std::span<const Detection> detections, double pixel_mm) {
  std::vector<Slice> slices;
  for (const Detection& detection : detections)
    slices.push_back(slice_of(part, detection.T_supply_object.iso, pixel_mm));
  std::vector<double> overlaps(detections.size(), 0);
  for (std::size_t a = 0; a < slices.size(); ++a)
    for (std::size_t b = 0; b < slices.size(); ++b)
      if (a != b) overlaps[a] = std::max(overlaps[a], pixel_mm * square_px(slices[a], slices[b]));
  return overlaps;
}
}  // namespace binpick::vision
