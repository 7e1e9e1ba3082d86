#pragma once

#include <Eigen/Geometry>
#include <span>
#include <vector>

/// What an object covers of the supply's floor, seen from above: whoever stands apart from it there is not moved when
/// it is taken.
namespace binpick::vision {
/// The convex hull of the object's points in x and y of the supply, counter-clockwise, mm. Empty: of no point.
struct Footprint {
  std::vector<Eigen::Vector2d> corners_mm;
};

Footprint footprint_of(std::span<const Eigen::Vector3f> points_object_mm, const Eigen::Isometry3d& T_supply_object);

/// Between the nearest points of both; 0 where they touch or overlap. Infinite if either is empty.
double gap_mm(const Footprint& a, const Footprint& b);
}  // namespace binpick::vision
