#include "tests/support/scenes.hpp"

#include <limits>
#include <numbers>

#include "tests/emulators/world/example_parts.hpp"
#include "tests/emulators/world/pile.hpp"

namespace binpick::support {
namespace {
/// The gripper takes an object whose centroid is not further from the tcp than the part is long.
constexpr double kGripReachDiameters = 0.6;
}  // namespace

emulators::World empty_scene() { return emulators::World{kLatticeBox_mm}; }

emulators::World scene_of(const std::string& part, int count, std::uint64_t seed, const Eigen::Vector3d& supply_mm) {
  return emulators::make_pile(emulators::example_part(part), count, supply_mm, seed);
}

emulators::World scene_with_block() {
  emulators::World world{kLatticeBox_mm};
  Transform<frame::Supply, frame::Object> T_supply_object;
  T_supply_object.iso.translation() = Eigen::Vector3d{0, 0, 50};
  T_supply_object.iso.rotate(Eigen::AngleAxisd{20 * std::numbers::pi / 180, Eigen::Vector3d::UnitZ()});
  world.add("block", std::make_shared<const emulators::RayMesh>(emulators::box_mesh({300, 200, 100})), T_supply_object);
  return world;
}

vision::PoseDistance error_to_nearest(const emulators::World& world, const vision::KnowledgeBase& part,
                                      const Transform<frame::Supply, frame::Object>& T_supply_object) {
  const double radius_mm = part.diameter_mm() / 2;
  vision::PoseDistance nearest{std::numeric_limits<double>::infinity(), std::numbers::pi};
  for (const auto& object : world.objects()) {
    const auto distance =
        vision::pose_distance(T_supply_object.iso, object.T_supply_object.iso, part.symmetry(), radius_mm);
    if (distance.centroid_mm < nearest.centroid_mm) nearest = distance;
  }
  return nearest;
}

bool take_nearest(emulators::World& world, const daemon::CellData& data, const drivers::robot::Pick& pick) {
  const auto& part = data.knowledge_bases.at(pick.part_id - 1U);
  const auto& T_base_supply = data.config.supplies.front().T_base_supply;
  const Eigen::Vector3d tcp_supply_mm = (T_base_supply.inverse() * pick.T_base_grasp).iso.translation();
  double nearest_mm = kGripReachDiameters * part.diameter_mm();
  int taken = 0;
  for (const auto& object : world.objects()) {
    const double distance_mm = (object.T_supply_object * part.mesh().centroid_mm() - tcp_supply_mm).norm();
    if (distance_mm >= nearest_mm) continue;
    nearest_mm = distance_mm;
    taken = object.id;
  }
  return taken != 0 && world.remove(taken);
}
}  // namespace binpick::support
