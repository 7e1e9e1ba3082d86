#include "vision/feature.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>

namespace binpick::vision {
namespace {
constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
using Heights = Eigen::Array<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

/// The image with `border` missing pixels around it: no pixel is a special case then, and the compiler can take several
/// at once.
Heights framed(const DepthImage& image, int border) {
  Heights frame = Heights::Constant(image.z_mm.rows() + 2 * border, image.z_mm.cols() + 2 * border, kNan);
  frame.block(border, border, image.z_mm.rows(), image.z_mm.cols()) = image.z_mm;
  return frame;
}
}  // namespace

std::vector<std::uint32_t> features_of(const DepthImage& image, const FeatureRule& rule) {
  const auto rows = static_cast<std::ptrdiff_t>(image.z_mm.rows()),
             cols = static_cast<std::ptrdiff_t>(image.z_mm.cols());
  const int reach = kRingReach * rule.stride;
  const Heights frame = framed(image, reach);
  const float tolerance = rule.tolerance_mm;
  std::vector<std::uint32_t> features(static_cast<std::size_t>(rows * cols), 0);
  std::vector<std::uint32_t> missing(static_cast<std::size_t>(cols));
  for (std::ptrdiff_t row = 0; row < rows; ++row) {
    const float* centre = frame.data() + (row + reach) * frame.cols() + reach;
    std::uint32_t* out = features.data() + row * cols;
    std::uint32_t* gone = missing.data();
    std::fill(missing.begin(), missing.end(), 0U);
    for (std::size_t i = 0; i < kRing.size(); ++i) {
      const float* neighbour = centre + (std::ptrdiff_t{kRing[i].dy} * frame.cols() + kRing[i].dx) * rule.stride;
      const std::uint32_t weight = kDigit[i];
      for (std::ptrdiff_t col = 0; col < cols; ++col) {
        const float d = neighbour[col] - centre[col];
        // digit_of() without a branch.
        const std::uint32_t higher = d > tolerance ? kHigher : 0U, lower = d >= -tolerance ? 0U : kLower;
        out[col] += weight * (higher + lower);
        gone[col] += std::isnan(neighbour[col]) ? 1U : 0U;
      }
    }
    for (std::ptrdiff_t col = 0; col < cols; ++col)
      if (std::isnan(centre[col]) || gone[col] > kMissingMax) out[col] = kNoFeature;
  }
  return features;
}

DepthImage smoothed(const DepthImage& image, float jump_mm) {
  DepthImage out = image;
  const Heights frame = framed(image, 1);
  const auto rows = static_cast<std::ptrdiff_t>(image.z_mm.rows()),
             cols = static_cast<std::ptrdiff_t>(image.z_mm.cols());
  std::vector<float> sums(static_cast<std::size_t>(cols)), counts(static_cast<std::size_t>(cols));
  for (std::ptrdiff_t row = 0; row < rows; ++row) {
    const float* centre = frame.data() + (row + 1) * frame.cols() + 1;
    float *sum = sums.data(), *count = counts.data();
    std::fill(sums.begin(), sums.end(), 0.0F);
    std::fill(counts.begin(), counts.end(), 0.0F);
    for (std::ptrdiff_t dy = -1; dy <= 1; ++dy)
      for (std::ptrdiff_t dx = -1; dx <= 1; ++dx) {
        const float* neighbour = centre + dy * frame.cols() + dx;
        for (std::ptrdiff_t col = 0; col < cols; ++col) {
          const float d = neighbour[col] - centre[col];
          const bool near = std::abs(d) <= jump_mm;
          sum[col] += near ? d : 0.0F;
          count[col] += near ? 1.0F : 0.0F;
        }
      }
    float* to = out.z_mm.data() + row * cols;
    // A missing pixel has no near neighbour, not even itself; 0 / 0 keeps it missing.
    for (std::ptrdiff_t col = 0; col < cols; ++col) to[col] = centre[col] + sum[col] / count[col];
  }
  return out;
}
}  // namespace binpick::vision
