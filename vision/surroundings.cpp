#include "vision/surroundings.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>

namespace binpick::vision {
namespace {
constexpr float kNothing = std::numeric_limits<float>::quiet_NaN();
constexpr float kDeep = -std::numeric_limits<float>::infinity();
/// No supply is so high; a number beyond is none.
constexpr float kAbsurdMm = 1e6F;
/// The light falls in at most so far from the vertical (vision/shadows.cpp): what stands higher hides a place only as
/// far down as its distance over this.
constexpr double kSlantMax = 0.4;
/// A height within so many standard deviations of a drawn one shows it; the drawn one's pose has errors as well.
constexpr double kFitsNoises = 4;
/// What stands so many of them above an object lies on it.
constexpr double kCoversNoises = 2.5;
/// Pixels beside an outline whose heights are mixed of both sides.
constexpr int kRimPx = 2;
/// Pixels along a wall that hold points of it as well.
constexpr double kWallPx = 2.5;

/// Median of nine (Paeth, 1990), written so that the compiler does many at once.
inline float median(std::array<float, 9> v) {
  const auto order = [&](std::size_t a, std::size_t b) {
    const float low = v[a] < v[b] ? v[a] : v[b];
    v[b] = v[a] < v[b] ? v[b] : v[a];
    v[a] = low;
  };
  constexpr std::array<std::array<std::uint8_t, 2>, 19> kSteps{{{1, 2},
                                                                {4, 5},
                                                                {7, 8},
                                                                {0, 1},
                                                                {3, 4},
                                                                {6, 7},
                                                                {1, 2},
                                                                {4, 5},
                                                                {7, 8},
                                                                {0, 3},
                                                                {5, 8},
                                                                {4, 7},
                                                                {3, 6},
                                                                {1, 4},
                                                                {2, 5},
                                                                {4, 7},
                                                                {4, 2},
                                                                {6, 4},
                                                                {4, 2}}};
  for (const auto& [a, b] : kSteps) order(a, b);
  return v[4];
}

/// Median of the measured pixels about each measured one: a speck is gone, an edge stays where it is.
Grid<float> without_specks(const DepthImage& image) {
  const Eigen::Index rows = image.z_mm.rows(), cols = image.z_mm.cols();
  // What was not measured is very high or very low in turns: the median stays about where it is without.
  Grid<float> padded(rows + 2, cols + 2);
  for (Eigen::Index r = 0; r < rows + 2; ++r)
    for (Eigen::Index c = 0; c < cols + 2; ++c) {
      const bool within = r > 0 && c > 0 && r <= rows && c <= cols;
      const float z = within ? image.z_mm(r - 1, c - 1) : kNothing;
      padded(r, c) = std::abs(z) < kAbsurdMm ? z : (r + c) % 2 == 0 ? kAbsurdMm : -kAbsurdMm;
    }
  Grid<float> calm(rows, cols);
  for (Eigen::Index r = 0; r < rows; ++r) {
    const float *above = &padded(r, 0), *here = &padded(r + 1, 0), *below = &padded(r + 2, 0);
    float* out = &calm(r, 0);
    for (Eigen::Index c = 0; c < cols; ++c) {
      const float middle = median({above[c], above[c + 1], above[c + 2], here[c], here[c + 1], here[c + 2], below[c],
                                   below[c + 1], below[c + 2]});
      const float own = here[c + 1];
      const float found = std::abs(middle) < kAbsurdMm ? middle : own;
      out[c] = std::abs(own) < kAbsurdMm ? found : kNothing;
    }
  }
  return calm;
}

/// Heights of drawn pixels at a place of the depth image; not a number: not drawn there.
float top_at(const Template& drawn, int row, int col) {
  const int r = row - drawn.row0, c = col - drawn.col0;
  if (r < 0 || c < 0 || r >= drawn.rows || c >= drawn.cols) return kNothing;
  return drawn.top_mm[drawn.at(r, c)];
}
}  // namespace

Surroundings::Surroundings(const DepthImage& image, const SupplyBox& supply, const Rasteriser& part,
                           std::span<const Detection> detections, double noise_mm)
    : part_{part},
      detections_{detections},
      noise_mm_{noise_mm},
      pixel_mm_{image.pixel_mm},
      origin_mm_{image.origin_mm},
      fits_mm_{static_cast<float>(kFitsNoises * noise_mm)},
      measured_mm_{without_specks(image)},
      owner_{Grid<std::int16_t>::Constant(image.z_mm.rows(), image.z_mm.cols(), -1)},
      drawn_(detections.size()) {
  forget_walls(supply);
  Grid<float> misfit_mm = Grid<float>::Constant(owner_.rows(), owner_.cols(), std::numeric_limits<float>::infinity());
  for (std::size_t d = 0; d < detections.size(); ++d) claim(d, misfit_mm);
}

/// The outermost pixels hold points of the walls as well, whose place is known better.
void Surroundings::forget_walls(const SupplyBox& supply) {
  if (supply.size_mm.x() <= 0 || supply.size_mm.y() <= 0) return;
  for (Eigen::Index r = 0; r < measured_mm_.rows(); ++r)
    for (Eigen::Index c = 0; c < measured_mm_.cols(); ++c) {
      const double x = std::abs(origin_mm_.x() + pixel_mm_ * static_cast<double>(c));
      const double y = std::abs(origin_mm_.y() + pixel_mm_ * static_cast<double>(r));
      const double strip_mm = kWallPx * pixel_mm_;
      if (x > 0.5 * supply.size_mm.x() - strip_mm || y > 0.5 * supply.size_mm.y() - strip_mm)
        measured_mm_(r, c) = kNothing;
    }
}

Surroundings::Around Surroundings::around(const Template& drawn, int row, int col) {
  Around found{std::numeric_limits<float>::infinity(), kDeep, true};
  for (int r = row - 1; r <= row + 1; ++r)
    for (int c = col - 1; c <= col + 1; ++c) {
      const float top = drawn.top_mm[drawn.at(r, c)];
      if (std::isnan(top)) {
        found.inner = false;
        continue;
      }
      found.least = std::min(found.least, top);
      found.greatest = std::max(found.greatest, top);
    }
  return found;
}

void Surroundings::claim(std::size_t detection, Grid<float>& misfit_mm) {
  const Eigen::Isometry3d& T = detections_[detection].T_supply_object.iso;
  Template& drawn = drawn_[detection];
  part_.draw(T.linear().cast<float>(), T.translation().cast<float>(), pixel_mm_, origin_mm_, drawn);
  for (int r = std::max(0, -drawn.row0); r < drawn.rows && r + drawn.row0 < owner_.rows(); ++r)
    for (int c = std::max(0, -drawn.col0); c < drawn.cols && c + drawn.col0 < owner_.cols(); ++c) {
      const int row = r + drawn.row0, col = c + drawn.col0;
      const float z = measured_mm_(row, col), top = drawn.top_mm[drawn.at(r, c)];
      if (std::isnan(z) || std::isnan(top) || !(std::abs(z - top) < misfit_mm(row, col))) continue;
      const Around near = around(drawn, r, c);
      if (z < near.least - fits_mm_ || z > near.greatest + fits_mm_) continue;
      owner_(row, col) = static_cast<std::int16_t>(detection);
      misfit_mm(row, col) = std::abs(z - top);
    }
}

float Surroundings::highest_mm() const {
  float highest = 0;
  for (Eigen::Index i = 0; i < measured_mm_.size(); ++i)
    if (measured_mm_.data()[i] > highest) highest = measured_mm_.data()[i];
  return highest;
}

double Surroundings::covered_mm(std::size_t detection) const {
  const Template& drawn = drawn_[detection];
  // The largest square that ends at each pixel, row by row.
  std::vector<int> before(static_cast<std::size_t>(drawn.cols) + 1, 0), now = before;
  int largest = 0;
  for (int r = 0; r < drawn.rows; ++r) {
    for (int c = 0; c < drawn.cols; ++c) {
      const auto at = static_cast<std::size_t>(c);
      now[at + 1] = covers(detection, r, c) ? 1 + std::min({before[at], before[at + 1], now[at]}) : 0;
      largest = std::max(largest, now[at + 1]);
    }
    std::swap(before, now);
  }
  return pixel_mm_ * std::max(0, largest - 1);
}

bool Surroundings::covers(std::size_t detection, int r, int c) const {
  const Template& drawn = drawn_[detection];
  const int row = r + drawn.row0, col = c + drawn.col0;
  if (row < 0 || col < 0 || row >= owner_.rows() || col >= owner_.cols()) return false;
  const float z = measured_mm_(row, col);
  if (std::isnan(z) || owner_(row, col) >= 0 || std::isnan(drawn.top_mm[drawn.at(r, c)])) return false;
  const Around near = around(drawn, r, c);
  // On the silhouette itself a neighbour at its side looks the same.
  return near.inner && z > near.greatest + static_cast<float>(kCoversNoises * noise_mm_);
}

Template Surroundings::lower_side(std::size_t detection) const {
  // Turned about x by half a turn, and back.
  const Eigen::Vector3f over{1, -1, -1};
  const Eigen::Isometry3d& T = detections_[detection].T_supply_object.iso;
  Template drawn;
  part_.draw(over.asDiagonal() * T.linear().cast<float>(), over.asDiagonal() * T.translation().cast<float>(), pixel_mm_,
             {origin_mm_.x(), -origin_mm_.y()}, drawn);
  Template lower = drawn;
  lower.row0 = -(drawn.row0 + drawn.rows - 1);
  for (int r = 0; r < drawn.rows; ++r)
    for (int c = 0; c < drawn.cols; ++c) {
      lower.top_mm[lower.at(r, c)] = -drawn.top_mm[drawn.at(drawn.rows - 1 - r, c)];
      lower.triangle[lower.at(r, c)] = drawn.triangle[drawn.at(drawn.rows - 1 - r, c)];
    }
  return lower;
}

Heights Surroundings::without(std::size_t detection, const DepthWindow& window) const {
  // Beyond the object to all sides, or what it hides would be filled from one side alone.
  const Template& drawn = drawn_[detection];
  constexpr int kAroundPx = kRimPx + 2;
  const auto first = [&](double at, double origin, double least, double greatest, Eigen::Index count) {
    const double px = std::clamp(std::floor((at - origin) / pixel_mm_), least, greatest);
    return static_cast<int>(std::clamp(px, 0.0, static_cast<double>(std::max<Eigen::Index>(0, count))));
  };
  constexpr double kFar = std::numeric_limits<double>::infinity();
  const int col0 = first(window.min_mm.x(), origin_mm_.x(), -kFar, drawn.col0 - kAroundPx, owner_.cols());
  const int row0 = first(window.min_mm.y(), origin_mm_.y(), -kFar, drawn.row0 - kAroundPx, owner_.rows());
  const int col1 = first(window.max_mm.x(), origin_mm_.x(), drawn.col0 + drawn.cols + kAroundPx, kFar, owner_.cols());
  const int row1 = first(window.max_mm.y(), origin_mm_.y(), drawn.row0 + drawn.rows + kAroundPx, kFar, owner_.rows());
  const int cols = std::max(0, std::min(static_cast<int>(owner_.cols()), col1 + 2) - col0);
  const int rows = std::max(0, std::min(static_cast<int>(owner_.rows()), row1 + 2) - row0);
  Heights heights;
  heights.pixel_mm = pixel_mm_;
  heights.origin_mm = origin_mm_ + pixel_mm_ * Eigen::Vector2d(col0, row0);
  heights.z_mm = Grid<float>::Constant(rows, cols, kNothing);
  heights.kind = Grid<Heights::Kind>::Constant(rows, cols, Heights::Kind::Hole);
  const auto own = static_cast<std::int16_t>(detection);
  for (int r = 0; r < rows; ++r)
    for (int c = 0; c < cols; ++c) {
      const std::int16_t owner = owner_(r + row0, c + col0);
      if (owner == own) {
        heights.kind(r, c) = Heights::Kind::Beneath;
        continue;
      }
      const float z = owner >= 0 ? top_at(drawn_[static_cast<std::size_t>(owner)], r + row0, c + col0)
                                 : measured_mm_(r + row0, c + col0);
      if (std::isnan(z)) continue;
      heights.z_mm(r, c) = z;
      heights.kind(r, c) = Heights::Kind::Known;
    }

  // Its edge, where heights are mixed, and what lies lower within its outline: none of it is a neighbour.
  for (int r = -kRimPx; r < drawn.rows + kRimPx; ++r)
    for (int c = -kRimPx; c < drawn.cols + kRimPx; ++c) {
      const int row = r + drawn.row0 - row0, col = c + drawn.col0 - col0;
      if (row < 0 || col < 0 || row >= rows || col >= cols || heights.kind(row, col) != Heights::Kind::Known ||
          owner_(row + row0, col + col0) >= 0)
        continue;
      float greatest = kDeep;
      for (int k = r - kRimPx; k <= r + kRimPx; ++k)
        for (int l = c - kRimPx; l <= c + kRimPx; ++l) {
          const float top = top_at(drawn, k + drawn.row0, l + drawn.col0);
          if (top > greatest) greatest = top;
        }
      if (heights.z_mm(row, col) > greatest + fits_mm_) continue;
      heights.z_mm(row, col) = kNothing;
      heights.kind(row, col) = Heights::Kind::Beneath;
    }

  // Where nothing was measured, and under the object, the others are known all the same.
  Grid<float> others = Grid<float>::Constant(rows, cols, kNothing);
  for (std::size_t other = 0; other < drawn_.size(); ++other) {
    if (other == detection) continue;
    const Template& top = drawn_[other];
    for (int r = std::max(0, row0 - top.row0); r < top.rows && r + top.row0 - row0 < rows; ++r)
      for (int c = std::max(0, col0 - top.col0); c < top.cols && c + top.col0 - col0 < cols; ++c) {
        float& highest = others(r + top.row0 - row0, c + top.col0 - col0);
        if (!(highest >= top.top_mm[top.at(r, c)])) highest = top.top_mm[top.at(r, c)];
      }
  }
  for (int r = 0; r < rows; ++r)
    for (int c = 0; c < cols; ++c) {
      if (heights.kind(r, c) == Heights::Kind::Known || std::isnan(others(r, c))) continue;
      const float own_top = top_at(drawn, r + row0, c + col0);
      heights.z_mm(r, c) = std::isnan(own_top) ? others(r, c) : std::min(others(r, c), own_top);
      heights.kind(r, c) = Heights::Kind::Known;
    }

  fill(heights);
  const Template below = lower_side(detection);
  for (int r = std::max(0, row0 - below.row0); r < below.rows && r + below.row0 - row0 < rows; ++r)
    for (int c = std::max(0, col0 - below.col0); c < below.cols && c + below.col0 - col0 < cols; ++c) {
      const int row = r + below.row0 - row0, col = c + below.col0 - col0;
      const float z = below.top_mm[below.at(r, c)];
      if (!std::isnan(z) && owner_(row + row0, col + col0) == own)
        heights.z_mm(row, col) = std::min(heights.z_mm(row, col), z);
    }
  heights.z_mm = heights.z_mm.max(0.0F);

  constexpr int kBlock = Heights::kBlockPx;
  heights.block_mm = Grid<float>::Zero((rows + kBlock - 1) / kBlock, (cols + kBlock - 1) / kBlock);
  for (int r = 0; r < rows; ++r)
    for (int c = 0; c < cols; ++c) {
      float& block = heights.block_mm(r / kBlock, c / kBlock);
      block = std::max(block, heights.z_mm(r, c));
    }
  return heights;
}

Heights Surroundings::foreign(Heights heights, std::size_t detection) const {
  const Eigen::Vector2d at = (heights.origin_mm - origin_mm_) / pixel_mm_;
  const int row0 = static_cast<int>(std::lround(at.y())), col0 = static_cast<int>(std::lround(at.x()));
  const auto rows = static_cast<int>(heights.z_mm.rows()), cols = static_cast<int>(heights.z_mm.cols());
  // The highest of the others at each pixel and about it: along their outlines heights are mixed of both sides.
  Grid<float> tops = Grid<float>::Constant(rows, cols, kNothing);
  for (std::size_t other = 0; other < drawn_.size(); ++other) {
    if (other == detection) continue;
    const Template& drawn = drawn_[other];
    for (int r = 0; r < drawn.rows; ++r)
      for (int c = 0; c < drawn.cols; ++c) {
        const float top = drawn.top_mm[drawn.at(r, c)];
        if (std::isnan(top)) continue;
        const int row = r + drawn.row0 - row0, col = c + drawn.col0 - col0;
        for (int k = std::max(0, row - kRimPx); k <= std::min(rows - 1, row + kRimPx); ++k)
          for (int l = std::max(0, col - kRimPx); l <= std::min(cols - 1, col + kRimPx); ++l)
            if (!(tops(k, l) >= top)) tops(k, l) = top;
      }
  }
  for (int r = 0; r < rows; ++r)
    for (int c = 0; c < cols; ++c)
      if (heights.z_mm(r, c) <= tops(r, c) + fits_mm_)  // else something that was not found lies on it
        heights.kind(r, c) = Heights::Kind::Hole, heights.z_mm(r, c) = 0;
  return heights;
}

/// What is not known goes on as high as the lower of its two ends, along rows and along columns; the higher of these
/// two. Then the shadows.
void Surroundings::fill(Heights& heights) const {
  const auto rows = static_cast<int>(heights.z_mm.rows()), cols = static_cast<int>(heights.z_mm.cols());
  const Grid<float>& z = heights.z_mm;
  Grid<float> filled = z;
  const auto raise = [](float& to, float before, float after) {
    const float level = std::isnan(before) ? after : std::isnan(after) ? before : std::min(before, after);
    if (!std::isnan(level) && !(to >= level)) to = level;
  };
  for (int r = 0; r < rows; ++r)
    for (int c = 0; c < cols; ++c) {
      if (!std::isnan(z(r, c))) continue;
      const float before = c > 0 ? z(r, c - 1) : kNothing;
      int end = c;
      while (end < cols && std::isnan(z(r, end))) ++end;
      const float after = end < cols ? z(r, end) : kNothing;
      for (; c < end; ++c) raise(filled(r, c), before, after);
    }
  std::vector<float> last(static_cast<std::size_t>(cols), kNothing);
  Grid<float> before(rows, cols);
  for (int r = 0; r < rows; ++r)
    for (int c = 0; c < cols; ++c) {
      float& known = last[static_cast<std::size_t>(c)];
      known = std::isnan(z(r, c)) ? known : z(r, c);
      before(r, c) = known;
    }
  last.assign(last.size(), kNothing);
  for (int r = rows - 1; r >= 0; --r)
    for (int c = 0; c < cols; ++c) {
      float& known = last[static_cast<std::size_t>(c)];
      if (std::isnan(z(r, c)))
        raise(filled(r, c), before(r, c), known);
      else
        known = z(r, c);
    }

  // A cone under each known pixel, by two sweeps.
  Grid<float> cone = z;
  const auto step = static_cast<float>(pixel_mm_ / kSlantMax);
  const float diagonal = step * std::numbers::sqrt2_v<float>;
  const auto under = [&](int r, int c, int dr, int dc) {
    if (r + dr < 0 || c + dc < 0 || r + dr >= rows || c + dc >= cols) return;
    const float low = cone(r + dr, c + dc) - (dr != 0 && dc != 0 ? diagonal : step);
    if (!(cone(r, c) >= low)) cone(r, c) = low;
  };
  for (int r = 0; r < rows; ++r)
    for (int c = 0; c < cols; ++c)
      if (std::isnan(z(r, c)))
        for (const auto& [dr, dc] : {std::pair{0, -1}, {-1, 0}, {-1, -1}, {-1, 1}}) under(r, c, dr, dc);
  for (int r = rows - 1; r >= 0; --r)
    for (int c = cols - 1; c >= 0; --c)
      if (std::isnan(z(r, c)))
        for (const auto& [dr, dc] : {std::pair{0, 1}, {1, 0}, {1, 1}, {1, -1}}) under(r, c, dr, dc);
  for (Eigen::Index i = 0; i < filled.size(); ++i) {
    float& height = heights.z_mm.data()[i];
    if (!std::isnan(height)) continue;
    height = filled.data()[i];
    if (!(height >= cone.data()[i])) height = cone.data()[i];
    if (std::isnan(height)) height = 0;
  }
}
}  // namespace binpick::vision
