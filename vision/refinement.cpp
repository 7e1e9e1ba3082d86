#include "vision/refinement.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <array>
#include <cmath>

namespace binpick::vision {
namespace {
/// sd of an edge pixel's place, in pixels: the grid, and neighbours that share their points.
constexpr float kEdgeNoisePx = 0.7F;
constexpr float kEdgeCosine = 0.5F;
/// One step goes this far at most, as one sd of a prior: keeps what is not seen where it is.
constexpr double kStepPx = 2.0;
constexpr double kStepRad = 0.15;

float tukey(float residual, float gate) {
  const float share = residual / gate;
  if (std::abs(share) >= 1) return 0;
  const float w = 1 - share * share;
  return w * w;
}

struct Normal {
  Matrix6 information = Matrix6::Zero();
  Eigen::Matrix<double, 6, 1> gradient = Eigen::Matrix<double, 6, 1>::Zero();

  /// One residual along n at p (relative to the centre of rotation).
  void add(const Eigen::Vector3f& p, const Eigen::Vector3f& n, float residual, float weight) {
    Eigen::Matrix<float, 6, 1> J;
    J << n, p.cross(n);
    const Eigen::Matrix<float, 6, 1> Jw = weight * J;
    information.noalias() += (Jw * J.transpose()).cast<double>();
    gradient += (Jw * residual).cast<double>();
  }
};
}  // namespace

ModelPoints model_points(const View& view, const Pose& pose) {
  const Eigen::Matrix3f turn = pose.R * view.R_supply_object.toRotationMatrix().transpose();
  const Eigen::Vector3f anchor = pose.R * view.anchors_object_mm.front() + pose.t;
  ModelPoints model;
  model.surface.reserve(view.surface.size());
  for (const SurfaceSample& sample : view.surface)
    model.surface.push_back({anchor + turn * sample.p_mm, turn * sample.normal});
  for (const Eigen::Vector3f& edge : view.edges_mm)
    model.edges.push_back({anchor + turn * edge, Eigen::Vector2f::Zero()});
  return model;
}

ModelPoints model_points(const Scene& scene, const Rasteriser& part, const Pose& pose, const Template& drawn,
                         std::size_t surface_max, std::size_t edges_max) {
  const float jump_mm = scene.jump_mm;
  constexpr std::array<std::array<int, 2>, 4> kCross{{{0, 1}, {1, 0}, {0, -1}, {-1, 0}}};
  struct Found {
    int row, col;
    Eigen::Vector2f out;
  };
  std::vector<Found> inner, edges;
  for (int r = 0; r < drawn.rows; ++r)
    for (int c = 0; c < drawn.cols; ++c) {
      const std::size_t i = drawn.at(r, c);
      if (drawn.triangle[i] < 0) continue;
      Eigen::Vector2f out = Eigen::Vector2f::Zero();
      bool beside_higher = false;
      for (const auto& [dr, dc] : kCross) {
        const bool in = r + dr >= 0 && c + dc >= 0 && r + dr < drawn.rows && c + dc < drawn.cols;
        const float beside = in ? drawn.top_mm[drawn.at(r + dr, c + dc)] : std::numeric_limits<float>::quiet_NaN();
        if (!(drawn.top_mm[i] - beside <= jump_mm))
          out += Eigen::Vector2f(static_cast<float>(dc), static_cast<float>(dr));
        beside_higher |= beside - drawn.top_mm[i] > jump_mm;
      }
      if (out.squaredNorm() > 0.5F)
        edges.push_back({r, c, out.normalized()});
      else if (!beside_higher)
        inner.push_back({r, c, out});
    }
  const auto place = [&](const Found& f) {
    return Eigen::Vector3f(static_cast<float>(scene.origin_mm.x() + scene.pixel_mm * (f.col + drawn.col0)),
                           static_cast<float>(scene.origin_mm.y() + scene.pixel_mm * (f.row + drawn.row0)),
                           drawn.top_mm[drawn.at(f.row, f.col)]);
  };
  ModelPoints model;
  const auto thin = [](std::size_t count, std::size_t most) {
    return std::max<std::size_t>(1, (count + most - 1) / most);
  };
  for (std::size_t k = 0, step = thin(inner.size(), surface_max); k < inner.size(); k += step) {
    Eigen::Vector3f n = pose.R * part.normal(drawn.triangle[drawn.at(inner[k].row, inner[k].col)]);
    if (n.z() < 0) n = -n;
    model.surface.push_back({place(inner[k]), n});
  }
  for (std::size_t k = 0, step = thin(edges.size(), edges_max); k < edges.size(); k += step)
    model.edges.push_back({place(edges[k]), edges[k].out});
  return model;
}

Matrix6 refine(const Scene& scene, const ModelPoints& model, const Eigen::Vector3f& centre_supply_mm,
               const RefineOptions& options, Pose& pose) {
  const auto per_mm = static_cast<float>(1 / scene.pixel_mm);
  const auto pixel_mm = static_cast<float>(scene.pixel_mm);
  const Eigen::Vector2f origin = scene.origin_mm.cast<float>();
  const Grid<float>& heights = options.single_heights ? scene.measured_mm : scene.z_mm;
  const auto height_weight = static_cast<float>(1 / (scene.noise_mm * scene.noise_mm));
  const float edge_weight = 1 / (kEdgeNoisePx * kEdgeNoisePx * pixel_mm * pixel_mm);

  Eigen::Matrix3f turn = Eigen::Matrix3f::Identity();
  Eigen::Vector3f shift = Eigen::Vector3f::Zero();
  Matrix6 information = Matrix6::Zero();
  for (int step = 0; step < options.steps; ++step) {
    const float share = options.steps > 1 ? static_cast<float>(step) / static_cast<float>(options.steps - 1) : 1.0F;
    const float gate = options.gate_from_mm + share * (options.gate_to_mm - options.gate_from_mm);
    const float edge_gate =
        pixel_mm * (options.edge_gate_from_px + share * (options.edge_gate_to_px - options.edge_gate_from_px));
    Normal normal;
    for (const ModelPoints::Surfel& surfel : model.surface) {
      const Eigen::Vector3f arm = turn * (surfel.p - centre_supply_mm);
      const Eigen::Vector3f p = centre_supply_mm + shift + arm;
      const Eigen::Vector3f n = turn * surfel.n;
      const float x = (p.x() - origin.x()) * per_mm, y = (p.y() - origin.y()) * per_mm;
      const auto col = static_cast<int>(std::lround(x)), row = static_cast<int>(std::lround(y));
      if (!scene.inside(row, col)) continue;
      const float z = heights(row, col) + pixel_mm * (scene.slope_x(row, col) * (x - static_cast<float>(col)) +
                                                      scene.slope_y(row, col) * (y - static_cast<float>(row)));
      const float d = z - p.z();
      if (!(std::abs(d) < 2 * gate)) continue;
      const float residual = n.z() * d;
      const float weight = tukey(residual, gate);
      if (weight > 0) normal.add(arm, n, residual, weight * height_weight);
    }
    for (const ModelPoints::Edge& edge : model.edges) {
      const Eigen::Vector3f arm = turn * (edge.p - centre_supply_mm);
      const Eigen::Vector3f p = centre_supply_mm + shift + arm;
      const float x = (p.x() - origin.x()) * per_mm, y = (p.y() - origin.y()) * per_mm;
      const auto col = static_cast<int>(std::lround(x)), row = static_cast<int>(std::lround(y));
      if (!scene.inside(row, col)) continue;
      const std::int32_t nearest = scene.nearest_edge(row, col);
      if (nearest < 0) continue;
      const int edge_row = nearest / scene.cols(), edge_col = nearest % scene.cols();
      if (!(std::abs(scene.z_mm(edge_row, edge_col) - p.z()) < scene.jump_mm)) continue;
      const Eigen::Vector2f out_scene(scene.edge_out_x(edge_row, edge_col), scene.edge_out_y(edge_row, edge_col));
      Eigen::Vector2f out = out_scene;
      if (edge.out.squaredNorm() > 0.5F) {
        out = (turn.topLeftCorner<2, 2>() * edge.out).normalized();
        if (out.dot(out_scene) < kEdgeCosine) continue;
      }
      const Eigen::Vector2f away(pixel_mm * (static_cast<float>(edge_col) - x),
                                 pixel_mm * (static_cast<float>(edge_row) - y));
      const float residual = out.dot(away);
      const float weight = tukey(residual, edge_gate);
      if (weight > 0) normal.add(arm, Eigen::Vector3f(out.x(), out.y(), 0), residual, weight * edge_weight);
    }
    information = normal.information;
    Matrix6 damped = information;
    damped.diagonal() *= 1.001;
    const double step_mm = kStepPx * scene.pixel_mm;
    damped.diagonal().head<3>().array() += 1 / (step_mm * step_mm);
    damped.diagonal().tail<3>().array() += 1 / (kStepRad * kStepRad);
    const Eigen::Matrix<float, 6, 1> delta = damped.ldlt().solve(normal.gradient).cast<float>();
    if (!delta.allFinite()) break;
    const float angle = delta.tail<3>().norm();
    if (angle > 1e-9F) turn = Eigen::AngleAxisf(angle, delta.tail<3>() / angle).toRotationMatrix() * turn;
    shift += delta.head<3>();
    if (angle < 1e-5F && delta.head<3>().norm() < 1e-3F * pixel_mm && step + 1 < options.steps)
      step = options.steps - 2;  // settled: straight to the narrow gate
  }
  pose.R = Eigen::Quaternionf(turn * pose.R).normalized().toRotationMatrix();
  // pose.t turned with the old R as well: the object's origin moves with the body.
  pose.t = centre_supply_mm + shift + turn * (pose.t - centre_supply_mm);
  return information;
}
}  // namespace binpick::vision
