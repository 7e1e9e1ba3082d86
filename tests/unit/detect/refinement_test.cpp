#include "vision/refinement.hpp"

#include <array>
#include <cmath>
#include <gtest/gtest.h>
#include <limits>

#include "tests/unit/detect/shapes.hpp"

namespace binpick::vision {
namespace {
/// Value k of point i, of points kept by eights.
float value(const std::vector<float>& groups, std::size_t values, std::size_t i, std::size_t k) {
  return groups[i / 8 * 8 * values + k * 8 + i % 8];
}

struct Drawing {
  Drawing() {
    scene.pixel_mm = 1.5;
    scene.origin_mm = {-130, -110};
    scene.jump_mm = 3;
    pose.R = Eigen::AngleAxisf(0.7F, Eigen::Vector3f(1, 2, 3).normalized()).toRotationMatrix();
    pose.t = {10, -4, 60};
    part.draw(pose.R, pose.t, scene.pixel_mm, scene.origin_mm, drawn);
  }
  Scene scene;
  Rasteriser part{shapes::bracket()};
  Pose pose;
  Template drawn;
};

TEST(ModelPoints, AreEverySoManiethPixelAndEdgePixelOfATemplate) {
  const Drawing d;
  std::vector<std::array<float, 6>> surfels;
  std::vector<std::array<float, 5>> edges;
  const auto at = [&](int r, int c) {
    const bool inside = r >= 0 && c >= 0 && r < d.drawn.rows && c < d.drawn.cols;
    return inside ? d.drawn.top_mm[d.drawn.at(r, c)] : std::numeric_limits<float>::quiet_NaN();
  };
  for (int r = 0; r < d.drawn.rows; ++r)
    for (int c = 0; c < d.drawn.cols; ++c) {
      const float z = at(r, c);
      if (std::isnan(z)) continue;
      Eigen::Vector2f out = Eigen::Vector2f::Zero();
      bool beside_higher = false;
      for (const auto& [dr, dc] : std::array<std::array<int, 2>, 4>{{{0, 1}, {1, 0}, {0, -1}, {-1, 0}}}) {
        const float beside = at(r + dr, c + dc);
        if (!(z - beside <= d.scene.jump_mm)) out += Eigen::Vector2f(static_cast<float>(dc), static_cast<float>(dr));
        beside_higher |= beside - z > d.scene.jump_mm;
      }
      const auto x = static_cast<float>(-130 + 1.5 * (c + d.drawn.col0));
      const auto y = static_cast<float>(-110 + 1.5 * (r + d.drawn.row0));
      Eigen::Vector3f n = d.pose.R * d.part.normal(d.drawn.triangle[d.drawn.at(r, c)]);
      if (n.z() < 0) n = -n;
      if (out.norm() > 0.5F)
        edges.push_back({x, y, z, out.normalized().x(), out.normalized().y()});
      else if (!beside_higher)
        surfels.push_back({x, y, z, n.x(), n.y(), n.z()});
    }
  ASSERT_GT(surfels.size(), 2000U);
  ASSERT_GT(edges.size(), 200U);
  for (const kernels::Table* loops : {&kernels::portable(), &kernels::table()})
    for (const auto& [most, edges_most] :
         std::array<std::array<std::size_t, 2>, 3>{{{400, 160}, {7, 3}, {99999, 99999}}}) {
      SCOPED_TRACE(loops->name);
      const ModelPoints model = model_points(d.scene, d.part, d.pose, d.drawn, most, edges_most, *loops);
      const std::size_t step = (surfels.size() + most - 1) / most,
                        edge_step = (edges.size() + edges_most - 1) / edges_most;
      ASSERT_EQ(model.surfel_count, (surfels.size() + step - 1) / step);
      ASSERT_EQ(model.edge_count, (edges.size() + edge_step - 1) / edge_step);
      for (std::size_t i = 0; i < model.surfel_count; ++i)
        for (std::size_t k = 0; k < 6; ++k)
          ASSERT_NEAR(value(model.surfels, 6, i, k), surfels[i * step][k], 1e-5) << i << " " << k;
      for (std::size_t i = 0; i < model.edge_count; ++i)
        for (std::size_t k = 0; k < 5; ++k)
          ASSERT_NEAR(value(model.edges, 5, i, k), edges[i * edge_step][k], 1e-5) << i << " " << k;
    }
}

TEST(ModelPoints, OfNothingAreNone) {
  Drawing d;
  d.part.draw(d.pose.R, {1e9F, 0, 0}, d.scene.pixel_mm, d.scene.origin_mm, d.drawn);
  const ModelPoints model = model_points(d.scene, d.part, d.pose, d.drawn, 400, 160);
  EXPECT_EQ(model.surfel_count + model.edge_count, 0U);
}
}  // namespace
}  // namespace binpick::vision
