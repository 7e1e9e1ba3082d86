#include "bench/scenes/parts.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "base/check.hpp"

namespace binpick::bench {
namespace {
using vision::ScannerClass;
using Kind = vision::Symmetry::Kind;

struct Row {
  ScannerClass scanner;
  std::string_view name;
  float scale;  ///< Of the part's own size.
  int pile;
  Kind symmetry;
  std::size_t order;
};
constexpr std::array kRows{
    Row{ScannerClass::Lps36Hi, "contact_bridge", 1, 45, Kind::Finite, 2},
    Row{ScannerClass::Lps36Hi, "stamped_plate", 1, 30, Kind::None, 1},
    Row{ScannerClass::Lps36Hi, "nozzle", 1, 36, Kind::Revolution, 1},
    Row{ScannerClass::Lps36Hi, "keyed_shaft", 1, 45, Kind::None, 1},
    Row{ScannerClass::Lps36, "contact_bridge", 1, 60, Kind::Finite, 2},
    Row{ScannerClass::Lps36, "stamped_plate", 1.7F, 30, Kind::None, 1},
    Row{ScannerClass::Lps36, "box_section", 1, 30, Kind::Finite, 4},
    Row{ScannerClass::Lps36, "keyed_shaft", 2, 40, Kind::None, 1},
    Row{ScannerClass::Lms400, "gear_shaft", 1, 40, Kind::Revolution, 1},
    Row{ScannerClass::Lms400, "track_link", 1, 36, Kind::None, 1},
    Row{ScannerClass::Lms400, "steering_wheel", 1, 20, Kind::Finite, 3},
    Row{ScannerClass::Lms400, "box_section", 2.5F, 26, Kind::Finite, 4},
    Row{ScannerClass::Lms400, "nozzle", 5, 30, Kind::Revolution, 1},
};
}  // namespace

std::vector<std::string> part_names(ScannerClass scanner) {
  std::vector<std::string> names;
  for (const Row& row : kRows)
    if (row.scanner == scanner) names.emplace_back(row.name);
  return names;
}

ClassSetting setting_of(const ScenePart& part) {
  ClassSetting setting = setting_of(part.scanner);
  if (part.supply_mm) setting.supply_mm = *part.supply_mm;
  return setting;
}

ScenePart scene_part(ScannerClass scanner, std::string_view name) {
  if (name == kDeepPart) {
    ScenePart deep = scene_part(scanner, "track_link");
    deep.pile = 80;
    deep.supply_mm = Eigen::Vector3d{800, 600, 500};
    return deep;
  }
  const auto row = std::ranges::find_if(kRows, [&](const Row& r) { return r.scanner == scanner && r.name == name; });
  BINPICK_CHECK(row != kRows.end());
  const auto& examples = emulators::example_part_names();
  ScenePart part;
  part.body = std::ranges::find(examples, name) != examples.end() ? emulators::example_part(name) : own_part(name);
  part.scanner = scanner;
  part.pile = row->pile;
  part.symmetry = row->symmetry;
  part.order = row->order;
  for (auto& v : part.body.mesh.vertices_mm) v *= row->scale;
  for (auto& piece : part.body.pieces)
    for (auto& v : piece.points_mm) v *= row->scale;
  part.body.mesh = vision::cleaned(part.body.mesh);
  if (name == "keyed_shaft")
    part.tells = [scale = static_cast<double>(row->scale)](const Eigen::Vector3d& p) {
      return p.head<2>().norm() < 6.5 * scale && p.z() > -23 * scale && p.z() < 11 * scale;
    };
  return part;
}
}  // namespace binpick::bench
