#pragma once

#include <vector>

#include "bench/scenes/parts.hpp"
#include "bench/scenes/scanners.hpp"

namespace binpick::bench {
/// What there is to be found of one object.
struct Truth {
  Transform<frame::Supply, frame::Object> T_supply_object;
  /// Points that the ideal scanner measures on it in the scene, over those it would measure on it alone, without supply
  /// and neighbours: what lies in the shadow of a wall counts as hidden.
  double visible = 0;
  /// The ideal scanner measures enough of what tells near-symmetric poses apart (ScenePart::tells). Else no method can
  /// know the pose: it is not to be found, and whoever finds it in any of its near-symmetric poses is neither right nor
  /// wrong.
  bool told = true;
};

/// In the order of the world's objects.
std::vector<Truth> truths_of(const ScenePart& part, const ClassSetting& setting, const std::vector<Profile>& lines,
                             const std::vector<std::vector<Echo>>& ideal, const emulators::World& world);
}  // namespace binpick::bench
