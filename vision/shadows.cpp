#include "vision/shadows.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "vision/verification.hpp"

namespace binpick::vision {
namespace {
constexpr int kCellPx = 2;
/// A triangulation scanner's camera stands 12 degrees beside its laser (110 mm at 500), and either looks some 17
/// degrees aside at the ends of its line; so does a pivoted scanner at the ends of its sweep.
constexpr double kSlantMax = 0.4;
/// A face steeper than 45 degrees may send no light back.
constexpr float kFacingMin = 0.7F;
/// A wider gap is none between two points of a scan.
constexpr int kHolePx = 6;
constexpr float kHoleSlopeMax = 1.0F;
/// A surface ends within another if that goes on for so many pixels.
constexpr int kEndsPx = 5;
}  // namespace

Shadows::Shadows(const Scene& scene, const SupplyBox& supply)
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
  if (supply.size_mm.x() > 0 && supply.size_mm.y() > 0) {
    const auto inside = [&](int index, int axis) {
      return std::abs(scene.origin_mm[axis] + scene.pixel_mm * kCellPx * (index + 0.5)) <
             0.5 * supply.size_mm[axis] - kCellPx * scene.pixel_mm;
    };
    const auto wall = static_cast<float>(supply.size_mm.z());
    for (int r = 0; r < rows_; ++r)
      for (int c = 0; c < cols_; ++c)
        if (!inside(c, 0) || !inside(r, 1)) at(r, c) = std::max(at(r, c), wall);
  }
  find_holes(scene);
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

void Shadows::find_holes(const Scene& scene) {
  holes_ = Grid<std::uint8_t>::Zero(scene.rows(), scene.cols());
  const float* z = scene.z_mm.data();
  const auto along = [&](int lines, int length, const auto& index_of) {
    for (int line = 0; line < lines; ++line)
      for (int last = -1, i = 0; i < length; ++i) {
        const float here = z[index_of(line, i)];
        if (std::isnan(here)) continue;
        const int gap = i - last - 1;
        if (last >= 0 && gap > 0 && gap <= kHolePx &&
            std::abs(here - z[index_of(line, last)]) <=
                scene.jump_mm + kHoleSlopeMax * static_cast<float>(scene.pixel_mm * (gap + 1)))
          for (int k = last + 1; k < i; ++k) holes_.data()[index_of(line, k)] = 1;
        last = i;
      }
  };
  const auto cols = static_cast<std::ptrdiff_t>(scene.cols());
  along(scene.rows(), scene.cols(), [&](int r, int c) { return r * cols + c; });
  along(scene.cols(), scene.rows(), [&](int c, int r) { return r * cols + c; });
}

bool Shadows::may_hide(int row, int col, float z_mm) const {
  return height_mm_[static_cast<std::size_t>(row / kCellPx) * static_cast<std::size_t>(cols_) +
                    static_cast<std::size_t>(col / kCellPx)] > z_mm;
}

Absent absent_pixels(const Scene& scene, const Shadows& shadows, const Rasteriser& part, const Eigen::Matrix3f& R,
                     const Template& drawn) {
  enum State : std::uint8_t { Other, Measured, Gone };
  Absent absent;
  if (drawn.rows == 0) return absent;
  thread_local std::vector<std::uint8_t> states;
  states.assign(drawn.top_mm.size(), Other);
  const float fits = 2 * tolerance_of(scene), below = fits + scene.jump_mm;
  const int row_first = std::max(0, -drawn.row0), row_last = std::min(drawn.rows, scene.rows() - drawn.row0);
  const int col_first = std::max(0, -drawn.col0), col_last = std::min(drawn.cols, scene.cols() - drawn.col0);
  for (int r = row_first; r < row_last; ++r)
    for (int c = col_first; c < col_last; ++c) {
      const std::size_t i = drawn.at(r, c);
      if (drawn.triangle[i] < 0) continue;
      const int row = r + drawn.row0, col = c + drawn.col0;
      const float rise = scene.z_mm(row, col) - drawn.top_mm[i];
      if (!std::isnan(rise)) {
        if (rise < -below) states[i] = Gone;
        if (std::abs(rise) < fits) states[i] = Measured;
        continue;
      }
      if (shadows.is_hole(row, col)) {
        ++absent.holes;
        continue;
      }
      if (shadows.may_hide(row, col, drawn.top_mm[i])) continue;
      if (!(std::abs(R.row(2).dot(part.normal(drawn.triangle[i]))) > kFacingMin)) continue;
      states[i] = Gone;
      ++absent.unseen;
    }
  // Beside the part's own edges half a pixel of pose does as much.
  const auto width = static_cast<std::ptrdiff_t>(drawn.stride);
  for (int r = row_first + kEndsPx; r < row_last - kEndsPx; ++r)
    for (int c = col_first + kEndsPx; c < col_last - kEndsPx; ++c) {
      const auto i = static_cast<std::ptrdiff_t>(drawn.at(r, c));
      const auto state = [&](std::ptrdiff_t step) { return states[static_cast<std::size_t>(i + step)]; };
      if (state(0) != Measured) continue;
      for (const std::ptrdiff_t step : {std::ptrdiff_t{1}, std::ptrdiff_t{-1}, width, -width}) {
        if (state(step) == Measured || state(2 * step) != Gone || state(3 * step) != Gone) continue;
        const auto top = [&](std::ptrdiff_t k) { return drawn.top_mm[static_cast<std::size_t>(i + k * step)]; };
        const float slope = 1.5F * std::abs(top(0) - top(-1)) + 0.5F * scene.jump_mm;
        // Beyond the silhouette there is no number: no end within.
        if (!(std::abs(top(3) - top(0)) < 3 * slope && std::abs(top(kEndsPx) - top(3)) < 3 * slope)) continue;
        ++absent.ends;
        break;
      }
    }
  return absent;
}
}  // namespace binpick::vision
