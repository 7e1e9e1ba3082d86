#include "bench/production/setup.hpp"

#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <numbers>
#include <stdexcept>

#include "config/config.hpp"
#include "vision/knowledge_base.hpp"

namespace binpick::bench {
namespace {
namespace fs = std::filesystem;

constexpr double kTravel_mm = 1500, kVertical_mm = 500, kLast_mm = 120;
constexpr double kSpeed_mm_s = 1000, kAcceleration_mm_s2 = 3000, kSlow_mm_s = 250, kGripper_s = 0.3;

/// Bins stand up to 80 mm and 10 degrees off; what is measured of that errs a little.
constexpr const char* kLocated = "locate = true\nlocate_offset_max_mm = 84\nlocate_turn_max_deg = 10.5\n";

/// From rest to rest.
double move_s(double way_mm) { return way_mm / kSpeed_mm_s + kSpeed_mm_s / kAcceleration_mm_s2; }

void train_once(const std::string& part_file, const std::string& knowledge_base, int threads) {
  if (const auto there = vision::KnowledgeBase::open(knowledge_base)) return;
  const auto part = config::load_part(part_file);
  if (!part) throw std::runtime_error(to_string(part.error().front()));
  const auto mesh = vision::load_mesh(part->mesh_path, part->mesh_unit_mm);
  if (!mesh) throw std::runtime_error(mesh.error().text);
  std::printf("training %s\n", part->options.name.c_str());
  std::fflush(stdout);
  const auto trained = vision::train(*mesh, part->options, {}, nullptr, threads);
  if (!trained) throw std::runtime_error(trained.error().text);
  if (const auto saved = trained->save(knowledge_base); !saved) throw std::runtime_error(saved.error().text);
}

std::string cell_text(const ProductionPart& part, const std::string& part_file, const std::string& knowledge_base,
                      int threads) {
  char text[2048];
  std::string scanner = "model = \"" + part.scanner + "\"\naddress = \"127.0.0.1:2111\"\n";
  if (part.scanner == "lms400") {
    std::snprintf(text, sizeof text, "start_deg = %g\nrange_deg = %g\n", 90 - part.line_deg, 2 * part.line_deg);
    scanner += text;
  }
  std::snprintf(text, sizeof text, R"([cell]
name = "production of %s"

[plc]
listen = "127.0.0.1:1502"
allow = []

[pivot]
can = "cannelloni://127.0.0.1:20000"
T_base_pivot = { xyz_mm = [1200, 0, %g], rpy_deg = [0, 90, 0] }

[scanner]
%sT_pivot_scanner = { xyz_mm = [60, 0, 0], rpy_deg = [180, -90, 0] }

[robot]
listen = "127.0.0.1:5002"
allow = []

[reach]
tilt_max_deg = 50
unmeasured = "last"

[picks]
per_scan = 4

[detection]
threads = %d

[[supply]]
id = 1
name = "bin"
size_mm = [%g, %g, %g]
T_base_supply = { xyz_mm = [1200, 0, 0], rpy_deg = [0, 0, 0] }
sweep_start_deg = %g
sweep_end_deg = %g
sweep_speed_deg_s = %g
%s
[[part]]
id = 1
file = "%s"
knowledge_base = "%s"
)",
                part.name.c_str(), part.height_mm, scanner.c_str(), threads, part.supply_mm.x(), part.supply_mm.y(),
                part.supply_mm.z(), -part.sweep_deg, part.sweep_deg, part.sweep_deg_s, part.is_located ? kLocated : "",
                part_file.c_str(), knowledge_base.c_str());
  return text;
}
}  // namespace

const std::vector<ProductionPart>& production_parts() {
  static const std::vector<ProductionPart> parts{
      {"gear_shaft", "lms400", {600, 500, 300}, 30, 1500, 16, 16, 13, 0.03 * 190, 4},
      {"track_link", "lms400", {1000, 800, 300}, 24, 1860, 19, 16, 16, 0.03 * 230, 4},
      {"steering_wheel", "lms400", {1000, 800, 400}, 10, 1860, 19, 16, 16, 0.03 * 370, 4},
      {"contact_bridge", "lps36", {300, 300, 120}, 40, 560, 19, 10, 0, 3, 3},
  };
  return parts;
}

ProductionPart to_be_located(ProductionPart part) {
  constexpr double kDegree = std::numbers::pi / 180, kBeyond_mm = 80 + 40, kScannerBelowPivot_mm = 60;
  part.is_located = true;
  if (part.scanner == "lms400")
    part.line_deg = 35;
  else
    part.height_mm = 800;  // a light section is as wide as it is far away
  const double reach_mm =
      part.supply_mm.y() / 2 * std::cos(10 * kDegree) + part.supply_mm.x() / 2 * std::sin(10 * kDegree) + kBeyond_mm;
  part.sweep_deg =
      std::ceil(std::atan2(reach_mm, part.height_mm - kScannerBelowPivot_mm - part.supply_mm.z()) / kDegree);
  return part;
}

RobotModel robot_model() {
  const double slow_s = kLast_mm / kSlow_mm_s;
  return {move_s(kTravel_mm) + move_s(kVertical_mm) + slow_s, kGripper_s, slow_s + move_s(kVertical_mm),
          2 * move_s(kTravel_mm) + kGripper_s};
}

emulators::RobotOptions robot_options(const RobotModel& model) {
  emulators::RobotOptions options;
  options.approach = from_s(model.approach_s);
  options.grasp = from_s(model.grasp_s);
  options.retreat = from_s(model.retreat_s);
  return options;
}

std::shared_ptr<const daemon::CellData> load_production_cell(const ProductionPart& part, const std::string& folder,
                                                             int threads, const std::string& records) {
  const fs::path base = fs::absolute(folder) / "cells";
  const std::string part_file = emulators::write_example_part(part.name, base.string());
  const std::string knowledge_base = (base / (part.name + ".kb")).string();
  train_once(part_file, knowledge_base, threads);
  const std::string cell_file = (base / (part.name + (part.is_located ? ".located" : "") + ".cell.toml")).string();
  std::ofstream file{cell_file};
  file << cell_text(part, part_file, knowledge_base, threads);
  if (!records.empty()) file << "\n[record]\ndir = \"" << fs::absolute(records).string() << "\"\n";
  file.close();
  auto loaded = daemon::load_cell(cell_file);
  if (loaded) return *loaded;
  std::string text;
  for (const auto& finding : loaded.error()) text += finding + "\n";
  throw std::runtime_error(text);
}
}  // namespace binpick::bench
