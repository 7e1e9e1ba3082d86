#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "base/frames.hpp"
#include "bench/scenes/parts.hpp"

namespace binpick::bench {
using ObjectPose = Transform<frame::Supply, frame::Object>;

/// What a scene is: a pile, how much of it is left, and the seed of what the scanner adds.
struct SceneId {
  std::uint64_t pile = 0;  ///< Seed; scenes of one pile belong together (bootstrap).
  double fill = 1;         ///< Share of its objects that is left; the top ones are gone.
  std::uint64_t noise = 0;
};

/// Scenes of a split differ from the other's in seeds and in fill levels.
struct Split {
  std::string_view name;
  std::uint64_t first_pile;
  std::uint64_t piles;
  std::vector<double> fills;
  std::size_t scenes() const { return piles * fills.size(); }
  /// Neighbouring numbers differ in pile and in fill level, so that a few scenes are a fair sample.
  SceneId scene(std::size_t number) const;
};
/// "tune" (40 scenes), "last" (20, the last one or two objects of these piles), "report" (100) or "figure7" (3000);
/// null: no such split.
const Split* find_split(std::string_view name);
/// The same; throws where there is no such split, and says which there are.
const Split& split_named(std::string_view name);

/// The settled pile, lowest object first. Kept in `folder` as a list of poses; settled anew where that has none.
std::vector<ObjectPose> settled_pile(const ScenePart& part, std::uint64_t seed, const std::string& folder);
/// What is left of a pile.
std::vector<ObjectPose> taken_down(std::vector<ObjectPose> pile, double fill);
}  // namespace binpick::bench
