#pragma once

#include <Eigen/Geometry>
#include <string>
#include <vector>

#include "vision/mesh.hpp"

namespace binpick::vision {
/// Proper symmetry group of a part, about a point of its own (the surface centroid).
/// Pose P and P * g describe the same appearance.
struct Symmetry {
  enum class Kind { None, Finite, Revolution, RevolutionFlip, Sphere } kind = Kind::None;
  Eigen::Vector3d centre_mm = Eigen::Vector3d::Zero();  ///< Object frame.
  Eigen::Vector3d axis = Eigen::Vector3d::UnitZ();      ///< Of the revolution, object frame, unit length.
  std::vector<Eigen::Matrix3d> rotations = {Eigen::Matrix3d::Identity()};  ///< Finite group, identity first.
};

/// Found from the mesh: an element is accepted when the mesh, moved by it, lies within `tolerance_mm` of itself (rms).
Symmetry find_symmetry(const Mesh& mesh, double tolerance_mm);
std::string to_string(const Symmetry& symmetry);

/// Symmetry-aware distance of two poses (object to some common frame): the least over the group of the centroid's
/// distance and the angle between the rotations (for a revolution: between the axes), each minimised together by the
/// surface displacement it stands for (Brégier et al., 2017).
struct PoseDistance {
  double centroid_mm = 0;
  double angle_rad = 0;
};
PoseDistance pose_distance(const Eigen::Isometry3d& T_a_object_1, const Eigen::Isometry3d& T_a_object_2,
                           const Symmetry& symmetry, double radius_mm);
}  // namespace binpick::vision
