#include <chrono>
#include <gtest/gtest.h>

#include "tests/unit/vision/shapes.hpp"
#include "vision/knowledge_base_impl.hpp"
#include "vision/surface.hpp"

/// Meshes as CAD programs and scanners really leave them: trained, or refused with a clear line.
namespace binpick::vision {
namespace {
PartOptions few(int rotations) {
  PartOptions options;
  options.name = "part";
  options.rotations = rotations;
  return options;
}

KnowledgeBase trained(const Mesh& mesh, int rotations = 60) {
  auto base = train(mesh, few(rotations), {}, nullptr, 1);
  EXPECT_TRUE(base) << base.error().text;
  return base.value();
}

/// How far the samples of all views lie from the surface of `mesh` at worst.
double farthest_sample_mm(const KnowledgeBase& base, const Mesh& mesh) {
  const SurfaceTree tree(mesh);
  double most = 0;
  for (const View& view : base.impl().views) {
    const Eigen::Vector3f anchor = view.R_supply_object * view.anchors_object_mm.front();
    for (const SurfaceSample& s : view.surface) {
      const Eigen::Vector3f p = view.R_supply_object.conjugate() * (anchor + s.p_mm);
      most = std::max(most, tree.distance_mm(p.cast<double>(), 100));
    }
  }
  return most;
}

/// A knob with waves all around, as a scanned part may come: half a million triangles.
Mesh knob() {
  const int sides = 500, rings = 501;
  Mesh mesh;
  for (int r = 0; r < rings; ++r)
    for (int s = 0; s < sides; ++s) {
      const double polar = std::numbers::pi * (r + 0.5) / rings, turn = 2 * std::numbers::pi * s / sides;
      const double radius =
          30 + 3 * std::cos(3 * turn) * std::sin(polar) + 8 * std::pow(std::max(0.0, std::cos(polar)), 2);
      mesh.vertices_mm.emplace_back(Eigen::Vector3d(radius * std::sin(polar) * std::cos(turn),
                                                    radius * std::sin(polar) * std::sin(turn),
                                                    0.7 * radius * std::cos(polar))
                                        .cast<float>());
    }
  for (int r = 0; r + 1 < rings; ++r)
    for (int s = 0; s < sides; ++s) {
      const auto at = [&](int ring, int side) { return static_cast<std::uint32_t>(ring * sides + side % sides); };
      mesh.triangles.push_back({at(r, s), at(r + 1, s), at(r + 1, s + 1)});
      mesh.triangles.push_back({at(r, s), at(r + 1, s + 1), at(r, s + 1)});
    }
  return mesh;
}

TEST(Robustness, FlippedNormalsChangeNothing) {
  const Mesh good = shapes::l_shape();
  Mesh inside_out = good, mixed = good;
  for (auto& t : inside_out.triangles) std::swap(t[0], t[1]);
  for (std::size_t i = 0; i < mixed.triangles.size(); i += 2) std::swap(mixed.triangles[i][0], mixed.triangles[i][1]);
  const KnowledgeBase reference = trained(good);
  for (const Mesh& mesh : {inside_out, mixed}) {
    const KnowledgeBase base = trained(mesh);
    ASSERT_EQ(base.impl().views.size(), reference.impl().views.size());
    for (std::size_t i = 0; i < base.impl().views.size(); ++i) {
      const View &a = base.impl().views[i], &b = reference.impl().views[i];
      ASSERT_EQ(a.surface.size(), b.surface.size());
      for (std::size_t k = 0; k < a.surface.size(); ++k) {
        EXPECT_LT((a.surface[k].p_mm - b.surface[k].p_mm).norm(), 1e-3F);
        EXPECT_LT((a.surface[k].normal - b.surface[k].normal).norm(), 1e-3F);
      }
    }
  }
}

TEST(Robustness, FacesInsideAndAHoleAreTrained) {
  Mesh crowded = shapes::l_shape();
  shapes::add(crowded, shapes::box(20, 10, 4));  // a rib nobody sees
  crowded.triangles.push_back({0, 3, 5});        // a sheet through the body
  EXPECT_LT(farthest_sample_mm(trained(crowded), shapes::l_shape()), 0.01);
  Mesh holed = shapes::l_shape();
  holed.triangles.erase(holed.triangles.begin() + 2);  // one of the top's two
  EXPECT_LT(farthest_sample_mm(trained(holed), shapes::l_shape()), 0.01);
}

TEST(Robustness, MetresAreRefusedAndNamed) {
  Mesh part = shapes::l_shape();
  for (const double metres : {0.06, 0.4, 1.5}) {
    Mesh small = part;
    for (Eigen::Vector3f& v : small.vertices_mm) v *= static_cast<float>(metres / part.diameter_mm());
    const auto base = train(small, few(20), {}, nullptr, 1);
    ASSERT_FALSE(base) << metres;
    EXPECT_NE(base.error().text.find("check mesh_unit"), std::string::npos) << base.error().text;
  }
}

TEST(Robustness, HalfAMillionTrianglesAreRenderedAsFew) {
  const Mesh mesh = knob();
  ASSERT_GE(mesh.triangles.size(), 500'000U);
  TrainingSummary summary;
  const auto base = train(mesh, few(200), {}, &summary, 1);
  ASSERT_TRUE(base) << base.error().text;
  EXPECT_EQ(base->impl().mesh_hash, mesh_hash(mesh));
  EXPECT_LT(base->mesh().triangles.size(), 12'000U);
  EXPECT_EQ(summary.triangles, mesh.triangles.size());
  EXPECT_EQ(summary.triangles_rendered, base->mesh().triangles.size());
  const SurfaceTree tree(base->mesh());
  double most = 0;
  for (std::size_t i = 0; i < mesh.vertices_mm.size(); i += 7)
    most = std::max(most, tree.distance_mm(mesh.vertices_mm[i].cast<double>(), 10));
  EXPECT_LE(most, base->noise_mm() / 3 + 1e-3);
  EXPECT_EQ(base->symmetry().kind, Symmetry::Kind::Finite);
  EXPECT_EQ(base->symmetry().rotations.size(), 3U);
}
}  // namespace
}  // namespace binpick::vision
