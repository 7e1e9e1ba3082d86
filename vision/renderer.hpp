#pragma once

#include <Eigen/Geometry>
#include <memory>

#include "vision/depth_image.hpp"
#include "vision/mesh.hpp"

namespace binpick::vision {
/// Parallel projection of a mesh along the supply's z axis, as the depth image sees it. One object, one thread.
class DepthRenderer {
 public:
  virtual ~DepthRenderer() = default;
  /// Draws the mesh at T_supply_object into `image`, whose size, pixel_mm and origin_mm the caller has set. A pixel
  /// holds the height of the highest surface at its centre, NaN where there is none.
  virtual void render(const Eigen::Isometry3d& T_supply_object, DepthImage& image) = 0;
};

/// The reference: Mesa's off-screen renderer. One context, bound to the calling thread at each render.
std::unique_ptr<DepthRenderer> make_osmesa_renderer(const Mesh& mesh);
}  // namespace binpick::vision
