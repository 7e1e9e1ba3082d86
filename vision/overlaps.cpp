#include "vision/overlaps.hpp"

#include <algorithm>
#include <limits>
#include <utility>

namespace binpick::vision {
namespace {
/// Of an object on a grid: twice the middle of its height at each pixel of its box; NaN beside it. Nothing else is kept
/// of what is drawn: a full supply would hold megabytes of it.
struct Slice {
  int row0 = 0, col0 = 0, rows = 0, cols = 0;
  std::vector<float> middle2_mm;

  /// Of a pixel of the grid, which has to be in the box; the rest of its row follows.
  const float* at(int row, int col) const {
    return middle2_mm.data() + static_cast<std::size_t>(row - row0) * static_cast<std::size_t>(cols) + (col - col0);
  }
};

/// Draws one object after the other, in the same memory.
class Slicer {
 public:
  Slicer(const Rasteriser& part, double pixel_mm) : part_{part}, pixel_mm_{pixel_mm} {}

  Slice slice(const Eigen::Isometry3d& T_supply_object) {
    // Turned about x by half a turn the lower side is the upper one: rows run the other way, heights are negative.
    const Eigen::Vector3f over{1, -1, -1};
    const Eigen::Matrix3f R = T_supply_object.linear().cast<float>();
    const Eigen::Vector3f t = T_supply_object.translation().cast<float>();
    part_.draw(R, t, pixel_mm_, Eigen::Vector2d::Zero(), upper_);
    part_.draw(over.asDiagonal() * R, over.asDiagonal() * t, pixel_mm_, Eigen::Vector2d::Zero(), lower_);
    Slice slice{upper_.row0, upper_.col0, upper_.rows, upper_.cols, {}};
    slice.middle2_mm.reserve(static_cast<std::size_t>(slice.rows) * static_cast<std::size_t>(slice.cols));
    for (int row = slice.row0; row < slice.row0 + slice.rows; ++row)
      for (int col = slice.col0; col < slice.col0 + slice.cols; ++col)
        slice.middle2_mm.push_back(top_mm(upper_, row, col) - top_mm(lower_, -row, col));
    return slice;
  }

 private:
  static float top_mm(const Template& drawn, int row, int col) {
    const int r = row - drawn.row0, c = col - drawn.col0;
    if (r < 0 || c < 0 || r >= drawn.rows || c >= drawn.cols) return std::numeric_limits<float>::quiet_NaN();
    return drawn.top_mm[drawn.at(r, c)];
  }

  const Rasteriser& part_;
  double pixel_mm_;
  Template upper_, lower_;
};

/// Side of the largest square of pixels in which `other` stands higher than `object`.
int square_px(const Slice& object, const Slice& other) {
  const int row0 = std::max(object.row0, other.row0), col0 = std::max(object.col0, other.col0);
  const int row1 = std::min(object.row0 + object.rows, other.row0 + other.rows);
  const int col1 = std::min(object.col0 + object.cols, other.col0 + other.cols);
  if (row0 >= row1 || col0 >= col1) return 0;
  // The largest square that ends at each pixel, row by row.
  const auto cols = static_cast<std::size_t>(col1 - col0);
  std::vector<int> before(cols + 1, 0), row(cols + 1, 0);
  int largest = 0;
  for (int r = row0; r < row1; ++r) {
    const float *below_mm = object.at(r, col0), *above_mm = other.at(r, col0);
    for (std::size_t c = 0; c < cols; ++c) {
      row[c + 1] = above_mm[c] > below_mm[c] ? 1 + std::min({before[c], before[c + 1], row[c]}) : 0;
      largest = std::max(largest, row[c + 1]);
    }
    std::swap(before, row);
  }
  return largest;
}
}  // namespace

std::vector<double> overlaps_mm(const Rasteriser& part, std::span<const Detection> detections, double pixel_mm,
                                const Eigen::Vector3d& up, const std::vector<bool>& wanted) {
  const Eigen::Quaterniond upright = Eigen::Quaterniond::FromTwoVectors(up, Eigen::Vector3d::UnitZ());
  Slicer slicer{part, pixel_mm};
  std::vector<Slice> slices;
  for (const Detection& detection : detections) slices.push_back(slicer.slice(upright * detection.T_supply_object.iso));
  std::vector<double> overlaps(detections.size(), 0);
  for (std::size_t a = 0; a < slices.size(); ++a)
    for (std::size_t b = 0; b < slices.size() && (wanted.empty() || wanted[a]); ++b)
      if (a != b) overlaps[a] = std::max(overlaps[a], pixel_mm * square_px(slices[a], slices[b]));
  return overlaps;
}

OverlapElsewhere overlap_elsewhere(const Rasteriser& part, std::span<const Detection> detections, double pixel_mm) {
  Slicer slicer{part, pixel_mm};
  std::vector<Slice> slices;
  for (const Detection& detection : detections) slices.push_back(slicer.slice(detection.T_supply_object.iso));
  return [slicer, slices = std::move(slices), pixel_mm](std::size_t detection,
                                                        const Eigen::Isometry3d& T_supply_elsewhere) mutable {
    const Slice own = slicer.slice(T_supply_elsewhere);
    double widest = 0;
    for (std::size_t other = 0; other < slices.size(); ++other)
      if (other != detection) widest = std::max(widest, pixel_mm * square_px(own, slices[other]));
    return widest;
  };
}
}  // namespace binpick::vision
