#include "vision/swept.hpp"

#include <array>
#include <cmath>
#include <numbers>

namespace binpick::vision {
namespace {
/// Sides of a prism that stands for a cylinder, over two: it is 2 % too wide at its corners.
constexpr int kHalfSides = 8;
constexpr double kParallel = 1e-6;
}  // namespace

Swept::Swept(const Gripper::Solid& solid, const Eigen::Isometry3d& T_a_tcp, const Eigen::Vector3d& way_mm,
             double grown_mm) {
  const Eigen::Isometry3d T = T_a_tcp * solid.T_tcp_solid;
  const Eigen::Vector3d half = (0.5 * solid.size_mm.array() + grown_mm).max(1e-3);
  middle_ = T.translation() + 0.5 * way_mm;
  if (solid.shape == Gripper::Solid::Shape::Box) {
    for (Eigen::Index axis = 0; axis < 3; ++axis) edges_.emplace_back(half[axis] * T.linear().col(axis));
  } else {
    const double side = half.x() * std::tan(std::numbers::pi / (2 * kHalfSides));
    for (int k = 0; k < kHalfSides; ++k) {
      const double angle = std::numbers::pi * k / kHalfSides;
      edges_.emplace_back(side * (std::cos(angle) * T.linear().col(0) + std::sin(angle) * T.linear().col(1)));
    }
    edges_.emplace_back(half.z() * T.linear().col(2));
  }
  if (way_mm.norm() > 1e-6) edges_.emplace_back(0.5 * way_mm);
  // Each face of such a body lies between two of its edges.
  for (std::size_t i = 0; i < edges_.size(); ++i)
    for (std::size_t k = i + 1; k < edges_.size(); ++k) {
      const Eigen::Vector3d normal = edges_[i].cross(edges_[k]);
      if (normal.norm() > kParallel * edges_[i].norm() * edges_[k].norm()) add_pair(normal.normalized());
    }
}

void Swept::add_pair(const Eigen::Vector3d& normal) {
  for (const Pair& known : pairs_)
    if (std::abs(known.normal.dot(normal)) > 1 - 1e-12) return;
  double half = 0;
  for (const Eigen::Vector3d& edge : edges_) half += std::abs(normal.dot(edge));
  const double middle = normal.dot(middle_);
  pairs_.push_back({normal, middle, half});
  if (std::abs(normal.z()) > kParallel)
    leaning_.push_back({static_cast<float>(middle / normal.z()), static_cast<float>(-normal.x() / normal.z()),
                        static_cast<float>(-normal.y() / normal.z()), static_cast<float>(half / std::abs(normal.z()))});
  else
    upright_.push_back({static_cast<float>(normal.x()), static_cast<float>(normal.y()), static_cast<float>(middle),
                        static_cast<float>(half)});
}

Swept::Span Swept::over(float x_mm, float y_mm, float half_x_mm, float half_y_mm) const {
  Span span;
  for (const Leaning& pair : leaning_) {
    const float middle = pair.z + pair.per_x * x_mm + pair.per_y * y_mm;
    const float slack = pair.half + std::abs(pair.per_x) * half_x_mm + std::abs(pair.per_y) * half_y_mm;
    // Of the lower planes the least value counts, of the upper ones the greatest.
    span.low = std::max(span.low, middle - slack);
    span.high = std::min(span.high, middle + slack);
  }
  for (const Upright& pair : upright_)
    if (std::abs(pair.x * x_mm + pair.y * y_mm - pair.middle) >
        pair.half + std::abs(pair.x) * half_x_mm + std::abs(pair.y) * half_y_mm)
      return {1, 0};
  return span;
}

Swept::Range Swept::along(const Eigen::Vector3d& direction) const {
  const double middle = direction.dot(middle_);
  double half = 0;
  for (const Eigen::Vector3d& edge : edges_) half += std::abs(direction.dot(edge));
  return {middle - half, middle + half};
}

bool Swept::contains(const Eigen::Vector3d& p_mm) const {
  return std::ranges::all_of(
      pairs_, [&](const Pair& pair) { return std::abs(pair.normal.dot(p_mm) - pair.middle) <= pair.half; });
}

bool Swept::meets(std::span<const Eigen::Vector3d, 3> triangle_mm) const {
  // Cut by each plane in turn (Sutherland and Hodgman, 1974): what is left lies inside.
  std::vector<Eigen::Vector3d> left(triangle_mm.begin(), triangle_mm.end()), cut;
  for (const Pair& pair : pairs_)
    for (const double side : {-1.0, 1.0}) {
      const auto beyond = [&](const Eigen::Vector3d& p) {
        return side * (pair.normal.dot(p) - pair.middle) - pair.half;
      };
      cut.clear();
      for (std::size_t i = 0; i < left.size(); ++i) {
        const Eigen::Vector3d &a = left[i], &b = left[(i + 1) % left.size()];
        const double at_a = beyond(a), at_b = beyond(b);
        if (at_a <= 0) cut.push_back(a);
        if ((at_a < 0 && at_b > 0) || (at_a > 0 && at_b < 0)) cut.emplace_back(a + at_a / (at_a - at_b) * (b - a));
      }
      left.swap(cut);
      if (left.empty()) return false;
    }
  return true;
}
}  // namespace binpick::vision
