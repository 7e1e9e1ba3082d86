#include <gtest/gtest.h>

#include "config/keys.hpp"
#include "config/wording.hpp"
#include "tests/unit/config/cell_files.hpp"

namespace binpick::config {
namespace {
constexpr const char* kCure = "stale: run build/release/config/config_docs . and commit what it writes";

template <class Target>
void expect_told(const Section<Target>& section) {
  std::vector<std::string> names;
  for (const auto& key : section.keys) {
    SCOPED_TRACE(std::string{section.name} + "." + key.facts.name);
    EXPECT_EQ(std::count(names.begin(), names.end(), key.facts.name), 0);
    names.emplace_back(key.facts.name);
    EXPECT_GT(std::string{key.facts.help}.size(), 5U);
    const bool numeric =
        key.facts.type == Type::Integer || key.facts.type == Type::Number || key.facts.type == Type::Vector;
    EXPECT_EQ(numeric, key.facts.min < key.facts.max);
    EXPECT_EQ(key.facts.type == Type::Choice, !key.facts.choices.empty());
    EXPECT_FALSE(key.facts.required && key.facts.default_value != nullptr);
    EXPECT_TRUE(key.facts.example != nullptr || key.facts.default_value != nullptr || key.facts.sample != nullptr ||
                key.facts.type == Type::Choice);
    // A key names its unit, the way an integrator reads it.
    const std::string unit = key.facts.unit;
    const bool suffixed = unit == "mm" || unit == "deg" || unit == "ms" || unit == "s";
    EXPECT_TRUE(!suffixed || std::string{key.facts.name}.ends_with("_" + unit));
  }
}
}  // namespace

TEST(Generated, ExampleCellIsWhatTheTableSays) {
  EXPECT_TRUE(read_text(in_source("config/cell.example.toml")) == example_cell())
      << "config/cell.example.toml is " << kCure;
}
TEST(Generated, ExamplePartIsWhatTheTableSays) {
  EXPECT_TRUE(read_text(in_source("config/part.example.toml")) == example_part())
      << "config/part.example.toml is " << kCure;
}
TEST(Generated, ReferenceIsWhatTheTableSays) {
  EXPECT_TRUE(read_text(in_source("docs/configuration.md")) == reference()) << "docs/configuration.md is " << kCure;
}

TEST(Generated, TheTableIsWhole) {
  for (const auto& section : cell_sections()) expect_told(section);
  expect_told(supply_section());
  expect_told(recipe_section());
  expect_told(part_section());
  expect_told(symmetry_section());
  expect_told(grasp_section());
  expect_told(gripper_section());
  expect_told(gripper_body_section());
}
}  // namespace binpick::config
