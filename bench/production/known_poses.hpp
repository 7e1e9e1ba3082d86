#pragma once

#include <optional>
#include <string>
#include <vector>

#include "tests/emulators/world/grip.hpp"

/// What a gripper could take if every pose were known: the ceiling of what a cell can leave over, and whether an answer
/// "not reachable" was true.
namespace binpick::bench {
struct KnownCell {
  vision::Gripper gripper;
  std::vector<vision::Grasp> grasps;
  vision::Symmetry symmetry;
  double tilt_max_rad = 0.7;
  emulators::GripRules rules;
};

/// A grasp of this object that the exact check passes, in any pose that the symmetry allows.
std::optional<emulators::GripMotion> free_grasp(const emulators::LivingPile& pile, int object, const KnownCell& cell);
/// How many of the objects there have one.
int with_free_grasp(const emulators::LivingPile& pile, const KnownCell& cell);
/// Takes one object after the other, the highest first; returns how many are left that nobody can take.
int empty_by_known_poses(emulators::LivingPile& pile, const KnownCell& cell);
/// For each grasp of the object that is steep enough, what comes of it.
std::vector<std::string> why_not(const emulators::LivingPile& pile, int object, const KnownCell& cell);
}  // namespace binpick::bench
