#include "vision/rasteriser.hpp"

#include <cmath>
#include <gtest/gtest.h>
#include <numbers>
#include <random>

#include "tests/unit/detect/shapes.hpp"

namespace binpick::vision {
namespace {
DepthImage empty_image(int rows, int cols, double pixel_mm) {
  DepthImage image;
  image.pixel_mm = pixel_mm;
  image.origin_mm = {-0.5 * pixel_mm * (cols - 1) + 0.17, -0.5 * pixel_mm * (rows - 1) - 0.31};
  image.z_mm.setConstant(rows, cols, std::numeric_limits<float>::quiet_NaN());
  return image;
}

Eigen::Isometry3d random_pose(std::mt19937& random) {
  std::normal_distribution<double> normal;
  Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  T.linear() = Eigen::Quaterniond(normal(random), normal(random), normal(random), normal(random))
                   .normalized()
                   .toRotationMatrix();
  T.translation() = Eigen::Vector3d(3 * normal(random), 3 * normal(random), 50 + 10 * normal(random));
  return T;
}

/// A rod of many facets: triangles that are long and thin.
Mesh rod() {
  constexpr int kFacets = 40;
  Mesh mesh;
  for (int k = 0; k < kFacets; ++k) {
    const auto angle = static_cast<float>(2 * std::numbers::pi * k / kFacets);
    for (const float end : {-75.0F, 75.0F})
      mesh.vertices_mm.emplace_back(end, 22 * std::cos(angle), 22 * std::sin(angle));
  }
  for (std::uint32_t k = 0; k < kFacets; ++k) {
    const std::uint32_t a = 2 * k, b = 2 * ((k + 1) % kFacets);
    mesh.triangles.push_back({a, b, b + 1});
    mesh.triangles.push_back({a, b + 1, a + 1});
    if (k == 0 || k + 1 == kFacets) continue;
    mesh.triangles.push_back({0, b, a});
    mesh.triangles.push_back({1, a + 1, b + 1});
  }
  return mesh;
}

void expect_same_pictures(const Mesh& mesh) {
  const auto reference = make_osmesa_renderer(mesh);
  const auto own = make_working_renderer(mesh);
  std::mt19937 random{11};
  for (int k = 0; k < 40; ++k) {
    const Eigen::Isometry3d T = random_pose(random);
    DepthImage expected = empty_image(90, 100, 2.0), drawn = expected;
    reference->render(T, expected);
    own->render(T, drawn);
    int covered = 0, different = 0, apart = 0;
    for (Eigen::Index r = 0; r < expected.z_mm.rows(); ++r)
      for (Eigen::Index c = 0; c < expected.z_mm.cols(); ++c) {
        const float a = expected.z_mm(r, c), b = drawn.z_mm(r, c);
        covered += !std::isnan(a);
        if (std::isnan(a) != std::isnan(b))
          ++different;
        else if (!std::isnan(a) && std::abs(a - b) > 0.05F)
          ++apart;
      }
    ASSERT_GT(covered, 350);
    EXPECT_LE(different, covered / 100) << "pose " << k;
    EXPECT_LE(apart, covered / 200) << "pose " << k;
  }
}

// The reference is Mesa's renderer. Rounding may move the silhouette by a hair, never by a pixel.
TEST(Rasteriser, DrawsWhatTheReferenceRendererDraws) { expect_same_pictures(shapes::bracket()); }
TEST(Rasteriser, DrawsLongThinTrianglesAsTheReferenceRendererDoes) { expect_same_pictures(rod()); }

TEST(Rasteriser, TopAndNormalOfABox) {
  Mesh mesh;
  shapes::add_box(mesh, {-10, -5, 0}, {10, 5, 8});
  const Rasteriser rasteriser{mesh};
  Template drawn;
  rasteriser.draw(Eigen::Matrix3f::Identity(), {100.5F, 50.5F, 30}, 1.0, {0, 0}, drawn);
  EXPECT_EQ(drawn.rows, 10);
  EXPECT_EQ(drawn.cols, 20);
  EXPECT_EQ(drawn.col0, 91);
  EXPECT_EQ(drawn.row0, 46);
  const std::size_t middle = drawn.at(5, 10);
  EXPECT_FLOAT_EQ(drawn.top_mm[middle], 38);
  EXPECT_NEAR(rasteriser.normal(drawn.triangle[middle]).z(), 1, 1e-6);
}

TEST(Rasteriser, PosesOutOfThisWorldDrawNothing) {
  const Rasteriser rasteriser{shapes::bracket()};
  Template drawn;
  rasteriser.draw(Eigen::Matrix3f::Identity(), {1e9F, 0, 0}, 1.0, {0, 0}, drawn);
  EXPECT_EQ(drawn.rows * drawn.cols, 0);
  rasteriser.draw(Eigen::Matrix3f::Constant(std::numeric_limits<float>::quiet_NaN()), {0, 0, 0}, 1.0, {0, 0}, drawn);
  EXPECT_EQ(drawn.rows * drawn.cols, 0);
  rasteriser.draw(Eigen::Matrix3f::Identity(), {0, 0, 0}, 1e-3, {0, 0}, drawn);
  EXPECT_EQ(drawn.rows * drawn.cols, 0);
}
}  // namespace
}  // namespace binpick::vision
