#include "vision/scene.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <gtest/gtest.h>
#include <limits>
#include <random>
#include <utility>

/// The prepared scene against plain loops over its pixels.
namespace binpick::vision {
namespace {
constexpr float kNothing = std::numeric_limits<float>::quiet_NaN();
struct Step {
  int row, col;
};
constexpr std::array<Step, 8> kNeighbours{{{0, 1}, {1, 1}, {1, 0}, {1, -1}, {0, -1}, {-1, -1}, {-1, 0}, {-1, 1}}};

/// Steps, slopes, noise, holes from one pixel to a whole strip, specks; sizes that are no multiple of anything.
DepthImage rough(int rows, int cols) {
  DepthImage image;
  image.pixel_mm = 2;
  image.origin_mm = {-10, 20};
  image.z_mm.resize(rows, cols);
  std::mt19937 random{9};
  std::normal_distribution<float> noise{0, 0.5F};
  for (int r = 0; r < rows; ++r)
    for (int c = 0; c < cols; ++c) {
      float z = 0.3F * static_cast<float>(c) + 15.0F * static_cast<float>((r / 20 + c / 17) % 3) + noise(random);
      if (random() % 30 == 0 || (c / 6 == 9 && r > 30) || r / 2 == 25) z = kNothing;
      if (random() % 200 == 0) z += 90;
      image.z_mm(r, c) = z;
    }
  if (rows > 3 && cols > 3) {
    image.z_mm(1, 1) = std::numeric_limits<float>::infinity();
    image.z_mm(2, 3) = -3e7F;
  }
  return image;
}

struct Plane {
  double z, slope_x, slope_y;
};
Plane fit(const Grid<float>& z, int row, int col, int radius, float jump_mm) {
  double n = 0, sx = 0, sy = 0, sz = 0, sxx = 0, sxy = 0, syy = 0, sxz = 0, syz = 0;
  for (int r = std::max(0, row - radius); r <= std::min(static_cast<int>(z.rows()) - 1, row + radius); ++r)
    for (int c = std::max(0, col - radius); c <= std::min(static_cast<int>(z.cols()) - 1, col + radius); ++c) {
      const float rise = z(r, c) - z(row, col);
      if (!(std::abs(rise) <= jump_mm)) continue;
      const double x = c - col, y = r - row, d = static_cast<double>(rise);
      n += 1, sx += x, sy += y, sz += d, sxx += x * x, sxy += x * y, syy += y * y, sxz += x * d, syz += y * d;
    }
  const auto centre = static_cast<double>(z(row, col));
  const double mx = sx / n, my = sy / n, mz = sz / n;
  const double cxx = sxx - n * mx * mx, cxy = sxy - n * mx * my, cyy = syy - n * my * my;
  const double cxz = sxz - n * mx * mz, cyz = syz - n * my * mz, determinant = cxx * cyy - cxy * cxy;
  if (n < 4 || determinant < 0.5) return {centre + mz, 0, 0};
  const double a = (cxz * cyy - cyz * cxy) / determinant, b = (cyz * cxx - cxz * cxy) / determinant;
  return {centre + mz - a * mx - b * my, a, b};
}

float bend(const Scene& scene, int row, int col) {
  const auto at = [&](int r, int c) { return scene.inside(r, c) ? scene.z_mm(r, c) : kNothing; };
  const float centre = at(row, col);
  float sum = 0;
  int pairs = 0;
  for (const Step& s : {Step{0, 2}, {2, 0}, {2, 2}, {2, -2}}) {
    const float a = at(row + s.row, col + s.col), b = at(row - s.row, col - s.col);
    if (!(std::abs(a - centre) <= scene.jump_mm && std::abs(b - centre) <= scene.jump_mm)) continue;
    sum += a + b - 2 * centre;
    ++pairs;
  }
  return pairs >= 2 ? sum / static_cast<float>(pairs) : 0;
}

bool ends(const Scene& scene, int row, int col, const Step& step) {
  for (int k = 1; k <= 3; ++k) {
    const int r = row + k * step.row, c = col + k * step.col;
    if (!scene.inside(r, c)) return false;
    if (!std::isnan(scene.z_mm(r, c)))
      return scene.z_mm(row, col) - scene.z_mm(r, c) > scene.jump_mm * (k == 1 ? 1.0F : 1.5F);
  }
  return true;
}

/// Direction in which the surface ends; zero: no edge.
Eigen::Vector2f edge_out(const Scene& scene, int row, int col) {
  Eigen::Vector2f out = Eigen::Vector2f::Zero();
  bool straight = false;
  for (std::size_t k = 0; k < kNeighbours.size(); ++k)
    if (ends(scene, row, col, kNeighbours[k])) {
      out +=
          Eigen::Vector2f(static_cast<float>(kNeighbours[k].col), static_cast<float>(kNeighbours[k].row)).normalized();
      straight |= k % 2 == 0;
    }
  return straight && out.norm() > 1e-3F ? Eigen::Vector2f(out.normalized()) : Eigen::Vector2f(0, 0);
}

class PreparedScene : public testing::TestWithParam<const kernels::Table*> {};
INSTANTIATE_TEST_SUITE_P(Loops, PreparedScene, testing::Values(&kernels::portable(), &kernels::table()));

TEST_P(PreparedScene, IsWhatPlainLoopsMakeOfThePicture) {
  const DepthImage image = rough(93, 131);
  const Scene scene = prepare_scene(image, 0.5, 1, *GetParam());
  ASSERT_EQ(scene.rows(), 93);
  ASSERT_EQ(scene.cols(), 131);
  const float jump = scene.jump_mm;
  int specks = 0, curved = 0, edges = 0;
  for (int r = 0; r < scene.rows(); ++r)
    for (int c = 0; c < scene.cols(); ++c) {
      SCOPED_TRACE(testing::Message() << r << ", " << c);
      const float z = image.z_mm(r, c);
      int same = 0;
      for (const Step& s : kNeighbours)
        same += scene.inside(r + s.row, c + s.col) && std::abs(image.z_mm(r + s.row, c + s.col) - z) <= jump;
      const bool measured = std::isfinite(z) && std::abs(z) < 1e6F && same >= 2;
      specks += std::isfinite(z) && !measured;
      ASSERT_EQ(std::isnan(scene.measured_mm(r, c)), !measured);
      ASSERT_EQ(std::isnan(scene.z_mm(r, c)), !measured);
      if (measured) {
        ASSERT_EQ(scene.measured_mm(r, c), z);
        ASSERT_NEAR(static_cast<double>(scene.z_mm(r, c)), fit(scene.measured_mm, r, c, 1, jump).z, 1e-3);
        const Plane wide = fit(scene.z_mm, r, c, 2, 1.25F * jump);
        ASSERT_NEAR(static_cast<double>(scene.slope_x(r, c)), wide.slope_x / 2, 1e-4);
        ASSERT_NEAR(static_cast<double>(scene.slope_y(r, c)), wide.slope_y / 2, 1e-4);
        ASSERT_NEAR(scene.bend_mm(r, c), bend(scene, r, c), 1e-4F);
        curved += scene.bend_mm(r, c) != 0;
        const Eigen::Vector2f out = edge_out(scene, r, c);
        ASSERT_EQ(scene.edge(r, c) != 0, out.norm() > 0.5F);
        ASSERT_NEAR(scene.edge_out_x(r, c), out.x(), 1e-4F);
        ASSERT_NEAR(scene.edge_out_y(r, c), out.y(), 1e-4F);
        edges += scene.edge(r, c);
      } else {
        ASSERT_EQ(scene.slope_x(r, c), 0);
        ASSERT_EQ(scene.slope_y(r, c), 0);
        ASSERT_EQ(scene.bend_mm(r, c), 0);
        ASSERT_EQ(scene.edge(r, c), 0);
      }
    }
  EXPECT_GT(specks, 20);
  EXPECT_GT(curved, 3000);
  EXPECT_GT(edges, 500);
}

TEST_P(PreparedScene, KnowsTheNearestEdgeOfEachPixel) {
  DepthImage image;
  image.z_mm.setZero(70, 83);
  for (const auto& [r, c] : std::array<std::array<int, 2>, 4>{{{3, 4}, {33, 50}, {60, 20}, {34, 52}}})
    image.z_mm.block(r, c, 3, 3).setConstant(50);
  const Scene scene = prepare_scene(image, 0.5, 1, *GetParam());
  int in_reach = 0;
  for (int r = 0; r < scene.rows(); ++r)
    for (int c = 0; c < scene.cols(); ++c) {
      int nearest2 = kEdgeReachPx * kEdgeReachPx;
      for (int er = 0; er < scene.rows(); ++er)
        for (int ec = 0; ec < scene.cols(); ++ec)
          if (scene.edge(er, ec)) nearest2 = std::min(nearest2, (er - r) * (er - r) + (ec - c) * (ec - c));
      ASSERT_FLOAT_EQ(scene.edge_distance_px(r, c), std::sqrt(static_cast<float>(nearest2))) << r << " " << c;
      const std::int32_t at = scene.nearest_edge(r, c);
      if (nearest2 >= kEdgeReachPx * kEdgeReachPx) {
        ASSERT_EQ(at, -1);
        continue;
      }
      ++in_reach;
      ASSERT_GE(at, 0);
      const int er = at / scene.cols(), ec = at % scene.cols();
      ASSERT_TRUE(scene.edge(er, ec));
      ASSERT_EQ((er - r) * (er - r) + (ec - c) * (ec - c), nearest2);
    }
  EXPECT_GT(in_reach, 1500);
  EXPECT_LT(in_reach, 70 * 83);
}

TEST_P(PreparedScene, DoesNotDependOnThreadsOrMemoryAndTakesAnySize) {
  const auto same = [](const Scene& a, const Scene& b) {
    const auto equal = [](const auto& x, const auto& y) { return ((x == y) || (x != x && y != y)).all(); };
    return equal(a.measured_mm, b.measured_mm) && equal(a.z_mm, b.z_mm) && equal(a.slope_x, b.slope_x) &&
           equal(a.slope_y, b.slope_y) && equal(a.bend_mm, b.bend_mm) && equal(a.edge_out_x, b.edge_out_x) &&
           equal(a.edge_out_y, b.edge_out_y) && (a.edge == b.edge).all() && (a.nearest_edge == b.nearest_edge).all() &&
           equal(a.edge_distance_px, b.edge_distance_px);
  };
  for (const auto& [rows, cols] : std::array<std::array<int, 2>, 5>{{{200, 61}, {1, 1}, {1, 9}, {7, 1}, {0, 0}}}) {
    const Scene one = prepare_scene(rough(rows, cols), 0.5, 1, *GetParam());
    EXPECT_EQ(one.rows(), rows);
    EXPECT_TRUE(same(one, prepare_scene(rough(rows, cols), 0.5, 3, *GetParam()))) << rows;
    Scene other = prepare_scene(rough(60, 70), 0.5, 1, *GetParam());
    EXPECT_TRUE(same(one, prepare_scene(rough(rows, cols), 0.5, 1, *GetParam(), std::move(other)))) << rows;
  }
}
}  // namespace
}  // namespace binpick::vision
