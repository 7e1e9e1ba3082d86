#include "vision/footprint.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace binpick::vision {
namespace {
using Eigen::Vector2d;

double cross(const Vector2d& a, const Vector2d& b) { return a.x() * b.y() - a.y() * b.x(); }

double distance_mm(const Vector2d& point, const Vector2d& from, const Vector2d& to) {
  const Vector2d along = to - from;
  const double length2 = along.squaredNorm();
  const double share = length2 > 0 ? std::clamp((point - from).dot(along) / length2, 0.0, 1.0) : 0;
  return (from + share * along - point).norm();
}

bool holds(const Footprint& area, const Vector2d& point) {
  const auto& c = area.corners_mm;
  if (c.size() < 3) return false;
  for (std::size_t i = 0; i < c.size(); ++i)
    if (cross(c[(i + 1) % c.size()] - c[i], point - c[i]) < 0) return false;
  return true;
}

/// Two convex areas that overlap without a corner of one in the other have edges that cross.
bool edges_cross(const Footprint& a, const Footprint& b) {
  const auto& p = a.corners_mm;
  const auto& q = b.corners_mm;
  for (std::size_t i = 0; i < p.size(); ++i) {
    const Vector2d from = p[i], along = p[(i + 1) % p.size()] - from;
    for (std::size_t k = 0; k < q.size(); ++k) {
      const Vector2d other = q[k], beside = q[(k + 1) % q.size()] - other;
      const double side_a = cross(along, other - from) * cross(along, other + beside - from);
      const double side_b = cross(beside, from - other) * cross(beside, from + along - other);
      if (side_a < 0 && side_b < 0) return true;
    }
  }
  return false;
}

double least_to_edges(const Footprint& corners, const Footprint& edges) {
  const auto& q = edges.corners_mm;
  double least = std::numeric_limits<double>::infinity();
  for (const Vector2d& point : corners.corners_mm)
    for (std::size_t k = 0; k < q.size(); ++k) least = std::min(least, distance_mm(point, q[k], q[(k + 1) % q.size()]));
  return least;
}
}  // namespace

Footprint footprint_of(std::span<const Eigen::Vector3f> points_object_mm, const Eigen::Isometry3d& T_supply_object) {
  std::vector<Vector2d> points;
  points.reserve(points_object_mm.size());
  for (const Eigen::Vector3f& p : points_object_mm) points.emplace_back((T_supply_object * p.cast<double>()).head<2>());
  std::ranges::sort(
      points, [](const Vector2d& a, const Vector2d& b) { return a.x() != b.x() ? a.x() < b.x() : a.y() < b.y(); });
  Footprint hull;
  auto& corners = hull.corners_mm;
  // Andrew's monotone chain: the lower side from left to right, then the upper one back.
  const auto run = [&](auto begin, auto end, std::size_t fixed) {
    for (auto it = begin; it != end; ++it) {
      while (corners.size() >= fixed + 2 &&
             cross(corners.back() - corners[corners.size() - 2], *it - corners.back()) <= 0)
        corners.pop_back();
      corners.push_back(*it);
    }
    if (corners.size() > fixed + 1) corners.pop_back();  // the other side begins with it
  };
  run(points.begin(), points.end(), 0);
  run(points.rbegin(), points.rend(), corners.size());
  return hull;
}

double gap_mm(const Footprint& a, const Footprint& b) {
  if (a.corners_mm.empty() || b.corners_mm.empty()) return std::numeric_limits<double>::infinity();
  if (holds(a, b.corners_mm.front()) || holds(b, a.corners_mm.front()) || edges_cross(a, b)) return 0;
  return std::min(least_to_edges(a, b), least_to_edges(b, a));
}
}  // namespace binpick::vision
