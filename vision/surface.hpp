#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <array>
#include <vector>

#include "vision/mesh.hpp"

namespace binpick::vision {
/// Of a point from a triangle, mm².
double squared_distance(const Eigen::Vector3d& p_mm, const std::array<Eigen::Vector3d, 3>& corners_mm);

/// A mesh that answers how far a point lies from its surface: a tree of boxes over the triangles.
class SurfaceTree {
 public:
  explicit SurfaceTree(const Mesh& mesh);
  /// Distance of `p_mm` to the nearest triangle; `limit_mm` where it is farther than that.
  double distance_mm(const Eigen::Vector3d& p_mm, double limit_mm) const;

 private:
  struct Node {
    Eigen::AlignedBox3d box;
    int first = 0, count = 0;  ///< Triangles of a leaf; count 0: the children are the next node and `first`.
  };
  void build(std::vector<int>& order, int begin, int end, const std::vector<Eigen::Vector3d>& middles);
  void nearest(int node, const Eigen::Vector3d& p, double& best_squared) const;

  std::vector<Node> nodes_;
  std::vector<std::array<Eigen::Vector3d, 3>> corners_;  ///< In the leaves' order.
};

/// `count` points spread over the surface by area, the same ones each time.
std::vector<Eigen::Vector3d> sample_surface(const Mesh& mesh, int count);
/// Mean of x xᵀ over the surface, x relative to its centroid, mm².
Eigen::Matrix3d surface_covariance(const Mesh& mesh);
}  // namespace binpick::vision
