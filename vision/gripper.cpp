#include "vision/gripper.hpp"

namespace binpick::vision {
std::vector<Gripper::Solid> solids_of(const Gripper& gripper, double opening_mm) {
  std::vector<Gripper::Solid> solids = gripper.body;
  if (!gripper.jaws) return solids;
  for (const double side : {-1.0, 1.0}) {
    Gripper::Solid jaw;
    jaw.size_mm = gripper.jaws->size_mm;
    jaw.T_tcp_solid.translation() =
        Eigen::Vector3d{side * (opening_mm + jaw.size_mm.x()) / 2, 0, gripper.jaws->beyond_mm - jaw.size_mm.z() / 2};
    solids.push_back(jaw);
  }
  return solids;
}
}  // namespace binpick::vision
