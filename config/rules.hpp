#pragma once

#include <optional>
#include <set>
#include <string>
#include <vector>

#include "config/reader.hpp"

/// Rules across keys; ranges of single keys stand in the key table.
namespace binpick::config {
/// Where the sections of a cell file stand, in the order of `cell_sections()`, and its entries.
struct CellPlaces {
  std::map<std::string, Places, std::less<>> sections;
  std::vector<Places> supplies;
  std::vector<Places> parts;
  std::set<std::string> damaged_keys;  ///< In lines that could not be read: not missing.

  const Place& of(const std::string& section, const std::string& key) const { return sections.at(section).of(key); }
  bool bad(const std::string& section, const std::string& key) const { return sections.at(section).bad.contains(key); }
  /// False where a key was given but bad, or its section is: then a rule about it would only echo that.
  bool given(const std::string& section, const std::string& key) const { return sections.at(section).given(key); }
};

/// Whether a key is for this cell, by its `only_for`; nothing where what it depends on is bad or missing itself.
std::optional<bool> is_for(const KeyFacts& facts, Config config, const CellPlaces& at);
/// Values that were bad hold their default while this runs, so that one mistake is not told twice.
void check_rules(const Config& config, const CellPlaces& places, Findings& findings);

/// Those of where things stand: mounts, supplies, reach. Called by check_rules().
void check_geometry(const Config& config, const CellPlaces& places, Findings& findings);

/// Where [gripper], [[gripper_body]] and [[grasp]] of a part file stand, in the order of the part's own.
struct GripPlaces {
  std::optional<Places> gripper;
  std::vector<Places> bodies;
  std::vector<Places> grasps;
};
/// Rules across the grasps of a part and its gripper.
void check_grips(const Part& part, const GripPlaces& places, Findings& findings);
/// Makes the group that [symmetry] describes; false with a finding when it describes none.
bool make_symmetry(const SymmetryEntry& entry, const Places& places, Findings& findings, vision::Symmetry& symmetry);
}  // namespace binpick::config
