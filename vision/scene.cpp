#include "vision/scene.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <vector>

namespace binpick::vision {
namespace {
constexpr float kNotMeasured = std::numeric_limits<float>::quiet_NaN();
constexpr float kAbsurdMm = 1e6F;
/// A pixel with fewer neighbours on its own surface is a mixed echo at an edge or dirt in the air.
constexpr int kNeighboursMin = 2;
/// How far an edge looks over a hole for the surface beyond it.
constexpr int kHoleReachPx = 3;

struct Step {
  int row, col;
};
constexpr std::array<Step, 8> kNeighbours{{{0, 1}, {1, 1}, {1, 0}, {1, -1}, {0, -1}, {-1, -1}, {-1, 0}, {-1, 1}}};

Grid<float> without_specks(const Grid<float>& z, float jump_mm) {
  Grid<float> clean = z;
  const auto rows = static_cast<int>(z.rows()), cols = static_cast<int>(z.cols());
  for (int r = 0; r < rows; ++r)
    for (int c = 0; c < cols; ++c) {
      if (std::isnan(z(r, c))) continue;
      int same = 0;
      for (const Step& step : kNeighbours) {
        const int nr = r + step.row, nc = c + step.col;
        if (nr < 0 || nc < 0 || nr >= rows || nc >= cols) continue;
        same += std::abs(z(nr, nc) - z(r, c)) <= jump_mm;
      }
      if (same < kNeighboursMin) clean(r, c) = kNotMeasured;
    }
  return clean;
}

struct Plane {
  float z, slope_x, slope_y;
};

/// Least-squares plane through the pixels within `radius` on the same surface as (row, col), slopes per pixel.
Plane fit_plane(const Grid<float>& z, int row, int col, int radius, float centre_mm, float jump_mm) {
  const auto rows = static_cast<int>(z.rows()), cols = static_cast<int>(z.cols());
  float n = 0, sx = 0, sy = 0, sz = 0, sxx = 0, sxy = 0, syy = 0, sxz = 0, syz = 0;
  for (int r = std::max(0, row - radius); r <= std::min(rows - 1, row + radius); ++r)
    for (int c = std::max(0, col - radius); c <= std::min(cols - 1, col + radius); ++c) {
      const float d = z(r, c) - centre_mm;
      if (!(std::abs(d) <= jump_mm)) continue;
      const auto x = static_cast<float>(c - col), y = static_cast<float>(r - row);
      n += 1, sx += x, sy += y, sz += d, sxx += x * x, sxy += x * y, syy += y * y, sxz += x * d, syz += y * d;
    }
  if (n < 1) return {centre_mm, 0, 0};
  const float mx = sx / n, my = sy / n, mz = sz / n;
  const float cxx = sxx - n * mx * mx, cxy = sxy - n * mx * my, cyy = syy - n * my * my;
  const float cxz = sxz - n * mx * mz, cyz = syz - n * my * mz;
  const float determinant = cxx * cyy - cxy * cxy;
  if (n < 4 || determinant < 0.5F) return {centre_mm + mz, 0, 0};
  const float a = (cxz * cyy - cyz * cxy) / determinant, b = (cyz * cxx - cxz * cxy) / determinant;
  return {centre_mm + mz - a * mx - b * my, a, b};
}

void fit_planes(Scene& scene) {
  const int rows = scene.rows(), cols = scene.cols();
  const Grid<float>& measured = scene.measured_mm;
  for (int r = 0; r < rows; ++r)
    for (int c = 0; c < cols; ++c)
      if (!std::isnan(measured(r, c))) scene.z_mm(r, c) = fit_plane(measured, r, c, 1, measured(r, c), scene.jump_mm).z;
  const auto per_mm = static_cast<float>(1 / scene.pixel_mm);
  for (int r = 0; r < rows; ++r)
    for (int c = 0; c < cols; ++c) {
      if (std::isnan(scene.z_mm(r, c))) continue;
      const Plane plane = fit_plane(scene.z_mm, r, c, 2, scene.z_mm(r, c), 1.25F * scene.jump_mm);
      scene.slope_x(r, c) = plane.slope_x * per_mm;
      scene.slope_y(r, c) = plane.slope_y * per_mm;
    }
}

void find_bend(Scene& scene) {
  constexpr std::array<Step, 4> kPairs{{{0, 2}, {2, 0}, {2, 2}, {2, -2}}};
  for (int r = 2; r < scene.rows() - 2; ++r)
    for (int c = 2; c < scene.cols() - 2; ++c) {
      const float centre = scene.z_mm(r, c);
      float sum = 0;
      int pairs = 0;
      for (const Step& step : kPairs) {
        const float a = scene.z_mm(r + step.row, c + step.col), b = scene.z_mm(r - step.row, c - step.col);
        if (!(std::abs(a - centre) <= scene.jump_mm && std::abs(b - centre) <= scene.jump_mm)) continue;
        sum += a + b - 2 * centre;
        ++pairs;
      }
      if (pairs >= 2) scene.bend_mm(r, c) = sum / static_cast<float>(pairs);
    }
}

/// Whether the surface at (row, col) ends in this direction: the next measured pixel lies a jump lower, or there is a
/// hole too wide to be a missing point.
bool ends(const Scene& scene, int row, int col, const Step& step) {
  const float z = scene.z_mm(row, col);
  for (int k = 1; k <= kHoleReachPx; ++k) {
    const int r = row + k * step.row, c = col + k * step.col;
    if (!scene.inside(r, c)) return false;
    if (!std::isnan(scene.z_mm(r, c)))
      return z - scene.z_mm(r, c) > scene.jump_mm * static_cast<float>(k == 1 ? 1 : 1.5);
  }
  return true;
}

void find_edges(Scene& scene) {
  for (int r = 0; r < scene.rows(); ++r)
    for (int c = 0; c < scene.cols(); ++c) {
      if (std::isnan(scene.z_mm(r, c))) continue;
      float x = 0, y = 0;
      bool straight = false;
      for (std::size_t k = 0; k < kNeighbours.size(); ++k)
        if (ends(scene, r, c, kNeighbours[k])) {
          const float length = k % 2 == 0 ? 1.0F : std::numbers::sqrt2_v<float>;
          x += static_cast<float>(kNeighbours[k].col) / length;
          y += static_cast<float>(kNeighbours[k].row) / length;
          straight |= k % 2 == 0;
        }
      const float norm = std::hypot(x, y);
      if (!straight || norm < 1e-3F) continue;
      scene.edge(r, c) = 1;
      scene.edge_out_x(r, c) = x / norm;
      scene.edge_out_y(r, c) = y / norm;
    }
}

/// Nearest edge by two sweeps of vector propagation (Danielsson 1980): exact to a fraction of a pixel.
void spread_edges(Scene& scene) {
  const int rows = scene.rows(), cols = scene.cols();
  const auto distance = [&](int r, int c, std::int32_t index) {
    if (index < 0) return std::numeric_limits<float>::max();
    const auto dr = static_cast<float>(index / cols - r), dc = static_cast<float>(index % cols - c);
    return dr * dr + dc * dc;
  };
  Grid<std::int32_t>& nearest = scene.nearest_edge;
  for (int r = 0; r < rows; ++r)
    for (int c = 0; c < cols; ++c) nearest(r, c) = scene.edge(r, c) ? r * cols + c : -1;
  const auto relax = [&](int r, int c, int nr, int nc) {
    if (nr < 0 || nc < 0 || nr >= rows || nc >= cols) return;
    if (distance(r, c, nearest(nr, nc)) < distance(r, c, nearest(r, c))) nearest(r, c) = nearest(nr, nc);
  };
  for (int r = 0; r < rows; ++r) {
    for (int c = 0; c < cols; ++c)
      for (const Step& s : {Step{-1, 0}, {0, -1}, {-1, -1}, {-1, 1}}) relax(r, c, r + s.row, c + s.col);
    for (int c = cols - 1; c >= 0; --c) relax(r, c, r, c + 1);
  }
  for (int r = rows - 1; r >= 0; --r) {
    for (int c = cols - 1; c >= 0; --c)
      for (const Step& s : {Step{1, 0}, {0, 1}, {1, -1}, {1, 1}}) relax(r, c, r + s.row, c + s.col);
    for (int c = 0; c < cols; ++c) relax(r, c, r, c - 1);
  }
  for (int r = 0; r < rows; ++r)
    for (int c = 0; c < cols; ++c) {
      const float d = nearest(r, c) < 0 ? kEdgeReachPx : std::sqrt(distance(r, c, nearest(r, c)));
      scene.edge_distance_px(r, c) = std::min(d, static_cast<float>(kEdgeReachPx));
      if (d >= kEdgeReachPx) nearest(r, c) = -1;
    }
}
}  // namespace

float jump_of(double noise_mm, double pixel_mm) { return static_cast<float>(std::max(4 * noise_mm, 1.2 * pixel_mm)); }

Scene prepare_scene(const DepthImage& image, double noise_mm) {
  Scene scene;
  scene.pixel_mm = image.pixel_mm;
  scene.origin_mm = image.origin_mm;
  scene.noise_mm = noise_mm;
  scene.jump_mm = jump_of(noise_mm, image.pixel_mm);
  const Eigen::Index rows = image.z_mm.rows(), cols = image.z_mm.cols();
  const Grid<float> finite =
      image.z_mm.unaryExpr([](float z) { return std::isfinite(z) && std::abs(z) < kAbsurdMm ? z : kNotMeasured; });
  scene.measured_mm = without_specks(finite, scene.jump_mm);
  scene.z_mm = Grid<float>::Constant(rows, cols, kNotMeasured);
  for (Grid<float>* grid : {&scene.slope_x, &scene.slope_y, &scene.bend_mm, &scene.edge_out_x, &scene.edge_out_y})
    *grid = Grid<float>::Zero(rows, cols);
  scene.edge = Grid<std::uint8_t>::Zero(rows, cols);
  scene.edge_distance_px = Grid<float>::Constant(rows, cols, kEdgeReachPx);
  scene.nearest_edge = Grid<std::int32_t>::Constant(rows, cols, -1);
  fit_planes(scene);
  find_bend(scene);
  find_edges(scene);
  spread_edges(scene);
  return scene;
}
}  // namespace binpick::vision
