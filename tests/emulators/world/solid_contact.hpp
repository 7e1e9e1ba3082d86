#pragma once

#include <Eigen/Geometry>

#include "tests/emulators/world/ray_mesh.hpp"
#include "vision/gripper.hpp"

/// A gripper's solids against the exact triangles of a mesh: nothing is rounded or grown.
namespace binpick::emulators {
/// Whether the solid, made smaller by `inset_mm` on every side, meets the surface. A solid wholly inside the mesh does
/// not, so look often enough along a way. An inset of more than half its thickness leaves nothing of it.
bool meets(const vision::Gripper::Solid& solid, const Eigen::Isometry3d& T_object_solid, double inset_mm,
           const RayMesh& mesh);

/// How deep the surface reaches into the solid: the largest inset, doubled from `least_mm` on, at which they still
/// meet. 0: not even at `least_mm`.
double depth_mm(const vision::Gripper::Solid& solid, const Eigen::Isometry3d& T_object_solid, double least_mm,
                const RayMesh& mesh);
}  // namespace binpick::emulators
