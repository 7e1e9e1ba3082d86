#include <filesystem>
#include <functional>
#include <limits>
#include <map>
#include <set>

#include "config/config.hpp"
#include "config/document.hpp"
#include "config/reader.hpp"
#include "config/rules.hpp"

namespace binpick::config {
namespace {
namespace fs = std::filesystem;
/// More entries than any cell has; a PLC's lists are shorter.
constexpr std::size_t kEntriesMax = 256;

/// `path` as it is to be opened: relative to the folder of `file`.
std::string resolved(const std::string& file, const std::string& path) {
  if (path.empty()) return path;
  return (fs::path{file}.parent_path() / path).string();
}

/// What stands nowhere is said of the file as a whole.
constexpr Place kWholeFile{};

std::string bracketed(const std::string& name, bool repeated) {
  return repeated ? "[[" + name + "]]" : "[" + name + "]";
}

bool is_list_of_tables(const Value& value) {
  return value.kind == Value::Kind::List && !value.items.empty() &&
         std::all_of(value.items.begin(), value.items.end(),
                     [](const Value& v) { return v.kind == Value::Kind::Table; });
}

/// The section `name` as a table, or nullptr with a finding when it is something else.
const Value* as_section(const Member& member, Findings& findings) {
  if (member.value.kind == Value::Kind::Table) return &member.value;
  findings.add(member.key_place, is_list_of_tables(member.value)
                                     ? "[[" + member.key + "]] stands for one thing only; write [" + member.key + "]"
                                     : member.key + " is a section; write [" + member.key + "] and its keys below");
  return nullptr;
}

/// The entries of [[name]]; findings for what is none.
std::vector<const Value*> as_entries(const Member& member, Findings& findings) {
  std::vector<const Value*> entries;
  if (member.value.kind == Value::Kind::Table) {
    findings.add(member.value.place,
                 "[" + member.key + "] is a list; write it in double brackets, [[" + member.key + "]]");
  } else if (!is_list_of_tables(member.value)) {
    findings.add(member.key_place,
                 member.key + " is a list of sections; write [[" + member.key + "]] and its keys below");
  } else if (member.value.items.size() > kEntriesMax) {
    findings.add(member.value.items[kEntriesMax].place,
                 "more than " + std::to_string(kEntriesMax) + " entries of [[" + member.key + "]]; remove some");
  } else {
    for (const auto& item : member.value.items) entries.push_back(&item);
  }
  return entries;
}

/// Members of the root that are no section. `sections`: their names; `home`: the section that has a key of a name.
/// Returns the sections that were meant: they are not missing, too.
std::set<std::string> report_strangers(const Document& document, const std::vector<std::string>& sections,
                                       const std::map<std::string, std::string>& homes, Findings& findings) {
  std::set<std::string> meant;
  for (const auto& member : document.root.members) {
    if (std::find(sections.begin(), sections.end(), member.key) != sections.end()) continue;
    const bool is_section = member.value.kind == Value::Kind::Table || is_list_of_tables(member.value);
    const auto home = homes.find(member.key);
    std::string remedy;
    if (!is_section && home != homes.end()) {
      remedy = "put it under " + home->second;
    } else if (const auto near = nearest(member.key, sections); !near.empty()) {
      remedy = "did you mean \"" + near + "\"?";
      if (is_section) meant.insert(near);
    } else {
      for (const auto& name : sections) remedy += (remedy.empty() ? "there are: " : ", ") + name;
    }
    findings.add(member.key_place, (is_section ? "unknown section \"" : "unknown key \"") + printable(member.key) +
                                       (is_section ? "\"; " : "\" before any section; ") + remedy);
  }
  return meant;
}

/// Parses one part document. Findings are about the part file; `part` is whole only when there are none.
std::vector<Diagnostic> read_part(Document document, Part& part, MeshFile mesh = MeshFile::Needed) {
  if (!document.usable) return document.findings;
  if (const Member* supply = document.root.find("supply"); supply != nullptr && document.root.find("mesh") == nullptr)
    return {Findings{document.file, document.lines}.at(
        supply->key_place, "this is a cell file; give one of the part files that it names under [[part]]")};
  part.path = document.file;
  part.text = std::move(document.text);
  Findings findings{document.file, document.lines};
  const ReadContext context{findings, document.damaged_keys};
  const Places head =
      read_section(document.root, part_section(), part, context, {"grasp", "gripper", "gripper_body", "symmetry"});
  if (part.options.name.empty()) part.options.name = fs::path{document.file}.stem().string();
  if (head.given("mesh")) {
    part.mesh_path = resolved(document.file, part.mesh_path);
    std::error_code failure;
    if (mesh == MeshFile::Needed && !fs::is_regular_file(part.mesh_path, failure))
      findings.add(head.of("mesh"), "mesh: there is no file " + printable(part.mesh_path) +
                                        "; give its path from the folder of this file");
  }
  GripPlaces grips;
  if (const Member* member = document.root.find("gripper"))
    if (const Value* table = as_section(*member, findings)) {
      GripperEntry entry;
      grips.gripper = read_section(*table, gripper_section(), entry, context);
      part.gripper.emplace().jaws = entry.jaws;
    }
  if (const Member* member = document.root.find("gripper_body"))
    for (const Value* entry : as_entries(*member, findings)) {
      GripperBodyEntry body;
      grips.bodies.push_back(read_section(*entry, gripper_body_section(), body, context, {}, true));
      if (!part.gripper) part.gripper.emplace();
      part.gripper->body.push_back(body.solid);
    }
  if (const Member* member = document.root.find("grasp"))
    for (const Value* entry : as_entries(*member, findings)) {
      vision::Grasp grasp;
      grips.grasps.push_back(read_section(*entry, grasp_section(), grasp, context, {}, true));
      part.grasps.push_back(grasp);
    }
  check_grips(part, grips, findings);
  if (const Member* member = document.root.find("symmetry"))
    if (const Value* table = as_section(*member, findings)) {
      SymmetryEntry entry;
      const Places places = read_section(*table, symmetry_section(), entry, context);
      vision::Symmetry symmetry;
      if (make_symmetry(entry, places, findings, symmetry)) part.options.symmetry = symmetry;
      if (places.given("centre_mm")) part.options.symmetry_centre_mm = entry.centre_mm;
    }
  auto all = std::move(document.findings);
  for (auto& finding : findings.take()) all.push_back(std::move(finding));
  return all;
}

/// Where part files come from.
struct PartSource {
  std::function<Document(const std::string& path)> open;
  MeshFile mesh = MeshFile::Needed;
};

/// Reads the part files of the recipes; each file's own findings once.
std::vector<Diagnostic> read_parts(const std::string& cell_file, const std::vector<std::string>& files,
                                   const PartSource& source, Config& config, const CellPlaces& places,
                                   Findings& findings) {
  std::vector<Diagnostic> of_parts;
  std::map<std::string, Part> known;
  for (std::size_t i = 0; i < config.recipes.size(); ++i) {
    if (!places.parts[i].given("file")) continue;
    const std::string path = resolved(cell_file, files[i]);
    if (const auto it = known.find(path); it != known.end()) {
      config.recipes[i].part = it->second;
      continue;
    }
    Document document = source.open(path);
    if (!document.usable && !document.findings.empty() && document.findings.front().line == 0) {
      findings.add(places.parts[i].of("file"),
                   "part.file: " + printable(path) + " " + document.findings.front().message);
      continue;
    }
    Part part;
    auto part_findings = read_part(std::move(document), part, source.mesh);
    if (part_findings.empty() && part.grasps.empty())
      findings.add(places.parts[i].of("file"),
                   "part.file: " + printable(path) + " has no [[grasp]], so nothing can be picked; add one");
    for (auto& finding : part_findings) of_parts.push_back(std::move(finding));
    known.emplace(path, part);
    config.recipes[i].part = std::move(part);
  }
  return of_parts;
}

/// Names of all sections of a cell file, and which of them has a key.
std::pair<std::vector<std::string>, std::map<std::string, std::string>> names_of_cell() {
  std::vector<std::string> sections;
  std::map<std::string, std::string> homes;
  for (const auto& section : cell_sections()) {
    sections.emplace_back(section.name);
    for (const auto& key : section.keys) homes.emplace(key.facts.name, bracketed(section.name, false));
  }
  sections.emplace_back(supply_section().name);
  for (const auto& key : supply_section().keys) homes.emplace(key.facts.name, bracketed(supply_section().name, true));
  sections.emplace_back(recipe_section().name);
  for (const auto& key : recipe_section().keys) homes.emplace(key.facts.name, bracketed(recipe_section().name, true));
  return {sections, homes};
}

CellPlaces read_cell(const Document& document, Config& config, std::vector<std::string>& part_files,
                     const std::set<std::string>& misspelt, Findings& findings) {
  const ReadContext context{findings, document.damaged_keys};
  CellPlaces places;
  places.damaged_keys = document.damaged_keys;
  std::vector<const Section<Config>*> absent;
  for (const auto& section : cell_sections()) {
    const Member* member = document.root.find(section.name);
    const Value* table = member == nullptr ? nullptr : as_section(*member, findings);
    if (table != nullptr) {
      places.sections[section.name] = read_section(*table, section, config, context);
      continue;
    }
    for (const auto& key : section.keys) set_default(key.facts, key.slot(config));
    places.sections[section.name].header = kWholeFile;
    places.sections[section.name].is_there = false;
    if (member == nullptr && !misspelt.contains(section.name)) absent.push_back(&section);
  }
  // Which of their keys are required may depend on sections that come later.
  for (const auto* section : absent) {
    std::string required, condition;
    for (const auto& key : section->keys)
      if (key.facts.required && is_for(key.facts, config, places).value_or(false)) {
        required += (required.empty() ? "" : ", ") + std::string{key.facts.name};
        condition = key.facts.only_for;
      }
    if (required.empty()) continue;
    std::string message = std::string{"section ["} + section->name + "] is missing; add it, with " + required;
    const bool on_pivot = condition.find("scanner.carrier") == 0;
    if (on_pivot && places.sections["scanner"].is_there && !places.given("scanner", "carrier"))
      findings.add(places.sections["scanner"].header,
                   message + "; or, if the robot carries the scanner, write carrier = \"robot\" in [scanner]");
    else
      findings.add(kWholeFile, std::move(message));
  }
  const auto missing = [&](const char* name, const char* what) {
    if (!misspelt.contains(name))
      findings.add(kWholeFile, std::string{"there is no [["} + name + "]]; add one for each " + what);
  };
  if (const Member* member = document.root.find("supply")) {
    for (const Value* entry : as_entries(*member, findings)) {
      Supply supply;
      places.supplies.push_back(read_section(*entry, supply_section(), supply, context, {}, true));
      config.supplies.push_back(std::move(supply));
    }
  } else {
    missing("supply", "charge carrier");
  }
  if (const Member* member = document.root.find("part")) {
    for (const Value* entry : as_entries(*member, findings)) {
      RecipeEntry recipe;
      places.parts.push_back(read_section(*entry, recipe_section(), recipe, context, {}, true));
      recipe.recipe.knowledge_base = resolved(document.file, recipe.recipe.knowledge_base);
      config.recipes.push_back(std::move(recipe.recipe));
      part_files.push_back(std::move(recipe.file));
    }
  } else {
    missing("part", "part that the PLC can ask for");
  }
  return places;
}

std::map<std::string, Diagnostic, std::less<>> places_by_name(const CellPlaces& places, const Findings& findings) {
  std::map<std::string, Diagnostic, std::less<>> named;
  const auto add = [&](const std::string& section, const Places& of) {
    for (const auto& [key, place] : of.values) named.emplace(section + "." + key, findings.at(place));
  };
  const auto numbered = [](const char* name, std::size_t i) { return name + ("[" + std::to_string(i) + "]"); };
  for (const auto& [name, section] : places.sections) add(name, section);
  for (std::size_t i = 0; i < places.supplies.size(); ++i) add(numbered("supply", i), places.supplies[i]);
  for (std::size_t i = 0; i < places.parts.size(); ++i) add(numbered("part", i), places.parts[i]);
  return named;
}

Expected<Config, std::vector<Diagnostic>> load_document(const std::string& path, Document document,
                                                        const PartSource& parts = {open}) {
  if (!document.usable) return unexpected(std::move(document.findings));
  if (const Member* mesh = document.root.find("mesh"); mesh != nullptr && document.root.find("supply") == nullptr)
    return unexpected(std::vector{Findings{document.file, document.lines}.at(
        mesh->key_place, "this is a part file; give the cell file that names it under [[part]]")});
  Config config;
  config.path = path;
  Findings findings{document.file, document.lines};
  const auto [sections, homes] = names_of_cell();
  const auto misspelt = report_strangers(document, sections, homes, findings);
  std::vector<std::string> part_files;
  const CellPlaces places = read_cell(document, config, part_files, misspelt, findings);
  check_rules(config, places, findings);
  const auto of_parts = read_parts(path, part_files, parts, config, places, findings);

  config.stands_at = places_by_name(places, findings);
  auto all = findings.take();
  all.insert(all.end(), document.findings.begin(), document.findings.end());
  // What is said of the file as a whole (line 0) comes last.
  const auto order = [](const Diagnostic& d) { return d.line == 0 ? std::numeric_limits<int>::max() : d.line; };
  std::stable_sort(all.begin(), all.end(), [&](const auto& a, const auto& b) { return order(a) < order(b); });
  all.insert(all.end(), of_parts.begin(), of_parts.end());
  if (!all.empty()) return unexpected(std::move(all));

  config.text = std::move(document.text);
  config.state_dir = resolved(path, config.state_dir);
  config.record.dir = resolved(path, config.record.dir);
  config.picture_dir = resolved(path, config.picture_dir);
  for (const auto& recipe : config.recipes) config.plc.part_ids.push_back(recipe.id);
  for (const auto& supply : config.supplies) config.plc.supply_ids.push_back(supply.id);
  return config;
}

Expected<Part, std::vector<Diagnostic>> load_part_document(Document document) {
  Part part;
  auto findings = read_part(std::move(document), part);
  if (!findings.empty()) return unexpected(std::move(findings));
  return part;
}
}  // namespace

bool operator==(const Supply& a, const Supply& b) {
  return a.id == b.id && a.name == b.name && a.size_mm == b.size_mm &&
         a.T_base_supply.iso.matrix() == b.T_base_supply.iso.matrix() && a.locate == b.locate &&
         a.place_limits.offset_mm == b.place_limits.offset_mm && a.place_limits.turn_rad == b.place_limits.turn_rad &&
         a.sweep_start == b.sweep_start && a.sweep_end == b.sweep_end && a.sweep_speed_rad_s == b.sweep_speed_rad_s &&
         a.scan_path == b.scan_path && a.path_timeout == b.path_timeout;
}

Expected<Config, std::vector<Diagnostic>> load(const std::string& path, MeshFile mesh) {
  return load_document(path, open(path), {open, mesh});
}
Expected<Part, std::vector<Diagnostic>> load_part(const std::string& path) { return load_part_document(open(path)); }
Expected<Config, std::vector<Diagnostic>> load_text(const std::string& path, std::string_view text) {
  return load_document(path, parse(path, text));
}
Expected<Part, std::vector<Diagnostic>> load_part_text(const std::string& path, std::string_view text) {
  return load_part_document(parse(path, text));
}
Expected<Config, std::vector<Diagnostic>> load_texts(const FileText& cell, std::span<const FileText> parts) {
  const auto find = [&](const std::string& path) {
    const auto part = std::find_if(parts.begin(), parts.end(), [&](const FileText& p) { return p.path == path; });
    return part == parts.end() ? refused(path, "is not among the files that were kept") : parse(path, part->text);
  };
  return load_document(cell.path, parse(cell.path, cell.text), {find, MeshFile::OfNoMatter});
}

Diagnostic Config::finding(const std::string& key, std::string message) const {
  Diagnostic finding;
  if (const auto place = stands_at.find(key); place != stands_at.end()) finding = place->second;
  finding.file = path;
  finding.message = std::move(message);
  return finding;
}

drivers::scanner::Options Config::scanner_options() const {
  if (scanner_model == ScannerModel::Lms400) return lms400;
  drivers::lps36::Options options = lps36;
  options.hi = scanner_model == ScannerModel::Lps36Hi;
  options.profile_timeout = lms400.profile_timeout;
  if (manual_exposure_us) options.manual_exposure = std::chrono::microseconds(*manual_exposure_us);
  return options;
}

drivers::robot::PoseSource::Options Config::pose_options() const {
  if (robot.dialect != drivers::robot::Dialect::UniversalRobots)
    return drivers::robot::PoseStreamOptions{.dialect = robot.dialect, .T_flange_tcp = T_flange_tcp};
  drivers::rtde::Options options;
  // Nobody's tcp is the flange itself and written down as such: the controller is asked.
  if (!T_flange_tcp.iso.isApprox(Eigen::Isometry3d::Identity())) options.T_flange_tcp = T_flange_tcp;
  return options;
}

std::vector<std::string> needs_restart(const Config& running, const Config& edited) {
  Config before = running;
  Config after = edited;
  std::vector<std::string> names;
  for (const auto& section : cell_sections())
    for (const auto& key : section.keys)
      if (key.facts.change == Change::Restart && text_of(key.slot(before)) != text_of(key.slot(after)))
        names.push_back(std::string{section.name} + "." + key.facts.name);
  return names;
}
}  // namespace binpick::config
