#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <numbers>

#include "vision/mesh.hpp"

/// Small meshes for the tests of detection.
namespace binpick::vision::shapes {
inline void add_box(Mesh& mesh, const Eigen::Vector3f& low, const Eigen::Vector3f& high) {
  const auto first = static_cast<std::uint32_t>(mesh.vertices_mm.size());
  for (int i = 0; i < 8; ++i)
    mesh.vertices_mm.emplace_back(i & 1 ? high.x() : low.x(), i & 2 ? high.y() : low.y(), i & 4 ? high.z() : low.z());
  for (const auto& [a, b, c, d] : {std::array<std::uint32_t, 4>{0, 2, 3, 1},
                                   {4, 5, 7, 6},
                                   {0, 1, 5, 4},
                                   {2, 6, 7, 3},
                                   {0, 4, 6, 2},
                                   {1, 3, 7, 5}}) {
    mesh.triangles.push_back({first + a, first + b, first + c});
    mesh.triangles.push_back({first + a, first + c, first + d});
  }
}

/// An angle bracket of 160 × 90 × 70 mm with a foot at one end: no symmetry, four faces to lie on.
inline Mesh bracket() {
  Mesh mesh;
  add_box(mesh, {-80, -45, 0}, {80, 45, 22});
  add_box(mesh, {-80, -45, 22}, {-52, 45, 70});
  add_box(mesh, {40, -45, 22}, {80, -10, 44});
  return mesh;
}

/// A round plate, 180 mm across, that shows how it is turned by one ridge on its top.
inline Mesh dial() {
  Mesh mesh;
  constexpr std::uint32_t kCorners = 32;
  for (const float z : {0.0F, 24.0F})
    for (std::uint32_t k = 0; k < kCorners; ++k) {
      const float angle = 2 * std::numbers::pi_v<float> * static_cast<float>(k) / kCorners;
      mesh.vertices_mm.emplace_back(90 * std::cos(angle), 90 * std::sin(angle), z);
    }
  for (std::uint32_t k = 0; k < kCorners; ++k) {
    const std::uint32_t next = (k + 1) % kCorners;
    mesh.triangles.push_back({k, next, kCorners + next});
    mesh.triangles.push_back({k, kCorners + next, kCorners + k});
    mesh.triangles.push_back({0, next, k});
    mesh.triangles.push_back({kCorners, kCorners + k, kCorners + next});
  }
  add_box(mesh, {30, -10, 24}, {84, 10, 42});
  return mesh;
}

/// Scaled copy.
inline Mesh scaled(Mesh mesh, float factor) {
  for (Eigen::Vector3f& v : mesh.vertices_mm) v *= factor;
  return mesh;
}
}  // namespace binpick::vision::shapes
