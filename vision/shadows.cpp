#include "vision/shadows.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

namespace binpick::vision {
namespace {
constexpr int kCellPx = 2;
/// A triangulation scanner's camera stands 12 degrees beside its laser (110 mm at 500), and either looks some 17
/// degrees aside at the ends of its line; so does a pivoted scanner at the ends of its sweep.
constexpr double kSlantMax = 0.4;
/// A face steeper than 45 degrees may send no light back.
constexpr float kFacingMin = 0.7F;
}  // namespace

Shadows::Shadows(const Scene& scene)
    : rows_{(scene.rows() + kCellPx - 1) / kCellPx}, cols_{(scene.cols() + kCellPx - 1) / kCellPx} {
  constexpr float kNothing = -std::numeric_limits<float>::infinity();
  height_mm_.assign(static_cast<std::size_t>(rows_) * static_cast<std::size_t>(cols_), kNothing);
  const auto at = [&](int r, int c) -> float& {
    return height_mm_[static_cast<std::size_t>(r) * static_cast<std::size_t>(cols_) + static_cast<std::size_t>(c)];
  };
  for (int r = 0; r < scene.rows(); ++r)
    for (int c = 0; c < scene.cols(); ++c) {
      float& cell = at(r / kCellPx, c / kCellPx);
      const float z = scene.z_mm(r, c);
      if (z > cell) cell = z;
    }
  // A cone under each cell, by two sweeps.
  const auto step = static_cast<float>(kCellPx * scene.pixel_mm / kSlantMax);
  const float diagonal = step * std::numbers::sqrt2_v<float>;
  for (int r = 0; r < rows_; ++r)
    for (int c = 0; c < cols_; ++c) {
      float z = at(r, c);
      if (c > 0) z = std::max(z, at(r, c - 1) - step);
      if (r > 0) z = std::max(z, at(r - 1, c) - step);
      if (r > 0 && c > 0) z = std::max(z, at(r - 1, c - 1) - diagonal);
      if (r > 0 && c + 1 < cols_) z = std::max(z, at(r - 1, c + 1) - diagonal);
      at(r, c) = z;
    }
  for (int r = rows_ - 1; r >= 0; --r)
    for (int c = cols_ - 1; c >= 0; --c) {
      float z = at(r, c);
      if (c + 1 < cols_) z = std::max(z, at(r, c + 1) - step);
      if (r + 1 < rows_) z = std::max(z, at(r + 1, c) - step);
      if (r + 1 < rows_ && c + 1 < cols_) z = std::max(z, at(r + 1, c + 1) - diagonal);
      if (r + 1 < rows_ && c > 0) z = std::max(z, at(r + 1, c - 1) - diagonal);
      at(r, c) = z;
    }
}

bool Shadows::may_hide(int row, int col, float z_mm) const {
  return height_mm_[static_cast<std::size_t>(row / kCellPx) * static_cast<std::size_t>(cols_) +
                    static_cast<std::size_t>(col / kCellPx)] > z_mm;
}

int unseen_pixels(const Scene& scene, const Shadows& shadows, const Rasteriser& part, const Eigen::Matrix3f& R,
                  const Template& drawn) {
  int unseen = 0;
  const int row_first = std::max(0, -drawn.row0), row_last = std::min(drawn.rows, scene.rows() - drawn.row0);
  const int col_first = std::max(0, -drawn.col0), col_last = std::min(drawn.cols, scene.cols() - drawn.col0);
  for (int r = row_first; r < row_last; ++r)
    for (int c = col_first; c < col_last; ++c) {
      if (!std::isnan(scene.z_mm(r + drawn.row0, c + drawn.col0))) continue;
      const std::size_t i = drawn.at(r, c);
      if (drawn.triangle[i] < 0 || shadows.may_hide(r + drawn.row0, c + drawn.col0, drawn.top_mm[i])) continue;
      unseen += std::abs(R.row(2).dot(part.normal(drawn.triangle[i]))) > kFacingMin;
    }
  return unseen;
}
}  // namespace binpick::vision
