#include "vision/decimation.hpp"

#include <gtest/gtest.h>

#include "tests/unit/vision/shapes.hpp"
#include "vision/surface.hpp"

namespace binpick::vision {
namespace {
/// The farthest that a point of `a` lies from `b`.
double farthest_mm(const Mesh& a, const Mesh& b) {
  const SurfaceTree tree(b);
  double most = 0;
  for (const Eigen::Vector3d& p : sample_surface(a, 20'000)) most = std::max(most, tree.distance_mm(p, 10));
  for (const Eigen::Vector3f& v : a.vertices_mm) most = std::max(most, tree.distance_mm(v.cast<double>(), 10));
  return most;
}

/// Every triangle cut into four, `times` over.
Mesh finer(Mesh mesh, int times) {
  for (; times > 0; --times) {
    Mesh next;
    next.vertices_mm = mesh.vertices_mm;
    const auto middle = [&](std::uint32_t a, std::uint32_t b) {
      next.vertices_mm.emplace_back((mesh.vertices_mm[a] + mesh.vertices_mm[b]) / 2);
      return static_cast<std::uint32_t>(next.vertices_mm.size() - 1);
    };
    for (const auto& [a, b, c] : mesh.triangles) {
      const std::uint32_t ab = middle(a, b), bc = middle(b, c), ca = middle(c, a);
      next.triangles.insert(next.triangles.end(), {{a, ab, ca}, {ab, b, bc}, {ca, bc, c}, {ab, bc, ca}});
    }
    mesh = cleaned(next);
  }
  return mesh;
}

TEST(Decimated, FlatFacesNeedTwoTrianglesEach) {
  const Mesh box = shapes::box(60, 40, 20);
  const Mesh back = decimated(finer(box, 4), 0.01);
  EXPECT_EQ(back.triangles.size(), 12U);
  EXPECT_LT(farthest_mm(box, back), 1e-4);
  EXPECT_LT(farthest_mm(back, box), 1e-4);
}

TEST(Decimated, RoundSurfacesKeepTheErrorBothWays) {
  for (const double error_mm : {0.05, 0.1, 0.4}) {
    for (const Mesh& mesh : {shapes::sphere(30, 200), finer(shapes::cylinder(20, 90, 128), 2),
                             finer(shapes::turned({{0, 30.0F}, {20, 12.0F}, {25, 12.0F}, {60, 5.0F}}, 96), 2)}) {
      const Mesh less = decimated(mesh, error_mm);
      EXPECT_LT(less.triangles.size(), mesh.triangles.size() / 4) << error_mm;
      EXPECT_LE(farthest_mm(mesh, less), 1.001 * error_mm);
      EXPECT_LE(farthest_mm(less, mesh), 1.001 * error_mm);
    }
  }
}

TEST(Decimated, WhatHasNothingToGiveComesBack) {
  const Mesh l = shapes::l_shape();
  EXPECT_EQ(mesh_hash(decimated(l, 0.5)), mesh_hash(l));
  EXPECT_TRUE(decimated({}, 0.5).triangles.empty());
}

TEST(Decimated, HolesAndInnerFacesKeepTheirBorders) {
  Mesh open = finer(shapes::box(60, 40, 20), 4);
  std::erase_if(open.triangles, [&](const auto& t) {
    // A hole of 20 x 10 mm in the top.
    const Eigen::Vector3f middle = (open.vertices_mm[t[0]] + open.vertices_mm[t[1]] + open.vertices_mm[t[2]]) / 3;
    return middle.z() > 9.9F && std::abs(middle.x()) < 10 && std::abs(middle.y()) < 5;
  });
  open = cleaned(open);
  const Mesh holed = decimated(open, 0.05);
  EXPECT_LT(holed.triangles.size(), 80U);
  EXPECT_LE(farthest_mm(holed, open), 0.051);
  EXPECT_LE(farthest_mm(open, holed), 0.051);
  // A wall inside that meets the outer faces, edge on edge.
  Mesh walled = shapes::box(60, 40, 20);
  shapes::add(walled, shapes::box(30, 40, 20), {-15, 0, 0});
  const Mesh both = cleaned(walled);
  const Mesh less = decimated(finer(both, 3), 0.05);
  EXPECT_LE(farthest_mm(both, less), 0.051);
  EXPECT_LT(less.triangles.size(), 200U);
}
}  // namespace
}  // namespace binpick::vision
