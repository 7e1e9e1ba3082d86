#include "tests/emulators/world/solid_contact.hpp"

#include <array>
#include <cmath>
#include <limits>
#include <vector>

namespace binpick::emulators {
namespace {
using Eigen::Vector2d;
using Eigen::Vector3d;
using Shape = vision::Gripper::Solid::Shape;
using Corners = std::array<Vector3d, 3>;

/// Box with its middle at the origin; separating axes (Gottschalk et al., 1996; for triangles Akenine-Möller, 2001).
bool meets_box(const Vector3d& half, const Corners& p) {
  for (Eigen::Index k = 0; k < 3; ++k) {
    const auto [low, high] = std::minmax({p[0][k], p[1][k], p[2][k]});
    if (low > half[k] || high < -half[k]) return false;
  }
  const std::array<Vector3d, 3> edges{p[1] - p[0], p[2] - p[1], p[0] - p[2]};
  const Vector3d normal = edges[0].cross(edges[1]);
  if (std::abs(normal.dot(p[0])) > half.dot(normal.cwiseAbs())) return false;
  for (const Vector3d& edge : edges)
    for (Eigen::Index k = 0; k < 3; ++k) {
      const Vector3d axis = Vector3d::Unit(k).cross(edge);
      const double radius = half.dot(axis.cwiseAbs());
      const auto [low, high] = std::minmax({axis.dot(p[0]), axis.dot(p[1]), axis.dot(p[2])});
      if (low > radius || high < -radius) return false;
    }
  return true;
}

/// Part of a polygon where sign · z <= limit.
std::vector<Vector3d> clipped(const std::vector<Vector3d>& polygon, double sign, double limit) {
  std::vector<Vector3d> kept;
  for (std::size_t i = 0; i < polygon.size(); ++i) {
    const Vector3d &a = polygon[i], &b = polygon[(i + 1) % polygon.size()];
    const double da = sign * a.z() - limit, db = sign * b.z() - limit;
    if (da <= 0) kept.push_back(a);
    if ((da < 0 && db > 0) || (da > 0 && db < 0)) kept.push_back(a + da / (da - db) * (b - a));
  }
  return kept;
}

/// Cylinder about z, its middle at the origin: what of the triangle lies between its ends, seen along the axis.
bool meets_cylinder(double radius, double half_length, const Corners& p) {
  const auto between = clipped(clipped({p.begin(), p.end()}, 1, half_length), -1, half_length);
  if (between.empty()) return false;
  bool left = false, right = false;
  double nearest = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < between.size(); ++i) {
    const Vector2d a = between[i].head<2>(), b = between[(i + 1) % between.size()].head<2>(), edge = b - a;
    const double length2 = edge.squaredNorm();
    const double share = length2 > 0 ? std::clamp(-a.dot(edge) / length2, 0.0, 1.0) : 0;
    nearest = std::min(nearest, (a + share * edge).norm());
    const double side = a.x() * edge.y() - a.y() * edge.x();
    left |= side > 0;
    right |= side < 0;
  }
  return nearest <= radius || left != right;  // the axis goes through it
}

Vector3d half_size(const vision::Gripper::Solid& solid) { return solid.size_mm / 2; }
}  // namespace

bool meets(const vision::Gripper::Solid& solid, const Eigen::Isometry3d& T_object_solid, double inset_mm,
           const RayMesh& mesh) {
  const Vector3d half = half_size(solid).array() - inset_mm;
  if (half.minCoeff() <= 0) return false;
  const Eigen::Matrix3d R = T_object_solid.linear();
  const Vector3d reach = R.cwiseAbs() * half, at = T_object_solid.translation();
  const Eigen::Array3f low = (at - reach).cast<float>().array(), high = (at + reach).cast<float>().array();
  const Eigen::Isometry3d T_solid_object = T_object_solid.inverse();
  const auto meets_triangle = [&](const RayMesh::Triangle& t) {
    const Vector3d corner = T_solid_object * t.corner.cast<double>();
    const Corners p{corner, corner + T_solid_object.linear() * t.edge1.cast<double>(),
                    corner + T_solid_object.linear() * t.edge2.cast<double>()};
    return solid.shape == Shape::Box ? meets_box(half, p) : meets_cylinder(half.x(), half.z(), p);
  };
  const RayMesh::View view = mesh.view();
  std::vector<std::uint32_t> open{0};
  while (!open.empty()) {
    const RayMesh::Node& node = view.nodes[open.back()];
    open.pop_back();
    if ((node.low.head<3>() > high).any() || (node.high.head<3>() < low).any()) continue;
    if (node.count == 0) {
      open.push_back(node.first);
      open.push_back(node.first + 1);
      continue;
    }
    for (std::uint32_t k = 0; k < node.count; ++k)
      if (meets_triangle(view.triangles[node.first + k])) return true;
  }
  return false;
}

double depth_mm(const vision::Gripper::Solid& solid, const Eigen::Isometry3d& T_object_solid, double least_mm,
                const RayMesh& mesh) {
  double depth = 0;
  for (double inset = least_mm; meets(solid, T_object_solid, inset, mesh); inset *= 2) depth = inset;
  return depth;
}
}  // namespace binpick::emulators
