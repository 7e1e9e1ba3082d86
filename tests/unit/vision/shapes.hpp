#pragma once

#include <Eigen/Geometry>
#include <cmath>
#include <functional>
#include <numbers>

#include "vision/mesh.hpp"

/// Solids of known form for the tests of vision/, millimetres, counter-clockwise from outside.
namespace binpick::vision::shapes {
inline void add(Mesh& to, const Mesh& from, const Eigen::Vector3f& shift = Eigen::Vector3f::Zero()) {
  const auto base = static_cast<std::uint32_t>(to.vertices_mm.size());
  for (const Eigen::Vector3f& v : from.vertices_mm) to.vertices_mm.push_back(v + shift);
  for (const auto& t : from.triangles) to.triangles.push_back({base + t[0], base + t[1], base + t[2]});
}

/// Centred on the origin.
inline Mesh box(float x, float y, float z) {
  Mesh mesh;
  for (int i = 0; i < 8; ++i)
    mesh.vertices_mm.emplace_back((i & 1 ? x : -x) / 2, (i & 2 ? y : -y) / 2, (i & 4 ? z : -z) / 2);
  mesh.triangles = {{0, 2, 3}, {0, 3, 1}, {4, 5, 7}, {4, 7, 6}, {0, 1, 5}, {0, 5, 4},
                    {2, 6, 7}, {2, 7, 3}, {0, 4, 6}, {0, 6, 2}, {1, 3, 7}, {1, 7, 5}};
  return mesh;
}

/// Two boxes glued: a foot and a tower at one end; no symmetry but a mirror one.
inline Mesh l_shape() {
  Mesh mesh;
  add(mesh, box(60, 30, 10));
  add(mesh, box(12, 30, 40), {-24, 0, 25});
  return mesh;
}

/// About z: radius_mm(z) of each ring, closed at both ends; `sides` corners.
inline Mesh turned(const std::vector<std::pair<float, float>>& z_and_radius, int sides) {
  Mesh mesh;
  const auto n = static_cast<std::uint32_t>(sides);
  for (const auto& [z, r] : z_and_radius)
    for (int i = 0; i < sides; ++i) {
      const double a = 2 * std::numbers::pi * i / sides;
      mesh.vertices_mm.emplace_back(r * static_cast<float>(std::cos(a)), r * static_cast<float>(std::sin(a)), z);
    }
  const auto rings = static_cast<std::uint32_t>(z_and_radius.size());
  for (std::uint32_t ring = 0; ring + 1 < rings; ++ring)
    for (std::uint32_t i = 0; i < n; ++i) {
      const std::uint32_t a = ring * n + i, b = ring * n + (i + 1) % n;
      mesh.triangles.push_back({a, b, b + n});
      mesh.triangles.push_back({a, b + n, a + n});
    }
  const auto foot = static_cast<std::uint32_t>(mesh.vertices_mm.size());
  mesh.vertices_mm.emplace_back(0, 0, z_and_radius.front().first);
  mesh.vertices_mm.emplace_back(0, 0, z_and_radius.back().first);
  for (std::uint32_t i = 0; i < n; ++i) {
    mesh.triangles.push_back({foot, (i + 1) % n, i});
    mesh.triangles.push_back({foot + 1, (rings - 1) * n + i, (rings - 1) * n + (i + 1) % n});
  }
  return cleaned(mesh);
}

inline Mesh cylinder(float radius, float length, int sides = 64) {
  return turned({{-length / 2, radius}, {length / 2, radius}}, sides);
}

inline Mesh sphere(float radius, int sides = 48) {
  std::vector<std::pair<float, float>> rings;
  for (int i = 1; i < sides / 2; ++i) {
    const double a = std::numbers::pi * i / (sides / 2) - std::numbers::pi / 2;
    rings.emplace_back(radius * static_cast<float>(std::sin(a)), radius * static_cast<float>(std::cos(a)));
  }
  rings.insert(rings.begin(), {-radius, 0.0F});
  rings.emplace_back(radius, 0.0F);
  return turned(rings, sides);
}

inline Mesh moved(Mesh mesh, const Eigen::Isometry3d& T) {
  for (Eigen::Vector3f& v : mesh.vertices_mm) v = (T * v.cast<double>()).cast<float>();
  return mesh;
}
}  // namespace binpick::vision::shapes
