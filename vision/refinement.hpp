#pragma once

#include <Eigen/Core>
#include <vector>

#include "vision/verification.hpp"

namespace binpick::vision {
using Matrix6 = Eigen::Matrix<double, 6, 6>;

/// What of the model is matched with the scene: points of the visible surface with their normals and points of its
/// depth edges with the direction in which the surface ends; supply axes, mm, at the pose that is refined. Kept by
/// eights, as the inner loops want them.
class ModelPoints {
 public:
  void add_surfel(const Eigen::Vector3f& p, const Eigen::Vector3f& n);
  /// `out` has length 1; zero: taken from the scene's edge.
  void add_edge(const Eigen::Vector3f& p, const Eigen::Vector2f& out);

  std::vector<float> surfels, edges;  ///< Groups of 6 × 8 and 5 × 8 values.
  std::size_t surfel_count = 0, edge_count = 0;
};
/// Of a view's samples at a pose near the view's own rotation: its first ones.
ModelPoints model_points(const View& view, const Pose& pose, std::size_t surface_max, std::size_t edges_max);
/// Of a rendered template: up to about `surface_max` pixels and `edges_max` edge pixels, evenly thinned.
ModelPoints model_points(const Scene& scene, const Rasteriser& part, const Pose& pose, const Template& drawn,
                         std::size_t surface_max, std::size_t edges_max,
                         const kernels::Table& loops = kernels::table());

struct RefineOptions {
  int steps = 4;
  float gate_from_mm = 10;  ///< Residuals beyond have no weight (Tukey); narrows to gate_to_mm with the steps.
  float gate_to_mm = 5;
  float edge_gate_from_px = 4;
  float edge_gate_to_px = 2;
  bool single_heights = false;  ///< Match the single heights: unbiased at corners; else the smoothed surface.
};

/// Iterated point-to-plane matching (Chen & Medioni 1992) against the depth image: the scene point of a model point is
/// the one above or below it. Damped (Levenberg-Marquardt): what the view does not tell stays as it is. Edges tell what
/// a flat face does not. Changes `pose`, which turns about `centre_supply_mm`; returns the information (inverse
/// covariance) of (translation, rotation about that centre), supply axes, from the noise of single heights.
Matrix6 refine(const Scene& scene, const ModelPoints& model, const Eigen::Vector3f& centre_supply_mm,
               const RefineOptions& options, Pose& pose);
}  // namespace binpick::vision
