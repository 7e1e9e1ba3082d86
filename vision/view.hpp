#pragma once

#include "vision/depth_image.hpp"
#include "vision/knowledge_base_impl.hpp"
#include "vision/renderer.hpp"

namespace binpick::vision {
inline constexpr int kSurfaceSamples = 128;  ///< Of one view; any first n of them are spread evenly, too.
inline constexpr int kEdgeSamples = 48;
inline constexpr std::size_t kAnchorsMax = 4;

/// Neighbouring pixels further apart in height than this belong to different surfaces of a rendered part.
inline float render_jump_mm(double noise_mm, double pixel_mm) {
  return static_cast<float>(4 * noise_mm > 2.5 * pixel_mm ? 4 * noise_mm : 2.5 * pixel_mm);
}

/// An image without content around the part in this rotation, its origin at the object's, moved by `shift_px` against
/// the pixel grid, with `margin_px` free pixels around it.
DepthImage window_around(const Mesh& mesh, const Eigen::Matrix3d& R_supply_object, double pixel_mm, int margin_px,
                         const Eigen::Vector2d& shift_px);

/// What detection wants to know of a rotation, from its rendered depth image without noise.
/// `depth_mm` is the thickness of the top plateau whose centroid is the first anchor.
TrainedView view_of(const DepthImage& rendered, const Mesh& mesh, const Eigen::Quaterniond& R_supply_object,
                    double noise_mm, double diameter_mm);
/// Thickness of the layer under a maximum that counts as its plateau: noise makes any of its points the highest.
inline float plateau_mm(double noise_mm, double diameter_mm) {
  return static_cast<float>(2 * noise_mm > 0.02 * diameter_mm ? 2 * noise_mm : 0.02 * diameter_mm);
}
}  // namespace binpick::vision
