#include <CLI/CLI.hpp>
#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <memory>
#include <string>
#include <unistd.h>

#include "config/config.hpp"
#include "daemon/cycle/cell_data.hpp"
#include "tools/commands.hpp"
#include "vision/mesh.hpp"

/// binpick check CELL.toml: everything that can be known without the devices, all findings at once.
namespace binpick::tools {
namespace {
namespace fs = std::filesystem;
using Findings = std::vector<config::Diagnostic>;

const char* name_of(plc::PoseConvention convention) {
  using enum plc::PoseConvention;
  return convention == UniversalRobots ? "ur" : convention == Fanuc ? "fanuc" : "kawasaki";
}

const char* name_of(drivers::robot::Dialect dialect) {
  using enum drivers::robot::Dialect;
  return dialect == UniversalRobots ? "ur" : dialect == Fanuc ? "fanuc" : "kawasaki";
}

void print_plc(const config::Config& cell) {
  const bool asked = cell.plc.role == plc::LineRole::Client;
  std::printf("  plc      %s %s (role %s), word order %s, poses as %s\n", asked ? "is asked at" : "connects to",
              cell.plc_line().c_str(), asked ? "client" : "server",
              cell.plc.word_order == plc::WordOrder::HighWordFirst ? "s7" : "logix", name_of(cell.plc.pose_convention));
}

void print_scanner(const config::Config& cell) {
  std::printf("  scanner  %s at %s", drivers::scanner::model_name(cell.scanner_options()).c_str(),
              cell.scanner_address.c_str());
  if (cell.scanner_model != config::ScannerModel::Lms400 && cell.scanner_listen_port != 0)
    std::printf(" to own port %u", unsigned{cell.scanner_listen_port});
  if (cell.carrier == config::Carrier::Pivot)
    std::printf(", on the pivot: %s module %u on %s\n", to_string(cell.pivot.protocol), unsigned{cell.pivot.module_id},
                cell.pivot_can.c_str());
  else
    std::printf(", on the robot\n");
}

void print_robot(const config::Config& cell) {
  if (cell.robot_listen.empty())
    std::printf("  robot    none: the PLC forwards the movement\n");
  else
    std::printf("  robot    connects to %s, dialect %s", cell.robot_listen.c_str(), name_of(cell.robot.dialect));
  if (cell.carrier == config::Carrier::Robot)
    std::printf("; its poses %s %s", cell.pose_listen.empty() ? "by RTDE from" : "as lines to",
                (cell.pose_listen.empty() ? cell.pose_address : cell.pose_listen).c_str());
  if (!cell.robot_listen.empty()) std::printf("\n");
}

void print_supply(const config::Config& cell, const config::Supply& supply) {
  std::printf("  supply   %u%s%s: %g x %g x %g mm, ", unsigned{supply.id}, supply.name.empty() ? "" : " ",
              supply.name.c_str(), supply.size_mm.x(), supply.size_mm.y(), supply.size_mm.z());
  if (cell.carrier == config::Carrier::Pivot)
    std::printf("sweep %g ... %g deg, %g deg/s\n", supply.sweep_start.in_deg(), supply.sweep_end.in_deg(),
                Angle::rad(supply.sweep_speed_rad_s).in_deg());
  else
    std::printf("scan path %u, %g s at most\n", unsigned{supply.scan_path}, in_s(supply.path_timeout));
}

/// What a good cell file says, in a few lines.
void print_summary(const config::Config& cell) {
  std::printf("%s: good\n  cell     %s\n", cell.path.c_str(), cell.name.c_str());
  print_plc(cell);
  print_scanner(cell);
  print_robot(cell);
  for (const auto& supply : cell.supplies) print_supply(cell, supply);
  for (const auto& recipe : cell.recipes)
    std::printf("  part     %u %s: %zu grasp%s\n", unsigned{recipe.id}, recipe.part.options.name.c_str(),
                recipe.part.grasps.size(), recipe.part.grasps.size() == 1 ? "" : "s");
}

/// A folder that the daemon writes into. `made`: it makes it itself where there is none.
struct Folder {
  const char* key;
  const std::string& path;
  bool made;
};

/// What cannot be right for any user is a finding; where only this one may not write, the daemon's may, and it is said.
void check_folder(const config::Config& cell, const Folder& folder, Findings& findings, Findings& notes) {
  if (folder.path.empty()) return;
  const auto about = [&](const std::string& text) { return cell.finding(folder.key, folder.key + (": " + text)); };
  std::error_code failure;
  fs::path at = folder.path;
  while (folder.made && !fs::exists(at, failure) && !failure && at.has_relative_path()) {
    if (!at.has_filename()) at = at.parent_path();  // "state/"
    at = at.has_parent_path() ? at.parent_path() : fs::path{"."};
  }
  const bool is_folder = fs::is_directory(at, failure);
  if (failure && failure != std::errc::no_such_file_or_directory && failure != std::errc::not_a_directory)
    notes.push_back(about("cannot be looked at by you (" + failure.message() + "); the daemon's user must be able to"));
  else if (!is_folder && fs::exists(at, failure))
    findings.push_back(about(at.string() + " is no folder; name one"));
  else if (!is_folder)
    findings.push_back(about("there is no folder " + folder.path + "; make it, writable for the daemon's user"));
  else if (::access(at.c_str(), W_OK) != 0 && errno == EACCES)
    notes.push_back(about(at.string() + " may not be written by you; the daemon's user must be able to"));
  else if (::access(at.c_str(), W_OK) != 0)
    findings.push_back(about(at.string() + " cannot be written: " + std::strerror(errno) + "; name another folder"));
}

/// Training refuses what is larger.
constexpr double kPartMaxMm = 5000;

/// A part's box, shortest edge first.
using Extents = std::array<double, 3>;

Extents extents_of(const vision::Mesh& mesh) {
  Eigen::AlignedBox3f box;
  for (const auto& vertex : mesh.vertices_mm) box.extend(vertex);
  const Eigen::Vector3d sizes = box.sizes().cast<double>();
  Extents sorted{sizes.x(), sizes.y(), sizes.z()};
  std::sort(sorted.begin(), sorted.end());
  return sorted;
}

/// Upright, if need be, and looking out as far as the walls are high.
bool fits(const Extents& part, const config::Supply& supply) {
  const auto [narrow, wide] = std::minmax(supply.size_mm.x(), supply.size_mm.y());
  return part[0] <= narrow && part[1] <= wide &&
         part[2] <= Eigen::Vector3d{narrow, wide, 2 * supply.size_mm.z()}.norm();
}

/// A mesh in the wrong unit shows by what it is to lie in.
void check_sizes(const config::Config& cell, bool tells_of_bad_meshes, Findings& findings) {
  std::vector<bool> fits_one(cell.supplies.size(), false);
  const std::size_t before = findings.size();
  for (std::size_t i = 0; i < cell.recipes.size(); ++i) {
    const config::Recipe& recipe = cell.recipes[i];
    const auto about = [&](const std::string& text) {
      findings.push_back(
          cell.finding("part[" + std::to_string(i) + "].file", "part " + std::to_string(recipe.id) + ": " + text));
    };
    const auto mesh = vision::load_mesh(recipe.part.mesh_path, recipe.part.mesh_unit_mm);
    if (!mesh) {
      if (tells_of_bad_meshes) about(mesh.error().text);
      return;
    }
    const Extents edges = extents_of(*mesh);
    bool fits_somewhere = false;
    for (std::size_t k = 0; k < cell.supplies.size(); ++k)
      if (fits(edges, cell.supplies[k])) fits_one[k] = fits_somewhere = true;
    char size[80];
    std::snprintf(size, sizeof size, "its mesh measures %.4g x %.4g x %.4g mm", edges[2], edges[1], edges[0]);
    if (edges[2] > kPartMaxMm)
      about(size + std::string{"; correct mesh_unit in "} + recipe.part.path);
    else if (!fits_somewhere)
      about(size + std::string{" and fits into no supply; correct mesh_unit in "} + recipe.part.path +
            ", or size_mm of the supply");
  }
  for (std::size_t k = 0; findings.size() == before && k < fits_one.size(); ++k)
    if (!fits_one[k])
      findings.push_back(cell.finding("supply[" + std::to_string(k) + "].size_mm",
                                      "supply.size_mm: none of the parts fits into it; correct it (mm)"));
}

int refuse(const Findings& findings) {
  for (const auto& finding : findings) std::printf("%s\n", to_string(finding).c_str());
  std::printf("%zu finding%s\n", findings.size(), findings.size() == 1 ? "" : "s");
  return 2;
}

int check(const std::string& path, bool without_knowledge) {
  const auto cell = config::load(path);
  if (!cell) return refuse(cell.error());
  Findings findings, notes;
  check_folder(*cell, {"cell.state_dir", cell->state_dir, true}, findings, notes);
  check_folder(*cell, {"cell.picture_dir", cell->picture_dir, false}, findings, notes);
  check_folder(*cell, {"record.dir", cell->record.dir, true}, findings, notes);
  check_sizes(*cell, without_knowledge, findings);
  if (!without_knowledge) {
    const auto opened = daemon::open_knowledge_bases(*cell, config::MeshFile::Needed);
    if (!opened) findings.insert(findings.end(), opened.error().begin(), opened.error().end());
  }
  if (!findings.empty()) return refuse(findings);
  print_summary(*cell);
  if (without_knowledge) std::printf("  note     knowledge bases were not opened\n");
  for (const auto& note : notes) std::printf("  note     %s\n", note.message.c_str());
  return 0;
}
}  // namespace

void add_check(CLI::App& app, int& exit_status) {
  auto* command = app.add_subcommand(
      "check", "Validates a cell file, its part files and their knowledge bases; all findings at once.");
  struct Arguments {
    std::string cell;
    bool without_knowledge = false;
  };
  auto arguments = std::make_shared<Arguments>();
  command->add_option("CELL.toml", arguments->cell, "the cell file")->required();
  command->add_flag("--without-knowledge", arguments->without_knowledge,
                    "leave the knowledge bases alone: they are not trained yet, or lie elsewhere");
  command->callback([arguments, &exit_status] { exit_status = check(arguments->cell, arguments->without_knowledge); });
}
}  // namespace binpick::tools
