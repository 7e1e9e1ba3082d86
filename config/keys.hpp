#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "config/config.hpp"

/// The table of keys. Everything that is said about a key is said here once: validation, the comments of
/// cell.example.toml and part.example.toml, and docs/configuration.md all come from it.
namespace binpick::config {
enum class Type {
  Flag,
  Integer,
  Number,
  Text,
  Choice,     ///< One of `choices`.
  Endpoint,   ///< "host:port".
  CanBus,     ///< "can0" or "cannelloni://HOST:PORT".
  Addresses,  ///< List of IP addresses.
  Path,       ///< Of a file or folder, relative to the folder of the file it stands in.
  Vector,     ///< Three numbers.
  Transform,  ///< { xyz_mm = [x, y, z], rpy_deg = [W, P, R] }.
};

/// When a changed value takes effect after a reload.
enum class Change { NextCycle, Restart };

/// What is said of a key. Texts are TOML literals as they stand in a file.
struct KeyFacts {
  const char* name = "";
  Type type = Type::Text;
  const char* unit = "";                ///< "mm", "deg" …, empty: none.
  double min = 0, max = 0;              ///< Of numbers and of each number in a vector.
  const char* only_for = "";            ///< "scanner.model = lps36, lps36hi": elsewhere the key is a mistake.
  bool in_example = false;              ///< With `only_for`: the example file is of that kind.
  const char* default_value = nullptr;  ///< Absent: required, or (optional) derived, as `help` says.
  bool required = false;                ///< With `only_for`: there only.
  const char* example = nullptr;        ///< In the example file; absent: the default.
  const char* sample = nullptr;         ///< Of a key whose default is derived: stands in the example file as a comment.
  Change change = Change::NextCycle;
  std::vector<const char*> choices = {};
  const char* help = "";
};

/// Values in degrees and milliseconds that the program keeps in radians and on the clock.
struct InRadians {
  double* rad;
};
struct InRadiansIfGiven {
  std::optional<double>* rad;
};
/// A choice by its index in `choices`.
struct Chosen {
  std::function<void(std::size_t)> set;
  std::function<std::size_t()> get;
};

/// Where a value goes.
using Slot = std::variant<bool*, int*, std::uint8_t*, std::uint16_t*, std::size_t*, double*, std::optional<int>*,
                          std::optional<double>*, std::string*, std::vector<std::string>*, Angle*, InRadians,
                          InRadiansIfGiven, std::chrono::milliseconds*, std::chrono::seconds*, Duration*,
                          Eigen::Vector3d*, Eigen::Isometry3d*, Chosen>;

template <class Target>
struct Key {
  KeyFacts facts;
  Slot (*slot)(Target&);
};

/// [name], or [[name]] where it repeats; the empty name: before any header.
template <class Target>
struct Section {
  const char* name;
  const char* help;
  std::vector<Key<Target>> keys;
};

/// A [[part]] entry before its part file is read.
struct RecipeEntry {
  Recipe recipe;
  std::string file;
};
/// [symmetry] of a PART.toml: the group by its kind, before its rotations are made.
struct SymmetryEntry {
  std::size_t kind = 0;  ///< Index of the choice.
  int fold = 2;
  Eigen::Vector3d axis = Eigen::Vector3d::UnitZ();
  Eigen::Vector3d flip_axis = Eigen::Vector3d::UnitX();
  Eigen::Vector3d centre_mm = Eigen::Vector3d::Zero();
};
/// [gripper] of a PART.toml, and one [[gripper_body]].
struct GripperEntry {
  vision::Gripper::Jaws jaws;
};
struct GripperBodyEntry {
  vision::Gripper::Solid solid;
};

const std::vector<Section<Config>>& cell_sections();
const Section<Supply>& supply_section();       ///< [[supply]] of a cell file.
const Section<RecipeEntry>& recipe_section();  ///< [[part]] of a cell file.
const Section<Part>& part_section();           ///< Head of a PART.toml.
const Section<SymmetryEntry>& symmetry_section();
const Section<vision::Grasp>& grasp_section();  ///< [[grasp]] of a PART.toml.
const Section<GripperEntry>& gripper_section();
const Section<GripperBodyEntry>& gripper_body_section();

/// A slot's value as text, to tell whether two are the same.
std::string text_of(const Slot& slot);
}  // namespace binpick::config
