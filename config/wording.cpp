#include "config/wording.hpp"

#include <charconv>
#include <cmath>

namespace binpick::config {
namespace {
constexpr std::size_t kCommentColumns = 100;

/// "# …" lines of at most kCommentColumns.
std::string comment(const std::string& text) {
  std::string out;
  std::string line = "#";
  std::size_t at = 0;
  while (at < text.size()) {
    const std::size_t end = std::min(text.find(' ', at), text.size());
    const std::string word = text.substr(at, end - at);
    if (line.size() + 1 + word.size() > kCommentColumns) {
      out += line + "\n";
      line = "#";
    }
    line += " " + word;
    at = end + 1;
  }
  return out + line + "\n";
}

/// "ms, 0 … 60000, default 3000; in force after a restart".
std::string figures(const KeyFacts& facts) {
  std::string text = type_text(facts);
  const auto add = [&](const std::string& more) { text += ", " + more; };
  if (facts.type == Type::Integer || facts.type == Type::Number || facts.type == Type::Vector) add(range_text(facts));
  if (facts.type == Type::Choice) text = choices_text(facts);
  if (facts.required) add("required");
  if (*facts.only_for != '\0') add("for " + std::string{facts.only_for} + " only");
  if (facts.default_value != nullptr) add("default " + std::string{facts.default_value});
  if (facts.change == Change::Restart) text += "; a change needs a restart";
  return text;
}

template <class Target>
std::string example_of(const Section<Target>& section, bool repeated) {
  std::string text = comment(section.help);
  if (*section.name == '\0') text += "\n";
  if (*section.name != '\0')
    text += repeated ? "[[" + std::string{section.name} + "]]\n" : "[" + std::string{section.name} + "]\n";
  for (const auto& key : section.keys) {
    text += comment(std::string{key.facts.help} + " (" + figures(key.facts) + ")");
    const bool live = (key.facts.example != nullptr || key.facts.default_value != nullptr) &&
                      (*key.facts.only_for == '\0' || key.facts.in_example);
    text += std::string{live ? "" : "# "} + key.facts.name + " = " + example_text(key.facts) + "\n";
  }
  return text;
}

std::string only_for(const KeyFacts& facts) {
  return *facts.only_for == '\0' ? "" : "(`" + std::string{facts.only_for} + "`) ";
}

std::string escaped(std::string text) {
  for (std::size_t at = 0; (at = text.find('|', at)) != std::string::npos; at += 2) text.insert(at, "\\");
  return text;
}

template <class Target>
std::string table_of(const Section<Target>& section, const std::string& title, const std::string& file) {
  std::string text = "### " + title + "\n\n" + section.help + " Stands in " + file + ".\n\n";
  text += "| key | value | default | change takes effect | meaning |\n|---|---|---|---|---|\n";
  for (const auto& key : section.keys) {
    const KeyFacts& f = key.facts;
    std::string value = f.type == Type::Choice ? choices_text(f) : type_text(f);
    if (f.type == Type::Integer || f.type == Type::Number || f.type == Type::Vector) value += ", " + range_text(f);
    const std::string fallback = f.required                   ? "required"
                                 : f.default_value != nullptr ? "`" + std::string{f.default_value} + "`"
                                                              : "derived";
    text += "| `" + std::string{f.name} + "` | " + escaped(value) + " | " + fallback + " | " +
            (f.change == Change::Restart ? "restart" : "next cycle") + " | " + only_for(f) + escaped(f.help) + " |\n";
  }
  return text + "\n";
}

/// In a PART.toml a change takes effect when the part is trained and the cell reloaded; the column would mislead.
template <class Target>
std::string part_table_of(const Section<Target>& section, const std::string& title) {
  std::string text =
      "### " + title + "\n\n" + section.help + "\n\n| key | value | default | meaning |\n|---|---|---|---|\n";
  for (const auto& key : section.keys) {
    const KeyFacts& f = key.facts;
    std::string value = f.type == Type::Choice ? choices_text(f) : type_text(f);
    if (f.type == Type::Integer || f.type == Type::Number || f.type == Type::Vector) value += ", " + range_text(f);
    const std::string fallback = f.required                   ? "required"
                                 : f.default_value != nullptr ? "`" + std::string{f.default_value} + "`"
                                                              : "derived";
    text += "| `" + std::string{f.name} + "` | " + escaped(value) + " | " + fallback + " | " + escaped(f.help) + " |\n";
  }
  return text + "\n";
}
}  // namespace

std::string number_text(double value) {
  if (std::isnan(value)) return "nan";
  if (std::isinf(value)) return value < 0 ? "-inf" : "inf";
  char text[40];
  const auto end = std::abs(value) < 1e15 ? std::to_chars(text, text + sizeof text, value, std::chars_format::fixed)
                                          : std::to_chars(text, text + sizeof text, value);
  return {text, end.ptr};
}

std::string range_text(const KeyFacts& facts) { return number_text(facts.min) + " … " + number_text(facts.max); }

std::string choices_text(const KeyFacts& facts) {
  std::string text;
  for (const char* choice : facts.choices) text += (text.empty() ? "\"" : ", \"") + std::string{choice} + "\"";
  return text;
}

std::string type_text(const KeyFacts& facts) {
  const std::string unit = *facts.unit == '\0' ? "" : std::string{" of "} + facts.unit;
  switch (facts.type) {
    case Type::Flag:
      return "true or false";
    case Type::Integer:
      return "whole number" + unit;
    case Type::Number:
      return "number" + unit;
    case Type::Text:
      return "text";
    case Type::Choice:
      return "one of " + choices_text(facts);
    case Type::Endpoint:
      return "\"host:port\"";
    case Type::CanBus:
      return "interface or URL";
    case Type::Addresses:
      return "list of IP addresses";
    case Type::Path:
      return "path";
    case Type::Vector:
      return "three numbers" + unit;
    case Type::Transform:
      return "transform";
  }
  return "?";
}

std::string example_text(const KeyFacts& facts) {
  if (facts.example != nullptr) return facts.example;
  if (facts.default_value != nullptr) return facts.default_value;
  return facts.sample != nullptr ? facts.sample : "";
}

std::string example_cell() {
  std::string text =
      "# A cell: its devices, supplies and parts, every key with its meaning. Validate an edit with `binpick check`, "
      "put it\n"
      "# in force with `systemctl reload binpickd`. Paths are relative to this file's folder.\n"
      "# Written by config_docs from the table of keys (config/cell_keys.cpp); docs/configuration.md has the same as "
      "tables.\n";
  for (const auto& section : cell_sections()) text += "\n" + example_of(section, false);
  text += "\n" + example_of(supply_section(), true);
  text += "\n" + example_of(recipe_section(), true);
  return text;
}

std::string example_part() {
  std::string text =
      "# A part, for `binpick train`. Paths are relative to this file's folder.\n"
      "# Written by config_docs from the table of keys (config/part_keys.cpp).\n\n";
  text += example_of(part_section(), false);
  text += "\n" + example_of(gripper_section(), false);
  text += "\n" + example_of(gripper_body_section(), true);
  text += "\n" + example_of(grasp_section(), true);
  std::string symmetry = example_of(symmetry_section(), false);
  // Found from the mesh when absent, so the example has it as a comment.
  text += "\n";
  for (std::size_t at = 0; at < symmetry.size();) {
    const std::size_t end = symmetry.find('\n', at);
    const std::string line = symmetry.substr(at, end - at);
    text += (line.starts_with('#') ? line : "# " + line) + "\n";
    at = end + 1;
  }
  return text;
}

std::string reference() {
  std::string text = R"(# Configuration

Written by `config_docs` from the tables of keys in `config/`; change those, not this page.

A cell is one TOML file (`/etc/binpick/cell.toml`; start from `config/cell.example.toml`), a part is another
(`config/part.example.toml`), named by the cell file. `binpick check CELL.toml` validates both and shows all mistakes at once.
A key that is not known is a mistake: a typing error never silently becomes a default. Paths are relative to the folder of
the file they stand in.

**Edits in production.** `systemctl reload binpickd` reads and validates the whole file. A good one is in force from the next
cycle on; keys that need a restart are named in the log and by an alarm, and keep their old value until then. A bad one is
refused with an alarm, each finding stands in the log, and the cell runs on with the old configuration. At start a bad file
ends the daemon with exit status 78; systemd does not restart it then.

**Transforms** are written `{ xyz_mm = [x, y, z], rpy_deg = [W, P, R] }`; the rotation is R = Rz(R)·Ry(P)·Rx(W), turns about
the fixed axes x, then y, then z, in degrees. `T_a_b` maps coordinates in b to coordinates in a: it is where b stands in a.

## The cell file

)";
  for (const auto& section : cell_sections())
    text += table_of(section, "[" + std::string{section.name} + "]", "the cell file, once");
  text += table_of(supply_section(), "[[supply]]", "the cell file, at least once");
  text += table_of(recipe_section(), "[[part]]", "the cell file, at least once");
  text += R"(Rules across keys:

- `scanner.start_deg` + `scanner.range_deg` is at most 125, the end of the scanner's field of view.
- `pivot.setpoint_horizon_ms` is at least twice `pivot.sample_period_ms`.
- `pivot.module_id` is at most 31 where `pivot.protocol` is powercube.
- `pivot.can_listen_port` is for cannelloni only.
- `detection.deadline_ms` is shorter than `plc.detect_timeout_ms`.
- `plc.heartbeat_timeout_ms` is 0 or at least 100.
- `plc.role = "client"` needs `plc.address` and takes no `plc.listen`; `"server"` takes no `plc.address`.
- `plc.listen` and `robot.listen` differ in their port.
- A sweep covers at least 1 degree, takes less than `plc.scan_timeout_ms` and gives at least 20 profiles.
- Where the robot carries the scanner, `robot.listen` and `robot.pose_address` (ur) or `robot.pose_listen` (fanuc, kawasaki)
  are given, and `supply.path_timeout_ms` is less than `plc.scan_timeout_ms` and `robot.silence_max_s`.
- In the middle of a sweep the scanner's middle ray goes down into the supply, or at most half its size beside it.
- `supply.size_mm` is at least 10 mm along x and y; `supply.locate` needs walls of at least 20 mm.
- `reach.radius_max_mm` is 0 or more than `reach.axis_min_mm`.
- Ids differ among supplies and among parts.
- Part files and their meshes exist; a part that is picked has at least one grasp.

## The part file

)";
  text += part_table_of(part_section(), "Head");
  text += part_table_of(gripper_section(), "[gripper]");
  text += part_table_of(gripper_body_section(), "[[gripper_body]]");
  text += part_table_of(grasp_section(), "[[grasp]]");
  text += part_table_of(symmetry_section(), "[symmetry]");
  text += R"(Rules across keys:

- Where there is `[gripper]`, each grasp has `holding_mm`; `opening_mm` and `holding_mm` are at most
  `gripper.opening_max_mm`, and differ. Without it a grasp has neither.
- The first two of `gripper_body.size_mm` are the same for a cylinder.
)";
  return text;
}
}  // namespace binpick::config
