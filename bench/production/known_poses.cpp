#include "bench/production/known_poses.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace binpick::bench {
namespace {
using emulators::GripMotion;
using emulators::GripResult;
using emulators::LivingPile;

/// Poses of the object, in its own frame, that look the same.
std::vector<Eigen::Isometry3d> same_poses(const vision::Symmetry& symmetry) {
  std::vector<Eigen::Matrix3d> turns = symmetry.rotations;
  if (symmetry.kind != vision::Symmetry::Kind::None && symmetry.kind != vision::Symmetry::Kind::Finite) {
    turns.clear();
    for (int k = 0; k < 24; ++k)
      turns.push_back(Eigen::AngleAxisd{k * std::numbers::pi / 12, symmetry.axis}.toRotationMatrix());
  }
  std::vector<Eigen::Isometry3d> same;
  for (const Eigen::Matrix3d& R : turns) {
    Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
    T.linear() = R;
    T.translation() = symmetry.centre_mm - R * symmetry.centre_mm;
    same.push_back(T);
  }
  return same;
}
}  // namespace

std::optional<GripMotion> free_grasp(const LivingPile& pile, int object, const KnownCell& cell) {
  const Eigen::Isometry3d T_supply_object = pile.world().find(object)->T_supply_object.iso;
  for (const Eigen::Isometry3d& T_object_same : same_poses(cell.symmetry))
    for (const vision::Grasp& grasp : cell.grasps) {
      const Eigen::Isometry3d T = T_supply_object * T_object_same * grasp.T_object_tcp.iso;
      if (-T.linear()(2, 2) < std::cos(cell.tilt_max_rad)) continue;
      const GripMotion motion{{T * Eigen::Translation3d{0, 0, -grasp.approach_mm}}, {T}};
      if (!stands_free(pile.world(), cell.gripper, grasp, motion.T_supply_grasp, cell.rules)) continue;
      const GripResult result = grip(pile, cell.gripper, cell.grasps, cell.symmetry, motion, cell.rules);
      if (result.kind == GripResult::Kind::Taken && result.object == object) return motion;
    }
  return std::nullopt;
}

std::vector<std::string> why_not(const LivingPile& pile, int object, const KnownCell& cell) {
  std::vector<std::string> reasons;
  const Eigen::Isometry3d T_supply_object = pile.world().find(object)->T_supply_object.iso;
  for (const Eigen::Isometry3d& T_object_same : same_poses(cell.symmetry))
    for (const vision::Grasp& grasp : cell.grasps) {
      const Eigen::Isometry3d T = T_supply_object * T_object_same * grasp.T_object_tcp.iso;
      if (-T.linear()(2, 2) < std::cos(cell.tilt_max_rad)) continue;
      const GripMotion motion{{T * Eigen::Translation3d{0, 0, -grasp.approach_mm}}, {T}};
      reasons.push_back(grasp.name + ": " +
                        to_string(grip(pile, cell.gripper, cell.grasps, cell.symmetry, motion, cell.rules)));
    }
  return reasons;
}

int with_free_grasp(const LivingPile& pile, const KnownCell& cell) {
  int count = 0;
  for (const auto& object : pile.world().objects()) count += free_grasp(pile, object.id, cell).has_value();
  return count;
}

int empty_by_known_poses(LivingPile& pile, const KnownCell& cell) {
  for (bool takes = true; takes;) {
    takes = false;
    std::vector<std::pair<float, int>> order;
    for (const auto& object : pile.world().objects()) order.emplace_back(-object.box.max().z(), object.id);
    std::ranges::sort(order);
    for (const auto& [height, id] : order) {
      if (!free_grasp(pile, id, cell)) continue;
      pile.take(id);
      takes = true;
      break;
    }
  }
  return static_cast<int>(pile.world().objects().size());
}
}  // namespace binpick::bench
