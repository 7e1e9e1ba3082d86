#include "vision/surface.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace binpick::vision {
namespace {
using Corners = std::array<Eigen::Vector3d, 3>;

Corners corners_of(const Mesh& mesh, std::size_t triangle) {
  const auto& t = mesh.triangles[triangle];
  return {mesh.vertices_mm[t[0]].cast<double>(), mesh.vertices_mm[t[1]].cast<double>(),
          mesh.vertices_mm[t[2]].cast<double>()};
}

double area_of(const Corners& v) { return 0.5 * (v[1] - v[0]).cross(v[2] - v[0]).norm(); }
}  // namespace

/// Ericson, Real-Time Collision Detection (2004), 5.1.5: by the region of the plane that the point falls into.
double squared_distance(const Eigen::Vector3d& p, const std::array<Eigen::Vector3d, 3>& v) {
  const Eigen::Vector3d ab = v[1] - v[0], ac = v[2] - v[0], ap = p - v[0];
  const double d1 = ab.dot(ap), d2 = ac.dot(ap);
  if (d1 <= 0 && d2 <= 0) return ap.squaredNorm();
  const Eigen::Vector3d bp = p - v[1];
  const double d3 = ab.dot(bp), d4 = ac.dot(bp);
  if (d3 >= 0 && d4 <= d3) return bp.squaredNorm();
  const double vc = d1 * d4 - d3 * d2;
  if (vc <= 0 && d1 >= 0 && d3 <= 0) return (ap - d1 / (d1 - d3) * ab).squaredNorm();
  const Eigen::Vector3d cp = p - v[2];
  const double d5 = ab.dot(cp), d6 = ac.dot(cp);
  if (d6 >= 0 && d5 <= d6) return cp.squaredNorm();
  const double vb = d5 * d2 - d1 * d6;
  if (vb <= 0 && d2 >= 0 && d6 <= 0) return (ap - d2 / (d2 - d6) * ac).squaredNorm();
  const double va = d3 * d6 - d5 * d4;
  if (va <= 0 && d4 - d3 >= 0 && d5 - d6 >= 0)
    return (bp - (d4 - d3) / ((d4 - d3) + (d5 - d6)) * (v[2] - v[1])).squaredNorm();
  const double scale = 1 / (va + vb + vc);
  return (ap - vb * scale * ab - vc * scale * ac).squaredNorm();
}

SurfaceTree::SurfaceTree(const Mesh& mesh) {
  std::vector<int> order(mesh.triangles.size());
  std::iota(order.begin(), order.end(), 0);
  std::vector<Eigen::Vector3d> middles;
  for (std::size_t i = 0; i < mesh.triangles.size(); ++i) {
    const Corners v = corners_of(mesh, i);
    middles.push_back((v[0] + v[1] + v[2]) / 3);
    corners_.push_back(v);
  }
  if (order.empty()) return;
  build(order, 0, static_cast<int>(order.size()), middles);
  std::vector<Corners> sorted;
  for (const int i : order) sorted.push_back(corners_[static_cast<std::size_t>(i)]);
  corners_ = std::move(sorted);
}

void SurfaceTree::build(std::vector<int>& order, int begin, int end, const std::vector<Eigen::Vector3d>& middles) {
  constexpr int kLeafTriangles = 4;
  const std::size_t self = nodes_.size();
  nodes_.emplace_back();
  Eigen::AlignedBox3d box, middle_box;
  for (int i = begin; i < end; ++i) {
    const auto triangle = static_cast<std::size_t>(order[static_cast<std::size_t>(i)]);
    for (const Eigen::Vector3d& v : corners_[triangle]) box.extend(v);
    middle_box.extend(middles[triangle]);
  }
  nodes_[self].box = box;
  if (end - begin <= kLeafTriangles) {
    nodes_[self].first = begin;
    nodes_[self].count = end - begin;
    return;
  }
  Eigen::Index axis = 0;
  middle_box.sizes().maxCoeff(&axis);
  const int half = (begin + end) / 2;
  std::nth_element(order.begin() + begin, order.begin() + half, order.begin() + end, [&](int a, int b) {
    return middles[static_cast<std::size_t>(a)][axis] < middles[static_cast<std::size_t>(b)][axis];
  });
  build(order, begin, half, middles);
  nodes_[self].first = static_cast<int>(nodes_.size());
  build(order, half, end, middles);
}

void SurfaceTree::nearest(int node, const Eigen::Vector3d& p, double& best_squared) const {
  const Node& here = nodes_[static_cast<std::size_t>(node)];
  if (here.count > 0) {
    for (int i = here.first; i < here.first + here.count; ++i)
      best_squared = std::min(best_squared, squared_distance(p, corners_[static_cast<std::size_t>(i)]));
    return;
  }
  int near = node + 1, far = here.first;
  double near_squared = nodes_[static_cast<std::size_t>(near)].box.squaredExteriorDistance(p);
  double far_squared = nodes_[static_cast<std::size_t>(far)].box.squaredExteriorDistance(p);
  if (far_squared < near_squared) std::swap(near, far), std::swap(near_squared, far_squared);
  if (near_squared < best_squared) nearest(near, p, best_squared);
  if (far_squared < best_squared) nearest(far, p, best_squared);
}

double SurfaceTree::distance_mm(const Eigen::Vector3d& p_mm, double limit_mm) const {
  double best_squared = limit_mm * limit_mm;
  if (!nodes_.empty()) nearest(0, p_mm, best_squared);
  return std::sqrt(best_squared);
}

std::vector<Eigen::Vector3d> sample_surface(const Mesh& mesh, int count) {
  double total = 0;
  for (std::size_t i = 0; i < mesh.triangles.size(); ++i) total += area_of(corners_of(mesh, i));
  std::vector<Eigen::Vector3d> points;
  double passed = 0;
  int drawn = 0;
  for (std::size_t i = 0; i < mesh.triangles.size(); ++i) {
    const Corners v = corners_of(mesh, i);
    passed += area_of(v);
    for (; drawn < count && (drawn + 0.5) * total < passed * count; ++drawn) {
      // Roberts' two-dimensional golden sequence, folded into the triangle.
      double a = std::fmod(0.5 + drawn * 0.7548776662466927, 1), b = std::fmod(0.5 + drawn * 0.5698402909980532, 1);
      if (a + b > 1) a = 1 - a, b = 1 - b;
      points.emplace_back(v[0] + a * (v[1] - v[0]) + b * (v[2] - v[0]));
    }
  }
  return points;
}

Eigen::Matrix3d surface_covariance(const Mesh& mesh) {
  const Eigen::Vector3d centroid = mesh.centroid_mm();
  Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
  double total = 0;
  for (std::size_t i = 0; i < mesh.triangles.size(); ++i) {
    Corners v = corners_of(mesh, i);
    const double area = area_of(v);
    for (Eigen::Vector3d& corner : v) corner -= centroid;
    const Eigen::Vector3d all = v[0] + v[1] + v[2];
    sum += area / 12 *
           (all * all.transpose() + v[0] * v[0].transpose() + v[1] * v[1].transpose() + v[2] * v[2].transpose());
    total += area;
  }
  return total > 0 ? Eigen::Matrix3d(sum / total) : Eigen::Matrix3d::Zero();
}
}  // namespace binpick::vision
