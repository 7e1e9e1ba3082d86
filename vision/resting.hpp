#pragma once

#include <Eigen/Geometry>
#include <array>
#include <cstdint>
#include <vector>

#include "vision/mesh.hpp"
#include "vision/symmetry.hpp"

namespace binpick::vision {
/// Triangles of the convex hull, counter-clockwise from outside; none when the points have no extent.
std::vector<std::array<std::uint32_t, 3>> convex_hull(const std::vector<Eigen::Vector3f>& points);

/// Of a body of even density. Where the mesh does not enclose a volume (open, or its triangles wound either way), the
/// surface's centroid stands for it.
Eigen::Vector3d centre_of_mass_mm(const Mesh& mesh);

/// A way to lie on a flat floor.
struct RestingPose {
  Eigen::Vector3d down;   ///< Object frame, unit: what points to the floor.
  double height_mm = 0;   ///< Of the centre of mass over the floor.
  double barrier_mm = 0;  ///< How far the centre of mass has to rise before the part tips over to a lower pose.
};

/// The poses in which the part lies by itself, lowest centre of mass first: local minima of its height over all
/// directions that are at least `barrier_mm` deep. A round part rolls between poses of one height; these are listed,
/// `step_rad` apart, each of those that the symmetry makes equal once.
std::vector<RestingPose> resting_poses(const Mesh& mesh, const Symmetry& symmetry, double barrier_mm, double step_rad);

/// The first of `poses` and of the others those at least `step_rad` from all before them, the symmetry minded.
std::vector<RestingPose> apart(const std::vector<RestingPose>& poses, const Symmetry& symmetry, double step_rad);

/// Training rotations of a part that lies on a belt: each resting pose in turns about the vertical `turn_rad` apart,
/// upright and leaning by `lean_rad` to three sides; those that the symmetry makes equal once.
std::vector<Eigen::Quaterniond> resting_rotations(const std::vector<RestingPose>& poses, const Symmetry& symmetry,
                                                  double turn_rad, double lean_rad);
}  // namespace binpick::vision
