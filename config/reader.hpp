#pragma once

#include <algorithm>
#include <map>
#include <set>
#include <string>
#include <vector>

#include "config/document.hpp"
#include "config/findings.hpp"
#include "config/keys.hpp"

/// Reads sections of a document into values, by their table of keys.
namespace binpick::config {
/// Where the values of one section stand, for findings across keys.
struct Places {
  Place header;
  bool is_there = true;                              ///< The section stands in the file, and is one.
  std::map<std::string, Place, std::less<>> values;  ///< Only keys that stand in the file and were good.
  std::set<std::string, std::less<>> bad;            ///< That stand in the file and were not.

  bool given(std::string_view key) const { return values.find(key) != values.end(); }
  const Place& of(std::string_view key) const {
    const auto it = values.find(key);
    return it == values.end() ? header : it->second;
  }
};

/// Checks `value` against `facts` and puts it into `slot`; what is wrong becomes a finding about `name` ("plc.listen").
bool read_value(const Value& value, const KeyFacts& facts, const std::string& name, const Slot& slot,
                Findings& findings);
/// Puts the table's default into `slot`; nothing for a key without one.
void set_default(const KeyFacts& facts, const Slot& slot);
/// "key "tilt" is unknown in [reach]; did you mean …".
void report_unknown(const Member& member, const std::string& where, const std::vector<std::string>& names,
                    Findings& findings);
void report_missing(const KeyFacts& facts, const std::string& name, const std::string& where, const Place& header,
                    Findings& findings);

struct ReadContext {
  Findings& findings;
  const std::set<std::string>& damaged_keys;
};

/// `skip`: members that belong to others (subsections of a file's head).
template <class Target>
Places read_section(const Value& table, const Section<Target>& section, Target& target, ReadContext context,
                    const std::vector<std::string>& skip = {}, bool repeated = false) {
  const std::string prefix = *section.name == '\0' ? "" : std::string{section.name} + ".";
  const std::string where = *section.name == '\0' ? "the head of the file"
                            : repeated            ? "[[" + std::string{section.name} + "]]"
                                                  : "[" + std::string{section.name} + "]";
  Places places;
  places.header = table.place;
  std::vector<std::string> names;
  for (const auto& key : section.keys) names.emplace_back(key.facts.name);
  for (const auto& member : table.members) {
    const auto key = std::find_if(section.keys.begin(), section.keys.end(),
                                  [&](const Key<Target>& k) { return member.key == k.facts.name; });
    if (key == section.keys.end() && std::find(skip.begin(), skip.end(), member.key) == skip.end())
      report_unknown(member, where, names, context.findings);
  }
  for (const auto& key : section.keys) {
    const Slot slot = key.slot(target);
    set_default(key.facts, slot);
    const Member* member = table.find(key.facts.name);
    if (member == nullptr) {
      if (key.facts.required && *key.facts.only_for == '\0' && !context.damaged_keys.contains(key.facts.name))
        report_missing(key.facts, prefix + key.facts.name, where, table.place, context.findings);
    } else if (read_value(member->value, key.facts, prefix + key.facts.name, slot, context.findings)) {
      places.values.emplace(key.facts.name, member->value.place);
    } else {
      places.bad.emplace(key.facts.name);
    }
  }
  return places;
}
}  // namespace binpick::config
