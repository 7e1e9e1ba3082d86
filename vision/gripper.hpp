#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "base/frames.hpp"

namespace binpick::vision {
/// A gripper's geometry in the tcp frame: z points out of the tool, the way of approach; two equal jaws move along x,
/// each as far from the tcp as the other. A gripper without jaws (magnet, suction cup) is a body only.
struct Gripper {
  struct Solid {
    enum class Shape { Box, Cylinder };
    Shape shape = Shape::Box;
    /// Box: x, y, z. Cylinder: diameter, the same, length; its axis is z. The middle is the origin.
    Eigen::Vector3d size_mm = Eigen::Vector3d::Zero();
    Eigen::Isometry3d T_tcp_solid = Eigen::Isometry3d::Identity();
  };
  struct Jaws {
    double opening_max_mm = 0;                          ///< Between their inner faces.
    Eigen::Vector3d size_mm = Eigen::Vector3d::Zero();  ///< Of one: thickness (x), width (y), length (z).
    double beyond_mm = 0;                               ///< Their tips stand this far beyond the tcp.
  };
  std::optional<Jaws> jaws;
  std::vector<Solid> body;  ///< All that moves with the tcp but the jaws: palm, cylinder, camera, the arm's last axis.
};

/// Body and jaws at one opening (inner face to inner face), for checks and pictures.
std::vector<Gripper::Solid> solids_of(const Gripper& gripper, double opening_mm);
}  // namespace binpick::vision
