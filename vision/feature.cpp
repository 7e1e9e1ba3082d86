#include "vision/feature.hpp"

#include <cmath>
#include <cstddef>
#include <limits>

namespace binpick::vision {
namespace {
std::uint32_t feature_at_border(const DepthImage& image, const FeatureRule& rule, int row, int col) {
  const auto rows = static_cast<int>(image.z_mm.rows()), cols = static_cast<int>(image.z_mm.cols());
  const float centre = image.z_mm(row, col);
  std::uint32_t feature = 0;
  int missing = 0;
  for (std::size_t i = 0; i < kRing.size(); ++i) {
    const int r = row + kRing[i].dy * rule.stride, c = col + kRing[i].dx * rule.stride;
    const bool inside = r >= 0 && r < rows && c >= 0 && c < cols;
    const float z = inside ? image.z_mm(r, c) : std::numeric_limits<float>::quiet_NaN();
    missing += std::isnan(z) ? 1 : 0;
    feature += kDigit[i] * digit_of(centre, z, rule.tolerance_mm);
  }
  return missing > kMissingMax ? kNoFeature : feature;
}
}  // namespace

std::vector<std::uint32_t> features_of(const DepthImage& image, const FeatureRule& rule) {
  const auto rows = static_cast<int>(image.z_mm.rows()), cols = static_cast<int>(image.z_mm.cols());
  const int reach = kRingReach * rule.stride;
  std::vector<std::uint32_t> features(static_cast<std::size_t>(rows) * static_cast<std::size_t>(cols), kNoFeature);
  std::array<std::ptrdiff_t, kRing.size()> steps{};
  for (std::size_t i = 0; i < kRing.size(); ++i)
    steps[i] = (std::ptrdiff_t{kRing[i].dy} * cols + kRing[i].dx) * rule.stride;
  for (int row = 0; row < rows; ++row) {
    const float* z = image.z_mm.data() + std::ptrdiff_t{row} * cols;
    std::uint32_t* out = features.data() + std::ptrdiff_t{row} * cols;
    const bool inner_row = row >= reach && row < rows - reach;
    for (int col = 0; col < cols; ++col) {
      if (std::isnan(z[col])) continue;
      if (!inner_row || col < reach || col >= cols - reach) {
        out[col] = feature_at_border(image, rule, row, col);
        continue;
      }
      const float centre = z[col];
      std::uint32_t feature = 0;
      int missing = 0;
      for (std::size_t i = 0; i < kRing.size(); ++i) {
        const float neighbour = z[col + steps[i]];
        missing += neighbour != neighbour ? 1 : 0;
        feature += kDigit[i] * digit_of(centre, neighbour, rule.tolerance_mm);
      }
      if (missing <= kMissingMax) out[col] = feature;
    }
  }
  return features;
}

DepthImage smoothed(const DepthImage& image, float jump_mm) {
  DepthImage out = image;
  const auto rows = static_cast<int>(image.z_mm.rows()), cols = static_cast<int>(image.z_mm.cols());
  for (int row = 0; row < rows; ++row)
    for (int col = 0; col < cols; ++col) {
      const float centre = image.z_mm(row, col);
      if (std::isnan(centre)) continue;
      float sum = 0;
      int count = 0;
      for (int r = row > 0 ? row - 1 : 0; r <= row + 1 && r < rows; ++r)
        for (int c = col > 0 ? col - 1 : 0; c <= col + 1 && c < cols; ++c) {
          const float d = image.z_mm(r, c) - centre;
          if (!(std::abs(d) <= jump_mm)) continue;
          sum += d;
          ++count;
        }
      out.z_mm(row, col) = centre + sum / static_cast<float>(count);
    }
  return out;
}
}  // namespace binpick::vision
