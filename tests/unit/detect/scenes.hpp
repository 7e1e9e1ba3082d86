#pragma once

#include <random>
#include <vector>

#include "tests/unit/detect/shapes.hpp"
#include "vision/detector.hpp"
#include "vision/rasteriser.hpp"
#include "vision/scene.hpp"
#include "vision/symmetry.hpp"

/// Synthetic supplies for the tests of detection: objects of one mesh, seen from straight above, with noise.
namespace binpick::vision::scenes {
inline const SupplyBox kSupply{{600, 500, 300}};
inline constexpr double kNoiseMm = 1.5;

/// Trained once per test program, coarsely: 5000 rotations.
inline const KnowledgeBase& bracket_base() {
  static const KnowledgeBase base = [] {
    PartOptions options;
    options.name = "bracket";
    options.scanner = ScannerClass::Lms400;
    options.pixel_mm = 3.0;
    options.rotations = 5000;
    return *train(shapes::bracket(), options, {}, nullptr);
  }();
  return base;
}

inline Eigen::Isometry3d pose(double x, double y, double z, double turn_rad, double tilt_rad = 0) {
  Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  T.translation() = Eigen::Vector3d(x, y, z);
  T.linear() =
      (Eigen::AngleAxisd(turn_rad, Eigen::Vector3d::UnitZ()) * Eigen::AngleAxisd(tilt_rad, Eigen::Vector3d::UnitX()))
          .toRotationMatrix();
  return T;
}

/// The depth image of floor and objects, with the noise of single heights and a hole here and there.
inline DepthImage image_of(const Mesh& mesh, const std::vector<Eigen::Isometry3d>& objects, std::uint32_t seed) {
  const double pixel_mm = bracket_base().pixel_mm();
  DepthImageBuilder builder{pixel_mm, -0.5 * kSupply.size_mm.head<2>(), 0.5 * kSupply.size_mm.head<2>()};
  DepthImage image = builder.image();
  Grid<float> heights = Grid<float>::Zero(image.z_mm.rows(), image.z_mm.cols());
  const Rasteriser rasteriser{mesh};
  Template drawn;
  for (const Eigen::Isometry3d& T : objects) {
    rasteriser.draw(T.linear().cast<float>(), T.translation().cast<float>(), pixel_mm, image.origin_mm, drawn);
    for (int r = 0; r < drawn.rows; ++r)
      for (int c = 0; c < drawn.cols; ++c) {
        const int row = r + drawn.row0, col = c + drawn.col0;
        if (row < 0 || col < 0 || row >= heights.rows() || col >= heights.cols()) continue;
        if (drawn.triangle[drawn.at(r, c)] >= 0)
          heights(row, col) = std::max(heights(row, col), drawn.top_mm[drawn.at(r, c)]);
      }
  }
  std::mt19937 random{seed};
  std::normal_distribution<float> noise{0, static_cast<float>(kNoiseMm)};
  std::vector<Eigen::Vector3f> points;
  for (Eigen::Index r = 0; r < heights.rows(); ++r)
    for (Eigen::Index c = 0; c < heights.cols(); ++c) {
      if (random() % 6 == 0) continue;
      points.emplace_back(static_cast<float>(image.origin_mm.x() + pixel_mm * static_cast<double>(c)),
                          static_cast<float>(image.origin_mm.y() + pixel_mm * static_cast<double>(r)),
                          heights(r, c) + noise(random));
    }
  builder.add(points);
  return builder.image();
}

inline DetectorOptions options() {
  DetectorOptions options;
  options.noise_mm = kNoiseMm;
  return options;
}
}  // namespace binpick::vision::scenes
