#pragma once

#include <Eigen/Geometry>
#include <algorithm>
#include <limits>
#include <optional>
#include <span>
#include <vector>

#include "vision/gripper.hpp"

namespace binpick::vision {
/// The room that a box or cylinder takes up on a straight way: a convex body with a middle that it is symmetric about,
/// kept as pairs of parallel planes. A cylinder is a prism of sixteen sides around it.
class Swept {
 public:
  /// `T_a_tcp`: at the end of the way; `way_mm` (frame a) leads from there to its beginning. The solid is larger by
  /// `grown_mm` to all its sides.
  Swept(const Gripper::Solid& solid, const Eigen::Isometry3d& T_a_tcp, const Eigen::Vector3d& way_mm,
        double grown_mm = 0);

  /// What of the vertical line at x, y is inside: [low, high], empty where low is above high.
  struct Span {
    float low = -std::numeric_limits<float>::infinity(), high = std::numeric_limits<float>::infinity();
    bool empty() const { return !(low <= high); }
  };
  Span at(float x_mm, float y_mm) const {
    Span span;
    for (const Leaning& pair : leaning_) {
      const float middle = pair.z + pair.per_x * x_mm + pair.per_y * y_mm;
      span.low = std::max(span.low, middle - pair.half);
      span.high = std::min(span.high, middle + pair.half);
    }
    for (const Upright& pair : upright_)
      if (std::abs(pair.x * x_mm + pair.y * y_mm - pair.middle) > pair.half) return {1, 0};
    return span;
  }
  /// Bounds of that over the rectangle of these half sides about x, y; empty: nothing of it is inside.
  Span over(float x_mm, float y_mm, float half_x_mm, float half_y_mm) const;
  /// The least and the greatest that the body reaches in this direction (of length 1).
  struct Range {
    double least, greatest;
  };
  Range along(const Eigen::Vector3d& direction) const;
  bool contains(const Eigen::Vector3d& p_mm) const;
  /// Whether it has a point in common with the triangle.
  bool meets(std::span<const Eigen::Vector3d, 3> triangle_mm) const;
  /// Half of its edges; the body is the middle and up to one of each of them to either side.
  const std::vector<Eigen::Vector3d>& edges_mm() const { return edges_; }
  const Eigen::Vector3d& middle_mm() const { return middle_; }

 private:
  struct Pair {
    Eigen::Vector3d normal;  ///< Length 1.
    double middle, half;
  };
  struct Leaning {
    float z, per_x, per_y, half;
  };
  struct Upright {
    float x, y, middle, half;
  };
  void add_pair(const Eigen::Vector3d& normal);

  Eigen::Vector3d middle_;
  std::vector<Eigen::Vector3d> edges_;
  std::vector<Pair> pairs_;
  std::vector<Leaning> leaning_;
  std::vector<Upright> upright_;
};
}  // namespace binpick::vision
