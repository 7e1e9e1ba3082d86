#pragma once

#include "vision/depth_image.hpp"

namespace binpick::vision {
/// Of the supply: a scan that saw less and has found nothing tells little of it.
inline constexpr double kMeasuredMin = 0.3;

struct FillLevel {
  double share = 0;  ///< Mean height over the floor as a share of the wall height, 0 … 1; 0 when that is not known.
  double occupied_mm2 = 0;  ///< Area of the floor on which something lies.
  double measured = 0;      ///< Share of the pixels that were measured, 0 … 1.
};

/// What lies in the supply, whatever it is. A pixel counts as occupied from `noise_mm` × 5 over the floor; a rim of
/// three pixels along the walls does not count (noise of the walls stands there).
FillLevel fill_level(const DepthImage& image, const SupplyBox& supply, double noise_mm);
}  // namespace binpick::vision
