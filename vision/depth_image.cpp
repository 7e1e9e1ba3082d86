#include "vision/depth_image.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "base/check.hpp"

namespace binpick::vision {
namespace {
constexpr float kNotMeasured = std::numeric_limits<float>::quiet_NaN();
/// Height of one surface inside one pixel, in pixel edges: 71 degrees of slope, and 4 sd of the noise of the scanners
/// whose pixels we choose (training makes pixels of 1.3 sd and more).
constexpr double kBandPixels = 3.0;
/// One point over a surface of this many points is a mixed or stray echo.
constexpr std::uint32_t kWellMeasured = 4;
constexpr int kHolePixelsMax = 2;

struct Range {
  double min, max;
};

Range robust_range(std::vector<float>& values) {
  const auto quantile = [&](double q) {
    const auto at = values.begin() + static_cast<std::ptrdiff_t>(q * static_cast<double>(values.size() - 1));
    std::nth_element(values.begin(), at, values.end());
    return static_cast<double>(*at);
  };
  const double low = quantile(0.01), high = quantile(0.99);
  const double margin = high - low;
  Range range{high, low};
  for (const float v : values)
    if (v >= low - margin && v <= high + margin) {
      range.min = std::min(range.min, static_cast<double>(v));
      range.max = std::max(range.max, static_cast<double>(v));
    }
  return range;
}

/// What a hole's row or column says: the height between its two ends, and how well they agree.
struct Bridge {
  float z_mm;
  float step_mm;
};

std::optional<Bridge> bridge(const DepthImage& image, int row, int col, int d_row, int d_col) {
  const auto inside = [&](int r, int c) { return r >= 0 && c >= 0 && r < image.z_mm.rows() && c < image.z_mm.cols(); };
  int before = 0, after = 0;
  float z_before = kNotMeasured, z_after = kNotMeasured;
  for (int k = 1; k <= kHolePixelsMax && std::isnan(z_before); ++k)
    if (inside(row - k * d_row, col - k * d_col)) z_before = image.z_mm(row - k * d_row, col - k * d_col), before = k;
  for (int k = 1; k <= kHolePixelsMax && std::isnan(z_after); ++k)
    if (inside(row + k * d_row, col + k * d_col)) z_after = image.z_mm(row + k * d_row, col + k * d_col), after = k;
  if (std::isnan(z_before) || std::isnan(z_after) || before + after > kHolePixelsMax + 1) return std::nullopt;
  const float share = static_cast<float>(before) / static_cast<float>(before + after);
  return Bridge{z_before + share * (z_after - z_before), std::abs(z_after - z_before)};
}
}  // namespace

DepthWindow window_of(std::span<const Eigen::Vector3f> points_supply_mm) {
  std::vector<float> x, y;
  x.reserve(points_supply_mm.size());
  y.reserve(points_supply_mm.size());
  for (const Eigen::Vector3f& p : points_supply_mm)
    if (p.allFinite()) {
      x.push_back(p.x());
      y.push_back(p.y());
    }
  if (x.empty()) return {};
  const Range range_x = robust_range(x), range_y = robust_range(y);
  return {{range_x.min, range_y.min}, {range_x.max, range_y.max}};
}

DepthWindow window_of(const SupplyBox& supply) {
  return {-0.5 * supply.size_mm.head<2>(), 0.5 * supply.size_mm.head<2>()};
}

DepthImageBuilder::DepthImageBuilder(double pixel_mm, const Eigen::Vector2d& min_mm, const Eigen::Vector2d& max_mm)
    : pixel_mm_{pixel_mm}, band_mm_{static_cast<float>(kBandPixels * pixel_mm)} {
  BINPICK_CHECK(std::isfinite(pixel_mm) && pixel_mm > 0);
  BINPICK_CHECK(min_mm.allFinite() && max_mm.allFinite());
  const auto pixels_along = [&](double length_mm) {
    return static_cast<int>(std::clamp(std::ceil(length_mm / pixel_mm - 1e-9), 1.0, static_cast<double>(kPixelsMax)));
  };
  cols_ = pixels_along(max_mm.x() - min_mm.x());
  rows_ = pixels_along(max_mm.y() - min_mm.y());
  const Eigen::Vector2d middle_mm = 0.5 * (min_mm + max_mm);
  origin_mm_ = middle_mm - 0.5 * pixel_mm * Eigen::Vector2d(cols_ - 1, rows_ - 1);
  pixels_.resize(static_cast<std::size_t>(rows_) * static_cast<std::size_t>(cols_));
}

void DepthImageBuilder::add(std::span<const Eigen::Vector3f> points_supply_mm) {
  for (const Eigen::Vector3f& p : points_supply_mm) {
    if (!p.allFinite()) continue;
    const double col = std::floor((p.x() - origin_mm_.x()) / pixel_mm_ + 0.5);
    const double row = std::floor((p.y() - origin_mm_.y()) / pixel_mm_ + 0.5);
    if (!(col >= 0 && row >= 0 && col < cols_ && row < rows_)) continue;
    add_height(pixels_[static_cast<std::size_t>(row) * static_cast<std::size_t>(cols_) + static_cast<std::size_t>(col)],
               p.z());
    ++points_;
  }
}

void DepthImageBuilder::add_height(Pixel& pixel, float z_mm) const {
  const auto join = [&](Surface& surface) {
    ++surface.count;
    surface.mean_mm += (z_mm - surface.mean_mm) / static_cast<float>(surface.count);
  };
  const auto belongs = [&](const Surface& surface) {
    return surface.count > 0 && std::abs(z_mm - surface.mean_mm) <= band_mm_;
  };
  if (pixel.top.count == 0 || belongs(pixel.top)) {
    join(pixel.top);
  } else if (z_mm > pixel.top.mean_mm) {
    pixel.below = pixel.top;
    pixel.top = {z_mm, 1};
  } else if (belongs(pixel.below)) {
    join(pixel.below);
  } else if (pixel.below.count == 0 || z_mm > pixel.below.mean_mm) {
    pixel.below = {z_mm, 1};
  }
}

DepthImage DepthImageBuilder::image() const {
  DepthImage measured;
  measured.pixel_mm = pixel_mm_;
  measured.origin_mm = origin_mm_;
  measured.z_mm.resize(rows_, cols_);
  for (int r = 0; r < rows_; ++r)
    for (int c = 0; c < cols_; ++c) {
      const Pixel& pixel =
          pixels_[static_cast<std::size_t>(r) * static_cast<std::size_t>(cols_) + static_cast<std::size_t>(c)];
      const bool stray = pixel.top.count == 1 && pixel.below.count >= kWellMeasured;
      measured.z_mm(r, c) = pixel.top.count == 0 ? kNotMeasured : stray ? pixel.below.mean_mm : pixel.top.mean_mm;
    }

  // A hole is bridged along the direction whose ends agree best; across a depth jump it stays a hole: nobody knows
  // on which side it lies. Twice, as with pixels of half the point spacing a hole between four points has holes beside
  // it.
  const float step_max_mm = band_mm_;
  DepthImage filled = measured;
  for (int pass = 0; pass < 2; ++pass) {
    const DepthImage before = filled;
    for (int r = 0; r < rows_; ++r)
      for (int c = 0; c < cols_; ++c) {
        if (!std::isnan(before.z_mm(r, c))) continue;
        std::optional<Bridge> best;
        for (const auto& [d_row, d_col] : {std::pair{0, 1}, {1, 0}}) {
          const std::optional<Bridge> candidate = bridge(before, r, c, d_row, d_col);
          if (candidate && (!best || candidate->step_mm < best->step_mm)) best = candidate;
        }
        if (best && best->step_mm <= step_max_mm) filled.z_mm(r, c) = best->z_mm;
      }
  }
  return filled;
}
}  // namespace binpick::vision
