#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "vision/depth_image.hpp"
#include "vision/knowledge_base_impl.hpp"

/// The ternary feature: what a pixel's surroundings look like, in one number. Training and detection must call the same
/// functions on images that were smoothed alike.
namespace binpick::vision {
struct PixelOffset {
  int dy, dx;
};
/// The ring of twelve, in units of the stride. It maps onto itself in a quarter turn about the pixel.
inline constexpr std::array<PixelOffset, 12> kRing{
    {{0, 1}, {0, -1}, {1, 0}, {-1, 0}, {0, 3}, {0, -3}, {3, 0}, {-3, 0}, {2, 2}, {2, -2}, {-2, 2}, {-2, -2}}};
inline constexpr int kRingReach = 3;

/// The weight of each neighbour's digit.
inline constexpr std::array<std::uint32_t, 12> kDigit = [] {
  std::array<std::uint32_t, 12> weights{};
  std::uint32_t weight = 1;
  for (auto& w : weights) {
    w = weight;
    weight *= 3;
  }
  return weights;
}();
static_assert(kDigit.back() * 3 == kFeatureCount);

inline constexpr std::uint32_t kEqual = 0, kLower = 1, kHigher = 2;
/// No feature here: the pixel is not measured, or too few of its neighbours are.
inline constexpr std::uint32_t kNoFeature = kFeatureCount;
/// All twelve equal: a plane tells nothing.
inline constexpr std::uint32_t kPlaneFeature = 0;
/// A missing neighbour counts as lower, since small holes were filled and what is still missing lies mostly in the
/// shadow behind an edge; a pixel with more of them has no feature.
inline constexpr int kMissingMax = 4;

struct FeatureRule {
  float tolerance_mm = 1;  ///< Height difference up to which two pixels count as equal.
  int stride = 1;          ///< Pixels per unit of the ring.
};

/// One digit of the feature: how a neighbour stands to the centre. NaN: lower.
constexpr std::uint32_t digit_of(float centre_mm, float neighbour_mm, float tolerance_mm) {
  const float d = neighbour_mm - centre_mm;
  if (d > tolerance_mm) return kHigher;
  return d >= -tolerance_mm ? kEqual : kLower;
}

/// The feature of every pixel, row by row as in the image. Pixels outside the image are missing.
std::vector<std::uint32_t> features_of(const DepthImage& image, const FeatureRule& rule);

/// Mean of those of the 3 × 3 neighbours that lie within `jump_mm` of the centre: noise shrinks to about 0.4, edges
/// stay. NaN stays NaN.
DepthImage smoothed(const DepthImage& image, float jump_mm);
/// The jump that training and detection smooth with.
inline float smoothing_jump_mm(double noise_mm, double pixel_mm) {
  return static_cast<float>(4 * noise_mm > 1.2 * pixel_mm ? 4 * noise_mm : 1.2 * pixel_mm);
}
}  // namespace binpick::vision
