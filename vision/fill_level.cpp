#include "vision/fill_level.hpp"

#include <algorithm>
#include <cmath>

namespace binpick::vision {
FillLevel fill_level(const DepthImage& image, const SupplyBox& supply, double noise_mm) {
  constexpr Eigen::Index kRim = 3;
  FillLevel fill;
  std::size_t pixels = 0;
  std::size_t measured = 0;
  double height_sum_mm = 0;
  const double occupied_from_mm = 5 * noise_mm;
  for (Eigen::Index r = kRim; r < image.z_mm.rows() - kRim; ++r) {
    for (Eigen::Index c = kRim; c < image.z_mm.cols() - kRim; ++c) {
      ++pixels;
      const double z_mm = static_cast<double>(image.z_mm(r, c));
      if (!std::isfinite(z_mm)) continue;
      ++measured;
      height_sum_mm += std::max(0.0, z_mm);
      if (z_mm > occupied_from_mm) fill.occupied_mm2 += image.pixel_mm * image.pixel_mm;
    }
  }
  if (measured == 0) return fill;
  fill.measured = static_cast<double>(measured) / static_cast<double>(pixels);
  if (supply.size_mm.z() > 0)
    fill.share = std::clamp(height_sum_mm / static_cast<double>(measured) / supply.size_mm.z(), 0.0, 1.0);
  return fill;
}
}  // namespace binpick::vision
