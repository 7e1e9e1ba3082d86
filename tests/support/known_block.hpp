#pragma once

#include "vision/depth_image.hpp"

/// How well a depth image shows the block of scene_with_block().
namespace binpick::support {
struct BlockErrors {
  double floor_mm = 0, top_mm = 0;  ///< Largest distance of the fitted plane from the true one over its own extent.
  double centre_mm = 0;             ///< Lateral error of the middle of the top: of its side planes, taken together.
};
/// Throws std::runtime_error when floor or block are hardly seen.
BlockErrors errors_of_block(const vision::DepthImage& image);
}  // namespace binpick::support
