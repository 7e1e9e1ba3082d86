#include "vision/view.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace binpick::vision {
namespace {
struct Pixel {
  int row, col;
};

/// Eight-connected pixels from `seed` on whose height differs from the seed's by at most `depth`; marks them.
std::vector<Pixel> plateau_of(const DepthImage& image, Pixel seed, float depth, std::vector<char>& taken) {
  const auto rows = static_cast<int>(image.z_mm.rows()), cols = static_cast<int>(image.z_mm.cols());
  const float top = image.z_mm(seed.row, seed.col);
  const auto index = [&](int r, int c) {
    return static_cast<std::size_t>(r) * static_cast<std::size_t>(cols) + static_cast<std::size_t>(c);
  };
  std::vector<Pixel> plateau{seed};
  taken[index(seed.row, seed.col)] = 1;
  for (std::size_t i = 0; i < plateau.size(); ++i) {
    const Pixel at = plateau[i];
    for (int r = std::max(0, at.row - 1); r <= std::min(rows - 1, at.row + 1); ++r)
      for (int c = std::max(0, at.col - 1); c <= std::min(cols - 1, at.col + 1); ++c) {
        if (taken[index(r, c)] || !(std::abs(image.z_mm(r, c) - top) <= depth)) continue;
        taken[index(r, c)] = 1;
        plateau.push_back({r, c});
      }
  }
  return plateau;
}

Eigen::Vector3d point_at(const DepthImage& image, double row, double col, double z) {
  return {image.origin_mm.x() + col * image.pixel_mm, image.origin_mm.y() + row * image.pixel_mm, z};
}

/// Highest place first, then further maxima that stand clear of those before; supply axes.
std::vector<Eigen::Vector3d> anchors_of(const DepthImage& image, double noise_mm, double diameter_mm) {
  const auto rows = static_cast<int>(image.z_mm.rows()), cols = static_cast<int>(image.z_mm.cols());
  const int radius = std::max(2, static_cast<int>(std::lround(0.06 * diameter_mm / image.pixel_mm)));
  std::vector<Pixel> peaks;
  for (int row = 0; row < rows; ++row)
    for (int col = 0; col < cols; ++col) {
      const float z = image.z_mm(row, col);
      if (std::isnan(z)) continue;
      bool highest = true;
      // The near neighbours first: they refuse most pixels.
      for (int r = std::max(0, row - 1); r <= std::min(rows - 1, row + 1) && highest; ++r)
        for (int c = std::max(0, col - 1); c <= std::min(cols - 1, col + 1) && highest; ++c)
          highest = !(image.z_mm(r, c) > z);
      for (int r = std::max(0, row - radius); r <= std::min(rows - 1, row + radius) && highest; ++r)
        for (int c = std::max(0, col - radius); c <= std::min(cols - 1, col + radius) && highest; ++c)
          highest = !(image.z_mm(r, c) > z);
      if (highest) peaks.push_back({row, col});
    }
  std::ranges::stable_sort(peaks,
                           [&](Pixel a, Pixel b) { return image.z_mm(a.row, a.col) > image.z_mm(b.row, b.col); });
  std::vector<char> taken(static_cast<std::size_t>(rows) * static_cast<std::size_t>(cols), 0);
  std::vector<Eigen::Vector3d> anchors;
  for (const Pixel peak : peaks) {
    if (anchors.size() == kAnchorsMax) break;
    if (taken[static_cast<std::size_t>(peak.row) * static_cast<std::size_t>(cols) + static_cast<std::size_t>(peak.col)])
      continue;
    const auto plateau = plateau_of(image, peak, plateau_mm(noise_mm, diameter_mm), taken);
    // Only the peak's own surroundings: the centroid of a wide plateau (the rim of a wheel) wanders far with the least
    // tilt. Detection lays a grid of anchors over wide plateaus.
    const double near_px = 0.05 * diameter_mm / image.pixel_mm;
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    int n = 0;
    for (const Pixel p : plateau) {
      if (std::hypot(p.row - peak.row, p.col - peak.col) > near_px) continue;
      sum += Eigen::Vector3d(p.row, p.col, double{image.z_mm(p.row, p.col)});
      ++n;
    }
    sum /= n;
    const Eigen::Vector3d anchor = point_at(image, sum[0], sum[1], sum[2]);
    const auto near = [&](const Eigen::Vector3d& other) {
      return (anchor - other).head<2>().norm() < 0.15 * diameter_mm;
    };
    if (anchors.empty() || std::ranges::none_of(anchors, near)) anchors.push_back(anchor);
  }
  return anchors;
}

struct Spot {
  Eigen::Vector3d p_mm;
  Eigen::Vector3d normal;
  bool calm;  ///< No edge beside it.
};

/// The surface's slope along one direction from both neighbours; NaN at a jump.
double slope_of(float before, float here, float after, float jump_mm, double pixel_mm) {
  const double back = double{here} - double{before}, on = double{after} - double{here};
  const bool back_ok = std::abs(back) <= double{jump_mm}, on_ok = std::abs(on) <= double{jump_mm};
  if (back_ok && on_ok) return 0.5 * (back + on) / pixel_mm;
  if (back_ok) return back / pixel_mm;
  if (on_ok) return on / pixel_mm;
  return std::numeric_limits<double>::quiet_NaN();
}

void collect(const DepthImage& image, float jump_mm, std::vector<Spot>& surface, std::vector<Eigen::Vector3d>& edges) {
  const auto rows = static_cast<int>(image.z_mm.rows()), cols = static_cast<int>(image.z_mm.cols());
  for (int row = 1; row + 1 < rows; ++row)
    for (int col = 1; col + 1 < cols; ++col) {
      const float z = image.z_mm(row, col);
      if (std::isnan(z)) continue;
      bool edge = false, calm = true;
      for (int r = row - 1; r <= row + 1; ++r)
        for (int c = col - 1; c <= col + 1; ++c) {
          const float d = image.z_mm(r, c) - z;
          calm = calm && std::abs(d) <= jump_mm;  // False for NaN.
          edge = edge || ((r == row || c == col) && !(d >= -jump_mm));
        }
      const Eigen::Vector3d p = point_at(image, row, col, double{z});
      if (edge) edges.push_back(p);
      const double sx = slope_of(image.z_mm(row, col - 1), z, image.z_mm(row, col + 1), jump_mm, image.pixel_mm);
      const double sy = slope_of(image.z_mm(row - 1, col), z, image.z_mm(row + 1, col), jump_mm, image.pixel_mm);
      if (std::isnan(sx) || std::isnan(sy)) continue;
      surface.push_back({p, Eigen::Vector3d(-sx, -sy, 1).normalized(), calm});
    }
}

/// Farthest-point order over at most a few hundred candidates: each first n of it are spread evenly.
template <class T, class At>
std::vector<T> spread(const std::vector<T>& all, int count, At at) {
  constexpr std::size_t kCandidatesMax = 500;
  std::vector<T> from;
  const std::size_t step = std::max<std::size_t>(1, (all.size() + kCandidatesMax - 1) / kCandidatesMax);
  // An odd start keeps the thinned candidates off a regular comb of columns.
  for (std::size_t i = step / 2; i < all.size(); i += step) from.push_back(all[i]);
  std::vector<double> distance(from.size(), std::numeric_limits<double>::infinity());
  std::vector<T> chosen;
  Eigen::Vector3d middle = Eigen::Vector3d::Zero();
  for (const T& t : from) middle += at(t) / static_cast<double>(from.size());
  std::size_t next = 0;
  for (std::size_t i = 1; i < from.size(); ++i)
    if ((at(from[i]) - middle).squaredNorm() < (at(from[next]) - middle).squaredNorm()) next = i;
  while (!from.empty() && chosen.size() < static_cast<std::size_t>(count) && distance[next] > 0) {
    chosen.push_back(from[next]);
    const Eigen::Vector3d last = at(from[next]);
    std::size_t farthest = 0;
    for (std::size_t i = 0; i < from.size(); ++i) {
      distance[i] = std::min(distance[i], (at(from[i]) - last).squaredNorm());
      if (distance[i] > distance[farthest]) farthest = i;
    }
    next = farthest;
  }
  return chosen;
}
}  // namespace

