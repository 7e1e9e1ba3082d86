#pragma once

#include <cstdint>
#include <string>

#include "daemon/cycle/cell_data.hpp"
#include "drivers/robot/session.hpp"
#include "tests/emulators/world/world.hpp"
#include "vision/knowledge_base.hpp"
#include "vision/symmetry.hpp"

/// Scenes with known truth in the tests' supplies.
namespace binpick::support {
inline const Eigen::Vector3d kLatticeBox_mm{1000, 800, 500};  ///< Of an LMS 400's cell.
inline const Eigen::Vector3d kSmallBox_mm{300, 300, 120};     ///< Of an LPS 36's.
emulators::World empty_scene();
/// `count` objects dropped and settled.
emulators::World scene_of(const std::string& part, int count, std::uint64_t seed,
                          const Eigen::Vector3d& supply_mm = kLatticeBox_mm);
/// A block of 300 × 200 × 100 mm flat on the floor, its middle at the supply's origin, turned by 20 degrees about z.
/// Nobody's part.
emulators::World scene_with_block();

/// Distance to the nearest object's true pose, symmetry-aware.
vision::PoseDistance error_to_nearest(const emulators::World& world, const vision::KnowledgeBase& part,
                                      const Transform<frame::Supply, frame::Object>& T_supply_object);
/// What the gripper does at the grasp pose: takes the object that is nearest to it away. False when none is within
/// reach.
bool take_nearest(emulators::World& world, const daemon::CellData& data, const drivers::robot::Pick& pick);
}  // namespace binpick::support
