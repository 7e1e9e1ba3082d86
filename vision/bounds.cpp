#include "vision/bounds.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace binpick::vision {
namespace {
constexpr double kFloorGateDiameters = 0.03, kWallGateDiameters = 0.04;
/// Floors and walls are bent and dirty.
constexpr double kContentGateDiameters = 0.1, kRaisedFloorDiameters = 0.5;

bool has_walls(const SupplyBox& supply) { return supply.size_mm.x() > 0 && supply.size_mm.y() > 0; }

constexpr float kUnknown = -std::numeric_limits<float>::infinity();

/// Below which there is nothing and on which much lies; a part of the pixels tells it.
float level_of(const Scene& scene) {
  constexpr int kEvery = 3;
  std::vector<float> heights;
  for (int r = 0; r < scene.rows(); r += kEvery)
    for (int c = 0; c < scene.cols(); c += kEvery)
      if (const float z = scene.z_mm(r, c); !std::isnan(z)) heights.push_back(z);
  if (heights.empty()) return kUnknown;
  const auto low = heights.begin() + static_cast<std::ptrdiff_t>(heights.size() / 50);
  std::nth_element(heights.begin(), low, heights.end());
  const float band = 3 * static_cast<float>(scene.noise_mm);
  double sum = 0;
  std::size_t n = 0;
  for (const float z : heights)
    if (std::abs(z - *low) <= band) sum += z, ++n;
  return n * 5 >= heights.size() ? static_cast<float>(sum / static_cast<double>(n)) : kUnknown;
}
}  // namespace

Bounds::Bounds(const Scene& scene, const SupplyBox& supply, double diameter_mm)
    : floor_mm_{0},
      content_from_mm_{std::numeric_limits<float>::infinity()},
      depth_mm_{static_cast<float>(std::max(3 * scene.noise_mm, kFloorGateDiameters * diameter_mm))},
      walls_mm_{Eigen::Array2f::Constant(std::numeric_limits<float>::infinity())},
      inner_mm_{Eigen::Array2d::Constant(std::numeric_limits<double>::infinity())} {
  const float level_mm = level_of(scene);
  if (!has_walls(supply)) {
    floor_mm_ = level_mm;
    return;
  }
  // A false bottom or a sheet of board is no content.
  const bool raised = level_mm > 0 && level_mm < static_cast<float>(kRaisedFloorDiameters * diameter_mm);
  content_from_mm_ =
      (raised ? level_mm : 0) + static_cast<float>(std::max(3 * scene.noise_mm, kContentGateDiameters * diameter_mm));
  const Eigen::Array2d half_mm = 0.5 * supply.size_mm.head<2>().array();
  walls_mm_ = (half_mm + kWallGateDiameters * diameter_mm + 2 * scene.pixel_mm).cast<float>();
  inner_mm_ = half_mm - std::max(2 * scene.pixel_mm, kContentGateDiameters * diameter_mm);
}

Grid<std::uint8_t> Bounds::content(const Scene& scene) const {
  Grid<std::uint8_t> content = Grid<std::uint8_t>::Zero(scene.rows(), scene.cols());
  const auto inside = [&](int index, int axis) {
    return std::abs(scene.origin_mm[axis] + index * scene.pixel_mm) < inner_mm_[axis];
  };
  for (int r = 0; r < scene.rows(); ++r)
    for (int c = 0; c < scene.cols(); ++c)  // not-a-number is not higher
      content(r, c) = inside(c, 0) && inside(r, 1) && scene.z_mm(r, c) > content_from_mm_;
  return content;
}

std::string Bounds::against(const Pose& pose, const std::vector<Eigen::Vector3f>& vertices_mm) const {
  float lowest = std::numeric_limits<float>::max();
  Eigen::Array2f reach = Eigen::Array2f::Zero();
  for (const Eigen::Vector3f& v : vertices_mm) {
    const Eigen::Vector3f p = pose.R * v + pose.t;
    lowest = std::min(lowest, p.z());
    reach = reach.max(p.head<2>().array().abs());
  }
  if (lowest < floor_mm_ - depth_mm_) return "reaches through the floor";
  if ((reach > walls_mm_).any()) return "reaches through a wall";
  return {};
}
}  // namespace binpick::vision
