#include "vision/maxima.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <utility>

#include "vision/team.hpp"

namespace binpick::vision {
namespace {
constexpr double kWindowDiameters = 0.06;
constexpr double kPlateauDiameters = 0.02;
constexpr double kGridDiameters = 0.09;
/// Steeper than this between two pixels is another surface.
constexpr float kSlopeMax = 1.0F;
/// By so many sd of a single point may neighbouring pixels differ.
constexpr double kSpikeSds = 1.5;

struct Peak {
  int row, col;
  float z;
};

/// Of a pixel and its neighbours the third highest, if that is lower: what noise puts on top is no surface, and a
/// ridge goes on to both sides.
float without_spike(const Grid<float>& z_mm, int row, int col) {
  std::array<float, 3> highest;
  highest.fill(-std::numeric_limits<float>::infinity());
  for (int r = std::max(0, row - 1); r <= std::min(static_cast<int>(z_mm.rows()) - 1, row + 1); ++r)
    for (int c = std::max(0, col - 1); c <= std::min(static_cast<int>(z_mm.cols()) - 1, col + 1); ++c) {
      float z = z_mm(r, c);
      if (std::isnan(z)) continue;
      for (float& known : highest)
        if (z > known) std::swap(z, known);
    }
  return std::isinf(highest.back()) ? z_mm(row, col) : std::min(z_mm(row, col), highest.back());
}

bool is_local_maximum(const Scene& scene, const Grid<float>& z_mm, int row, int col, int radius) {
  const float z = z_mm(row, col);
  const auto pixel_mm = static_cast<float>(scene.pixel_mm);
  for (int r = std::max(0, row - radius); r <= std::min(scene.rows() - 1, row + radius); ++r)
    for (int c = std::max(0, col - radius); c <= std::min(scene.cols() - 1, col + radius); ++c) {
      const float rise = z_mm(r, c) - z;
      if (!(rise > 0)) continue;
      const auto distance = pixel_mm * std::hypot(static_cast<float>(r - row), static_cast<float>(c - col));
      if (rise <= scene.jump_mm + kSlopeMax * distance) return false;
    }
  return true;
}

/// Of one plateau: its centroid, or means of grid cells where it is wider than one.
void add_anchors(const Scene& scene, const std::vector<Peak>& plateau, double cell_mm,
                 std::vector<Eigen::Vector3f>& anchors) {
  const auto supply = [&](const Eigen::Vector3d& p) {
    return Eigen::Vector3f(static_cast<float>(scene.origin_mm.x() + p.x() * scene.pixel_mm),
                           static_cast<float>(scene.origin_mm.y() + p.y() * scene.pixel_mm), static_cast<float>(p.z()));
  };
  struct Mean {
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    int n = 0;
    void add(const Peak& p) {
      sum += Eigen::Vector3d(p.col, p.row, p.z);
      ++n;
    }
    Eigen::Vector3d value() const { return sum / n; }
  };
  Mean all;
  for (const Peak& p : plateau) all.add(p);
  const double cell_px = std::max(1.0, cell_mm / scene.pixel_mm);
  const Eigen::Vector3d centroid = all.value();
  std::map<std::pair<int, int>, Mean> cells;
  for (const Peak& p : plateau)
    cells[{static_cast<int>(std::lround((p.row - centroid.y()) / cell_px)),
           static_cast<int>(std::lround((p.col - centroid.x()) / cell_px))}]
        .add(p);
  const double few = 0.1 * cell_px * cell_px;
  if (cells.size() == 1) {
    anchors.push_back(supply(centroid));
    return;
  }
  std::vector<Eigen::Vector3d> means;
  for (const auto& [cell, mean] : cells)
    if (mean.n >= few) means.push_back(mean.value());
  std::stable_sort(means.begin(), means.end(), [&](const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
    return (a - centroid).head<2>().squaredNorm() < (b - centroid).head<2>().squaredNorm();
  });
  for (const Eigen::Vector3d& mean : means) anchors.push_back(supply(mean));
}
}  // namespace

std::vector<Eigen::Vector3f> find_maxima(const Scene& scene, const MaximaOptions& options) {
  const int radius =
      std::max(2, static_cast<int>(std::lround(kWindowDiameters * options.diameter_mm / scene.pixel_mm)));
  Grid<float> z_mm = scene.z_mm;
  // Where noise may be steeper than a surface; elsewhere narrow tops are real.
  const bool spiky = kSpikeSds * scene.noise_mm > static_cast<double>(kSlopeMax) * scene.pixel_mm;
  const std::size_t rows_to_mend = spiky ? static_cast<std::size_t>(scene.rows()) : 0;
  share(options.threads, rows_to_mend, Deadline{}, [&](std::size_t row, int) {
    const int r = static_cast<int>(row);
    for (int c = 0; c < scene.cols(); ++c)
      if (scene.z_mm(r, c) >= options.z_min_mm) z_mm(r, c) = without_spike(scene.z_mm, r, c);
  });
  std::vector<std::vector<Peak>> of_row(static_cast<std::size_t>(scene.rows()));
  share(options.threads, of_row.size(), Deadline{}, [&](std::size_t row, int) {
    const int r = static_cast<int>(row);
    for (int c = 0; c < scene.cols(); ++c) {
      const float z = z_mm(r, c);
      if (z >= options.z_min_mm && is_local_maximum(scene, z_mm, r, c, radius)) of_row[row].push_back({r, c, z});
    }
  });
  std::vector<Peak> peaks;
  for (const auto& row : of_row) peaks.insert(peaks.end(), row.begin(), row.end());
  std::stable_sort(peaks.begin(), peaks.end(), [](const Peak& a, const Peak& b) { return a.z > b.z; });

  const auto depth = static_cast<float>(std::max(2 * scene.noise_mm, kPlateauDiameters * options.diameter_mm));
  Grid<std::uint8_t> taken = Grid<std::uint8_t>::Zero(scene.rows(), scene.cols());
  std::vector<Eigen::Vector3f> anchors;
  std::vector<Peak> plateau;
  for (const Peak& peak : peaks) {
    if (taken(peak.row, peak.col)) continue;
    plateau.assign(1, peak);
    taken(peak.row, peak.col) = 1;
    for (std::size_t i = 0; i < plateau.size(); ++i) {
      const Peak at = plateau[i];
      for (int r = std::max(0, at.row - 1); r <= std::min(scene.rows() - 1, at.row + 1); ++r)
        for (int c = std::max(0, at.col - 1); c <= std::min(scene.cols() - 1, at.col + 1); ++c) {
          const float z = z_mm(r, c);
          if (taken(r, c) || !(std::abs(z - peak.z) <= depth)) continue;
          taken(r, c) = 1;
          plateau.push_back({r, c, z});
        }
    }
    if (plateau.size() >= 3) add_anchors(scene, plateau, kGridDiameters * options.diameter_mm, anchors);
  }
  return anchors;
}
}  // namespace binpick::vision
