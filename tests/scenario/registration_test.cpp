#include <Eigen/Dense>
#include <cmath>
#include <cstdio>
#include <gtest/gtest.h>
#include <numbers>

#include "tests/support/cell_file.hpp"
#include "tests/support/emulated_cell.hpp"
#include "tests/support/scenes.hpp"

/// A known block on the floor, scanned through the whole chain: do its planes lie where they are?
namespace binpick::support {
namespace {
using namespace std::chrono_literals;

// The block of scene_with_block().
constexpr double kHalfX_mm = 150, kHalfY_mm = 100, kTop_mm = 100;
const double kTurn_rad = 20 * std::numbers::pi / 180;

struct Measured {
  double floor_mm = 0, top_mm = 0;  ///< Largest distance of the fitted plane from the true one over its own extent.
  double centre_mm = 0;             ///< Lateral error of the middle of the top.
};

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

Measured measure(double speed_deg_s, double latency_ms) {
  CellFile file;
  file.sweep_speed_deg_s = speed_deg_s;
  file.scanner_latency_ms = latency_ms;
  EmulatedCell cell{test_folder().load(file), scene_with_block(), 9};
  EXPECT_TRUE(cell.run_until_ready());
  EXPECT_TRUE(cell.pick().has_value());
  const vision::DepthImage& image = cell.last_image();

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
  EXPECT_GT(top.size(), 1000U);
  EXPECT_GT(floor.size(), 5000U);
  return {plane_error_mm(floor, 0), plane_error_mm(top, kTop_mm), (centre / static_cast<double>(top.size())).norm()};
}
}  // namespace

TEST(Registration, PlanesOfAKnownBlockAreRightAtTwoSpeedsAndWrongWithAWrongLatency) {
  // The emulated device sends a line when its mirror's turn is over; its middle was half a turn before.
  const double right_ms = 0.5e3 / 360;
  std::printf("%-22s %-14s %-14s %s\n", "sweep", "floor, mm", "block top, mm", "block's middle, mm");
  for (const double speed_deg_s : {12.0, 34.0}) {
    const Measured good = measure(speed_deg_s, right_ms);
    std::printf("%2.0f deg/s                %-14.2f %-14.2f %.2f\n", speed_deg_s, good.floor_mm, good.top_mm,
                good.centre_mm);
    EXPECT_LT(good.floor_mm, 1.0);
    EXPECT_LT(good.top_mm, 1.0);
    EXPECT_LT(good.centre_mm, 1.5);
    const Measured late = measure(speed_deg_s, right_ms + 20);
    std::printf("%2.0f deg/s, 20 ms wrong   %-14.2f %-14.2f %.2f\n", speed_deg_s, late.floor_mm, late.top_mm,
                late.centre_mm);
    // 20 ms at this speed, seen from 1.76 m above the block's top.
    const double expected_mm = 0.020 * speed_deg_s * std::numbers::pi / 180 * 1700;
    EXPECT_NEAR(late.centre_mm, expected_mm, 0.25 * expected_mm);
  }
}
}  // namespace binpick::support
