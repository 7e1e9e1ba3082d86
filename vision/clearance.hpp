#pragma once

#include <vector>

#include "vision/grasp.hpp"
#include "vision/surroundings.hpp"
#include "vision/swept.hpp"

/// Whether gripper and held part pass through what stands around an object.
namespace binpick::vision {
/// The room that a gripper takes up around one grasp: in with open jaws, and closing (or opening within a bore).
/// `T_a_tcp`: the tcp at the grasp, in any frame a.
std::vector<Swept> room_of(const Gripper& gripper, const Grasp& grasp, const Eigen::Isometry3d& T_a_tcp,
                           double grown_mm);
/// What sweeps it, tcp frame: jaws as thick as they move, then the body.
std::vector<Gripper::Solid> sweepers_of(const Gripper& gripper, const Grasp& grasp);

/// Whether a body meets the surface of a part; `body` in the part's frame.
bool meets(const Swept& body, const Mesh& part);
/// Whether the gripper hits the part itself on the way in. `slack_mm`: so deep it may.
bool hits_part(const Gripper& gripper, const Grasp& grasp, const Mesh& part, double slack_mm);

struct Contact {
  Obstacle with = Obstacle::None;
  double depth_mm = 0;  ///< How far that reaches into the room.
};

/// Of a body with walls, floor and heights. `holes`: what was not measured counts as well.
Contact contact(const Swept& body, const Heights& heights, const SupplyBox& supply, bool holes = true);
/// Of the first of them that has one.
Contact contact(const std::vector<Swept>& room, const Heights& heights, const SupplyBox& supply);

/// Of a part that is lifted along `up` (length 1, up) for `way_mm`, from where `lower_side` was drawn on the
/// picture with this origin. Contact that it has from the beginning does not count.
Contact contact_of_part(const Template& lower_side, const Eigen::Vector2d& origin_mm, const Eigen::Vector3d& up,
                        double way_mm, double slack_mm, const Heights& heights, const SupplyBox& supply);
}  // namespace binpick::vision
