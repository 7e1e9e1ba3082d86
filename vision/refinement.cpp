#include "vision/refinement.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <functional>
#include <numeric>

namespace binpick::vision {
namespace {
/// sd of an edge pixel's place, in pixels: the grid, and neighbours that share their points.
constexpr float kEdgeNoisePx = 0.7F;
/// One step goes this far at most, as one sd of a prior: keeps what is not seen where it is.
constexpr double kStepPx = 2.0;
constexpr double kStepRad = 0.15;

/// One more point in groups of eight; what is not there yet of the last group lies outside of any picture.
template <std::size_t N>
void append(std::vector<float>& groups, std::size_t index, const std::array<float, N>& values) {
  constexpr float kNowhere = 1e9F;
  const std::size_t lane = index % kernels::kLanes;
  if (lane == 0) {
    groups.resize(groups.size() + N * kernels::kLanes, 0.0F);
    std::fill(groups.end() - N * kernels::kLanes, groups.end() - (N - 1) * kernels::kLanes, kNowhere);
  }
  float* group = groups.data() + groups.size() - N * kernels::kLanes;
  for (std::size_t k = 0; k < N; ++k) group[k * kernels::kLanes + lane] = values[k];
}

std::size_t filled(std::size_t count) { return (count + kernels::kLanes - 1) / kernels::kLanes * kernels::kLanes; }

/// Calls use(row, col) for every so-manieth of the set bits, so that about `most` are used; a byte for eight pixels.
template <class Use>
void thinned(const std::vector<std::uint8_t>& bits, std::size_t row_bytes, std::size_t most, const Use& use) {
  if (most == 0) return;
  const int count = std::transform_reduce(bits.begin(), bits.end(), 0, std::plus{},
                                          [](std::uint8_t byte) { return std::popcount(byte); });
  const int step = std::max(1, (count + static_cast<int>(most) - 1) / static_cast<int>(most));
  int skip = 0;  // set bits until the next one that is used
  for (std::size_t i = 0; i < bits.size(); ++i) {
    const unsigned byte = bits[i];
    const int here = std::popcount(byte);
    for (; skip < here; skip += step) {
      unsigned rest = byte;
      for (int k = 0; k < skip; ++k) rest &= rest - 1;
      use(static_cast<int>(i / row_bytes), static_cast<int>(i % row_bytes * kernels::kLanes) + std::countr_zero(rest));
    }
    skip -= here;
  }
}
}  // namespace

void ModelPoints::add_surfel(const Eigen::Vector3f& p, const Eigen::Vector3f& n) {
  append<6>(surfels, surfel_count++, {p.x(), p.y(), p.z(), n.x(), n.y(), n.z()});
}
void ModelPoints::add_edge(const Eigen::Vector3f& p, const Eigen::Vector2f& out) {
  append<5>(edges, edge_count++, {p.x(), p.y(), p.z(), out.x(), out.y()});
}

ModelPoints model_points(const View& view, const Pose& pose, std::size_t surface_max, std::size_t edges_max) {
  const Eigen::Matrix3f turn = pose.R * view.R_supply_object.toRotationMatrix().transpose();
  const Eigen::Vector3f anchor = pose.R * view.anchors_object_mm.front() + pose.t;
  ModelPoints model;
  for (const SurfaceSample& sample : view.surface.first(std::min(surface_max, view.surface.size())))
    model.add_surfel(anchor + turn * sample.p_mm, turn * sample.normal);
  for (const Eigen::Vector3f& edge : view.edges_mm.first(std::min(edges_max, view.edges_mm.size())))
    model.add_edge(anchor + turn * edge, Eigen::Vector2f::Zero());
  return model;
}

ModelPoints model_points(const Scene& scene, const Rasteriser& part, const Pose& pose, const Template& drawn,
                         std::size_t surface_max, std::size_t edges_max, const kernels::Table& loops) {
  ModelPoints model;
  if (drawn.rows == 0) return model;
  const std::size_t row_bytes = filled(static_cast<std::size_t>(drawn.cols)) / kernels::kLanes;
  thread_local std::vector<std::uint8_t> inner, edges;
  inner.resize(row_bytes * static_cast<std::size_t>(drawn.rows));
  edges.resize(inner.size());
  const std::size_t first = drawn.at(0, 0);
  kernels::Drawn pixels;
  pixels.top_mm = drawn.top_mm.data() + first;
  pixels.triangle = drawn.triangle.data() + first;
  pixels.rows = drawn.rows, pixels.cols = drawn.cols, pixels.stride = drawn.stride;
  loops.outline(pixels, scene.jump_mm, inner.data(), edges.data());

  const auto place = [&](int r, int c) {
    return Eigen::Vector3f(static_cast<float>(scene.origin_mm.x() + scene.pixel_mm * (c + drawn.col0)),
                           static_cast<float>(scene.origin_mm.y() + scene.pixel_mm * (r + drawn.row0)),
                           drawn.top_mm[drawn.at(r, c)]);
  };
  thinned(inner, row_bytes, surface_max, [&](int r, int c) {
    const Eigen::Vector3f n = pose.R * part.normal(drawn.triangle[drawn.at(r, c)]);
    model.add_surfel(place(r, c), n.z() < 0 ? Eigen::Vector3f(-n) : n);
  });
  thinned(edges, row_bytes, edges_max, [&](int r, int c) {
    const float z = drawn.top_mm[drawn.at(r, c)];
    const auto ends = [&](int dr, int dc) {
      return !(z - drawn.top_mm[drawn.at(r + dr, c + dc)] <= scene.jump_mm) ? 1.0F : 0.0F;
    };
    model.add_edge(place(r, c), Eigen::Vector2f(ends(0, 1) - ends(0, -1), ends(1, 0) - ends(-1, 0)).normalized());
  });
  return model;
}

Matrix6 refine(const Scene& scene, const ModelPoints& model, const Eigen::Vector3f& centre_supply_mm,
               const RefineOptions& options, Pose& pose) {
  const auto pixel_mm = static_cast<float>(scene.pixel_mm);
  const kernels::Table& loops = kernels::table();
  const kernels::Picture picture = picture_of(scene, options.single_heights);
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
    const Eigen::Vector3f centre = centre_supply_mm + shift;
    const kernels::Motion motion = motion_of(turn, centre - turn * centre_supply_mm);
    std::array<float, kernels::kNormalSums> sums{};
    loops.match_surface(picture, motion, centre.data(), model.surfels.data(), filled(model.surfel_count), gate,
                        height_weight, sums.data());
    loops.match_edges(picture, motion, centre.data(), model.edges.data(), filled(model.edge_count), edge_gate,
                      edge_weight, sums.data());
    Eigen::Matrix<double, 6, 1> gradient;
    for (Eigen::Index r = 0, k = 0; r < 6; ++r) {
      for (Eigen::Index c = r; c < 6; ++c, ++k)
        information(r, c) = information(c, r) = static_cast<double>(sums[static_cast<std::size_t>(k)]);
      gradient[r] = static_cast<double>(sums[static_cast<std::size_t>(21 + r)]);
    }
    Matrix6 damped = information;
    damped.diagonal() *= 1.001;
    const double step_mm = kStepPx * scene.pixel_mm;
    damped.diagonal().head<3>().array() += 1 / (step_mm * step_mm);
    damped.diagonal().tail<3>().array() += 1 / (kStepRad * kStepRad);
    const Eigen::Matrix<float, 6, 1> delta = damped.ldlt().solve(gradient).cast<float>();
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
