#include "vision/renderer.hpp"

#include <gtest/gtest.h>
#include <random>
#include <thread>

#include "tests/unit/vision/shapes.hpp"

namespace binpick::vision {
namespace {
DepthImage image_of(int rows, int cols, double pixel_mm, const Eigen::Vector2d& origin_mm) {
  DepthImage image;
  image.z_mm.resize(rows, cols);
  image.pixel_mm = pixel_mm;
  image.origin_mm = origin_mm;
  return image;
}

/// The highest crossing of a vertical line with a mesh, NaN when there is none: the definition, in double.
double height_at(const Mesh& mesh, const Eigen::Isometry3d& T, const Eigen::Vector2d& at, double* edge_mm,
                 double* slope) {
  double best = std::numeric_limits<double>::quiet_NaN();
  *edge_mm = std::numeric_limits<double>::infinity();
  for (const auto& t : mesh.triangles) {
    std::array<Eigen::Vector3d, 3> v;
    for (std::size_t k = 0; k < 3; ++k) v[k] = T * mesh.vertices_mm[t[k]].cast<double>();
    std::array<double, 3> w{};
    for (std::size_t k = 0; k < 3; ++k) {
      const Eigen::Vector2d a = v[(k + 1) % 3].head<2>(), b = v[(k + 2) % 3].head<2>();
      const Eigen::Vector2d e = b - a, d = at - a;
      w[k] = e.x() * d.y() - e.y() * d.x();
      const double along = std::clamp(d.dot(e) / e.squaredNorm(), 0.0, 1.0);
      *edge_mm = std::min(*edge_mm, (d - along * e).norm());
    }
    const double sum = w[0] + w[1] + w[2];
    if (std::abs(sum) < 1e-9) continue;
    if (w[0] / sum < 0 || w[1] / sum < 0 || w[2] / sum < 0) continue;
    const double z = (w[0] * v[0].z() + w[1] * v[1].z() + w[2] * v[2].z()) / sum;
    if (z <= best) continue;
    best = z;
    const Eigen::Vector3d n = (v[1] - v[0]).cross(v[2] - v[0]);
    *slope = n.head<2>().norm() / std::abs(n.z());
  }
  return best;
}

void expect_as_defined(const Mesh& mesh, const Eigen::Isometry3d& T, DepthImage image) {
  make_osmesa_renderer(mesh)->render(T, image);
  int covered = 0;
  for (int r = 0; r < image.z_mm.rows(); ++r)
    for (int c = 0; c < image.z_mm.cols(); ++c) {
      const Eigen::Vector2d at = image.origin_mm + image.pixel_mm * Eigen::Vector2d(c, r);
      double edge_mm = 0, slope = 0;
      const double z = height_at(mesh, T, at, &edge_mm, &slope);
      if (edge_mm < 0.01 * image.pixel_mm) continue;
      ASSERT_EQ(std::isnan(z), std::isnan(image.z_mm(r, c))) << r << " " << c;
      if (std::isnan(z)) continue;
      ASSERT_NEAR(z, double{image.z_mm(r, c)}, 1e-3 * std::max(1.0, slope / 3)) << slope;
      ++covered;
    }
  EXPECT_GT(covered, 100);
}

TEST(Renderer, FlatBoxTopStandsAtItsHeightInWholePixels) {
  DepthImage image = image_of(40, 60, 1.0, {-29.5, -19.5});
  Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  T.translation() = Eigen::Vector3d(10, 5, 123.25);
  make_osmesa_renderer(shapes::box(20, 10, 8))->render(T, image);
  for (int r = 0; r < 40; ++r)
    for (int c = 0; c < 60; ++c) {
      const double x = -29.5 + c, y = -19.5 + r;
      if (x > 0 && x < 20 && y > 0 && y < 10)
        EXPECT_NEAR(double{image.z_mm(r, c)}, 127.25, 1e-3);
      else
        EXPECT_TRUE(std::isnan(image.z_mm(r, c))) << x << " " << y;
    }
}

TEST(Renderer, SphereHasTheHeightsOfItsFormula) {
  const Mesh ball = shapes::sphere(50, 400);
  DepthImage image = image_of(80, 80, 1.0, {-39.5, -39.5});
  make_osmesa_renderer(ball)->render(Eigen::Isometry3d::Identity(), image);
  for (int r = 0; r < 80; ++r)
    for (int c = 0; c < 80; ++c) {
      const double x = -39.5 + c, y = -39.5 + r, left = 2500 - x * x - y * y;
      if (left < 900) continue;  // 400 corners: a sagitta of up to 20 um
      EXPECT_NEAR(double{image.z_mm(r, c)}, std::sqrt(left), 0.02);
    }
}

TEST(Renderer, AgreesWithTheDefinitionInAnyRotation) {
  std::mt19937_64 random(3);
  std::normal_distribution<double> normal;
  Mesh part = shapes::l_shape();
  for (Eigen::Vector3f& v : part.vertices_mm) v *= 7;  // 480 mm across
  for (int i = 0; i < 12; ++i) {
    Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
    T.linear() = Eigen::Quaterniond(normal(random), normal(random), normal(random), normal(random))
                     .normalized()
                     .toRotationMatrix();
    T.translation() = Eigen::Vector3d(normal(random), normal(random), normal(random)) * 50;
    expect_as_defined(part, T, image_of(120 + i, 150, 4.1, {-310, -250}));
  }
}

TEST(Renderer, AMeshFarFromItsOriginKeepsItsDigits) {
  const Eigen::Isometry3d away(Eigen::Translation3d(4096, -2048, 1024));
  Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  T.linear() = Eigen::AngleAxisd(0.3, Eigen::Vector3d(1, 2, 3).normalized()).toRotationMatrix();
  expect_as_defined(shapes::moved(shapes::box(60, 40, 20), away), T * away.inverse(),
                    image_of(64, 64, 1.3, {-41, -41}));
}

TEST(Renderer, FlippedNormalsLookTheSame) {
  Mesh flipped = shapes::l_shape();
  for (auto& t : flipped.triangles) std::swap(t[0], t[1]);
  Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  T.linear() = Eigen::AngleAxisd(0.7, Eigen::Vector3d::UnitY()).toRotationMatrix();
  DepthImage a = image_of(64, 64, 1.3, {-41, -41}), b = a;
  make_osmesa_renderer(shapes::l_shape())->render(T, a);
  make_osmesa_renderer(flipped)->render(T, b);
  for (Eigen::Index i = 0; i < a.z_mm.size(); ++i) {
    const float one = a.z_mm.data()[i], other = b.z_mm.data()[i];
    ASSERT_EQ(std::isnan(one), std::isnan(other));
    if (std::isnan(one)) continue;
    ASSERT_NEAR(double{one}, double{other}, 1e-3);
  }
}

TEST(Renderer, TwoRenderersOnOneThreadAndOneOnAnotherDoNotDisturbEachOther) {
  auto small = make_osmesa_renderer(shapes::box(10, 10, 10));
  auto large = make_osmesa_renderer(shapes::box(30, 30, 30));
  DepthImage a = image_of(8, 8, 1, {-3.5, -3.5}), b = image_of(20, 20, 1, {-9.5, -9.5});
  const Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  for (int i = 0; i < 3; ++i) {
    small->render(T, a);
    large->render(T, b);
    EXPECT_NEAR(double{a.z_mm(4, 4)}, 5, 1e-3);
    EXPECT_NEAR(double{b.z_mm(10, 10)}, 15, 1e-3);
  }
  float seen = 0;
  std::jthread([&] {
    auto own = make_osmesa_renderer(shapes::box(20, 20, 20));
    DepthImage c = image_of(8, 8, 1, {-3.5, -3.5});
    own->render(T, c);
    seen = c.z_mm(4, 4);
  }).join();
  EXPECT_NEAR(double{seen}, 10, 1e-3);
  small->render(T, b);
  EXPECT_TRUE(std::isnan(b.z_mm(0, 0)));
}
}  // namespace
}  // namespace binpick::vision
