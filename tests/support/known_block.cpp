#include "tests/support/known_block.hpp"

#include <Eigen/Dense>
#include <cmath>
#include <numbers>
#include <stdexcept>
#include <vector>

namespace binpick::support {
namespace {
// The block of scene_with_block().
constexpr double kHalfX_mm = 150, kHalfY_mm = 100, kTop_mm = 100;
const double kTurn_rad = 20 * std::numbers::pi / 180;

/// z = a x + b y + c, least squares; then the largest error at the corners of the region's bounding box.
double plane_error_mm(const std::vector<Eigen::Vector3d>& points, double true_z_mm) {
  Eigen::MatrixXd A(static_cast<Eigen::Index>(points.size()), 3);
  Eigen::VectorXd z(A.rows());
  Eigen::Vector2d low{1e9, 1e9}, high{-1e9, -1e9};
  for (Eigen::Index i = 0; i < A.rows(); ++i) {
    const auto& p = points[static_cast<std::size_t>(i)];
    A.row(i) << p.x(), p.y(), 1.0;
    z(i) = p.z();
    low = low.cwiseMin(p.head<2>());
    high = high.cwiseMax(p.head<2>());
  }
  const Eigen::Vector3d plane = A.colPivHouseholderQr().solve(z);
  double worst = 0;
  for (const double x : {low.x(), high.x()})
    for (const double y : {low.y(), high.y()})
      worst = std::max(worst, std::abs(plane.dot(Eigen::Vector3d{x, y, 1}) - true_z_mm));
  return worst;
}
}  // namespace

BlockErrors errors_of_block(const vision::DepthImage& image) {
  std::vector<Eigen::Vector3d> floor, top;
  Eigen::Vector2d centre = Eigen::Vector2d::Zero();
  for (Eigen::Index r = 0; r < image.z_mm.rows(); ++r)
    for (Eigen::Index c = 0; c < image.z_mm.cols(); ++c) {
      const auto z = static_cast<double>(image.z_mm(r, c));
      if (!std::isfinite(z)) continue;
      const Eigen::Vector2d p =
          image.origin_mm + image.pixel_mm * Eigen::Vector2d(static_cast<double>(c), static_cast<double>(r));
      if (std::abs(p.x()) > 460 || std::abs(p.y()) > 360) continue;  // the walls' foot
      const Eigen::Vector2d in_block = Eigen::Rotation2Dd(-kTurn_rad) * p;
      if (std::abs(z - kTop_mm) < 30) {
        top.emplace_back(p.x(), p.y(), z);
        centre += p;
      } else if (std::abs(z) < 20 &&
                 (std::abs(in_block.x()) > kHalfX_mm + 40 || std::abs(in_block.y()) > kHalfY_mm + 40)) {
        floor.emplace_back(p.x(), p.y(), z);
      }
    }
  if (top.size() < 1000 || floor.size() < 5000) throw std::runtime_error("block or floor is hardly seen");
  return {plane_error_mm(floor, 0), plane_error_mm(top, kTop_mm), (centre / static_cast<double>(top.size())).norm()};
}
}  // namespace binpick::support
