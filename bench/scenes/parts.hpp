#pragma once

#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "bench/scenes/classes.hpp"
#include "tests/emulators/world/example_parts.hpp"
#include "vision/knowledge_base.hpp"

namespace binpick::bench {
/// A part as one class sees it.
struct ScenePart {
  emulators::ExamplePart body;  ///< Name, mesh and convex pieces, scaled for the class.
  vision::ScannerClass scanner = vision::ScannerClass::Lps36;
  int pile = 20;                                                   ///< Objects that are thrown into the supply.
  vision::Symmetry::Kind symmetry = vision::Symmetry::Kind::None;  ///< What the class's scanner can tell.
  std::size_t order = 1;                                           ///< Of a finite group.
  std::optional<Eigen::Vector3d> supply_mm;                        ///< Another one than its class's.
  /// What tells the near-symmetric poses of the part apart, object frame; empty: it has none. Where the scanner sees
  /// nothing of it, nobody can know the pose: see truth.hpp.
  std::function<bool(const Eigen::Vector3d& p_object_mm)> tells;
};

/// Of its class, over its own supply if it has one.
ClassSetting setting_of(const ScenePart& part);

/// Beside the parts that the classes are judged by: 80 track links in a deep supply (800 × 600 × 500 mm), LMS 400.
inline constexpr std::string_view kDeepPart = "track_link_deep";

/// Names of the parts that a class is judged by.
std::vector<std::string> part_names(vision::ScannerClass scanner);
/// A name that is not the class's is a mistake of the caller.
ScenePart scene_part(vision::ScannerClass scanner, std::string_view name);

/// Our own parts beside the example parts, at their smallest size; axis z.
/// * stamped_plate: 72 × 40, 2.4 thick, joggled by 6 mm, holes, one corner cut; no symmetry.
/// * box_section: hollow, 100 long, 50 × 40, wall 4; half turns about the three axes.
/// * nozzle: turned, 44 long, Ø 24, blind bore; revolution, its ends differ.
/// * keyed_shaft: 56 long, Ø 14 and Ø 11, keyway; nearly a revolution, told apart by the keyway only.
emulators::ExamplePart own_part(std::string_view name);
}  // namespace binpick::bench