DepthImage window_around(const Mesh& mesh, const Eigen::Matrix3d& R_supply_object, double pixel_mm, int margin_px,
                         const Eigen::Vector2d& shift_px) {
  const Eigen::Matrix<float, 2, 3> R = R_supply_object.topRows<2>().cast<float>();
  Eigen::AlignedBox2f box;
  for (const Eigen::Vector3f& v : mesh.vertices_mm) box.extend(Eigen::Vector2f(R * v));
  DepthImage image;
  image.pixel_mm = pixel_mm;
  const Eigen::Vector2d low = box.min().cast<double>() / pixel_mm, high = box.max().cast<double>() / pixel_mm;
  const Eigen::Vector2d first = (low - shift_px).array().floor() - margin_px;
  const Eigen::Vector2d last = (high - shift_px).array().ceil() + margin_px;
  image.origin_mm = (first + shift_px) * pixel_mm;
  image.z_mm.setConstant(static_cast<Eigen::Index>(last.y() - first.y()) + 1,
                         static_cast<Eigen::Index>(last.x() - first.x()) + 1, std::numeric_limits<float>::quiet_NaN());
  return image;
}

TrainedView view_of(const DepthImage& rendered, const Mesh& mesh, const Eigen::Quaterniond& R_supply_object,
                    double noise_mm, double diameter_mm) {
  TrainedView view;
  view.R_supply_object = R_supply_object.cast<float>();
  const auto anchors = anchors_of(rendered, noise_mm, diameter_mm);
  if (anchors.empty()) return view;
  const Eigen::Quaterniond R_object_supply = R_supply_object.conjugate();
  for (const Eigen::Vector3d& a : anchors) view.anchors_object_mm.push_back((R_object_supply * a).cast<float>());
  const Eigen::Vector3d origin = anchors.front();

  std::vector<Spot> surface;
  std::vector<Eigen::Vector3d> edges;
  collect(rendered, render_jump_mm(noise_mm, rendered.pixel_mm), surface, edges);
  // Beside an edge a height says little after noise and a small turn; where the part is so thin that all its pixels are
  // such, they have to do.
  std::vector<Spot> calm;
  std::ranges::copy_if(surface, std::back_inserter(calm), [](const Spot& s) { return s.calm; });
  const auto& chosen_from = calm.size() >= kSurfaceSamples / 2 ? calm : surface;
  for (const Spot& s : spread(chosen_from, kSurfaceSamples, [](const Spot& spot) { return spot.p_mm; }))
    view.surface.push_back({(s.p_mm - origin).cast<float>(), s.normal.cast<float>()});
  for (const Eigen::Vector3d& p : spread(edges, kEdgeSamples, [](const Eigen::Vector3d& point) { return point; }))
    view.edges_mm.push_back((p - origin).cast<float>());

  const Eigen::Vector3f down = view.R_supply_object.toRotationMatrix().row(2);
  float lowest = std::numeric_limits<float>::infinity();
  for (const Eigen::Vector3f& v : mesh.vertices_mm) lowest = std::min(lowest, down.dot(v));
  view.lowest_mm = lowest - static_cast<float>(origin.z());
  Eigen::Index covered = 0;
  for (Eigen::Index i = 0; i < rendered.z_mm.size(); ++i) covered += std::isnan(rendered.z_mm.data()[i]) ? 0 : 1;
  view.area_mm2 = static_cast<float>(static_cast<double>(covered) * rendered.pixel_mm * rendered.pixel_mm);
  return view;
}
}  // namespace binpick::vision
