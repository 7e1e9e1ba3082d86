#include "vision/calibration/calibrate.hpp"

#include <CLI/CLI.hpp>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <numbers>
#include <string>
#include <vector>

#include "base/rotation.hpp"
#include "config/config.hpp"
#include "daemon/cycle/record_codec.hpp"
#include "tools/commands.hpp"
#include "vision/calibration/pose_list.hpp"
#include "vision/file.hpp"
#include "vision/mesh.hpp"

/// binpick calibrate CELL.toml --sphere-mm D (--poses POSES.csv | SCAN…): where the scanner stands, from scans of a
/// sphere.
namespace binpick::tools {
namespace {
using vision::calibration::Answer;
using vision::calibration::Question;

struct CalibrateArguments {
  std::string cell, poses;
  std::vector<std::string> scans, parts;
  double sphere_mm = 0, tolerance_mm = 0;
};

int complain(int status, const std::string& text) {
  std::fprintf(stderr, "binpick: %s\n", text.c_str());
  return status;
}

/// What calibration may displace and turn a part by. It leaves the rest to detection and robot: errors add in squares,
/// so half of the tolerance takes an eighth of it away.
struct Tolerance {
  std::string name;
  double mm = 0, deg = 0;
};
constexpr double kShare = 0.5;

/// A few millimetres and degrees, as the trade asks for; of large parts that a LMS 400 sees, a share of the diameter.
Expected<Tolerance, std::string> tolerance_of(const config::Part& part) {
  const auto mesh = vision::load_mesh(part.mesh_path, part.mesh_unit_mm);
  if (!mesh) return unexpected(mesh.error().text + "; or say what is needed with --tolerance-mm");
  const double diameter = mesh->diameter_mm();
  const bool large = part.options.scanner ? *part.options.scanner == vision::ScannerClass::Lms400 : diameter >= 150;
  return large ? Tolerance{part.path, 0.03 * diameter, 4} : Tolerance{part.path, 3, 3};
}

Expected<std::vector<Tolerance>, std::string> tolerances(const CalibrateArguments& arguments,
                                                         const config::Config& cell) {
  if (arguments.tolerance_mm > 0) return std::vector{Tolerance{"--tolerance-mm", arguments.tolerance_mm, 180}};
  std::vector<config::Part> parts;
  for (const std::string& path : arguments.parts) {
    auto part = config::load_part(path);
    if (!part) return unexpected(path + " is not a good part file; see all findings with: binpick train " + path);
    parts.push_back(std::move(*part));
  }
  if (parts.empty())
    for (const config::Recipe& recipe : cell.recipes) parts.push_back(recipe.part);
  std::vector<Tolerance> out;
  for (const config::Part& part : parts) {
    auto tolerance = tolerance_of(part);
    if (!tolerance) return unexpected(tolerance.error());
    out.push_back(std::move(*tolerance));
  }
  return out;
}

/// The scan of a record, of a cell whose scanner is carried as this one's.
Expected<vision::calibration::SphereScan, std::string> read_scan(const std::string& path, bool on_pivot) {
  auto record = daemon::read_record(path);
  if (!record) return unexpected(record.error().text);
  if (!record->scan || record->scan->profiles.empty())
    return unexpected(path + ": the record has no scan; take one that was made by a sweep");
  vision::calibration::SphereScan scan;
  scan.name = path;
  for (drivers::sweep::RegisteredProfile& registered : record->scan->profiles) {
    const Angle* angle = std::get_if<Angle>(&registered.carrier);
    if ((angle != nullptr) != on_pivot)
      return unexpected(path + ": the " + (on_pivot ? "robot" : "pivot") +
                        " carried the scanner in this scan, the cell "
                        "file says the " +
                        (on_pivot ? "pivot" : "robot"));
    scan.profiles.push_back({angle != nullptr ? vision::calibration::pivot_turned(*angle)
                                              : std::get<Transform<frame::Base, frame::Flange>>(registered.carrier).iso,
                             std::move(registered.profile.x_mm), std::move(registered.profile.z_mm)});
  }
  return scan;
}

/// A grid through every supply's inside.
std::vector<Eigen::Vector3d> places_in(const config::Config& cell) {
  std::vector<Eigen::Vector3d> places;
  for (const config::Supply& supply : cell.supplies)
    for (int i = 0; i < 5; ++i)
      for (int k = 0; k < 5; ++k)
        for (int l = 0; l < 3; ++l)
          places.push_back(supply.T_base_supply *
                           supply.size_mm.cwiseProduct(Eigen::Vector3d{i / 4.0 - 0.5, k / 4.0 - 0.5, l / 2.0}));
  return places;
}

/// All that is asked, or what is wrong with it.
Expected<Question, std::string> read_question(const CalibrateArguments& arguments, const config::Config& cell) {
  const bool on_pivot = cell.carrier == config::Carrier::Pivot;
  Question question;
  question.sphere_radius_mm = arguments.sphere_mm / 2;
  question.present.mount =
      on_pivot ? vision::calibration::on_pivot(cell.mount) : vision::calibration::on_flange(cell.T_flange_scanner);
  if (on_pivot) question.places_mm = places_in(cell);

  std::vector<vision::calibration::PoseList::Row> rows;
  if (on_pivot) {
    if (arguments.poses.empty() || !arguments.scans.empty())
      return unexpected(
          std::string{"the pivot carries the scanner: name the scans in --poses POSES.csv, with where the "
                      "robot held the sphere in each; see docs/calibration.md"});
    const auto bytes = vision::read_file(arguments.poses);
    if (!bytes) return unexpected(bytes.error());
    auto list = vision::calibration::parse_pose_list(
        std::string_view(reinterpret_cast<const char*>(bytes->data()), bytes->size()), arguments.poses);
    if (!list) return unexpected(list.error());
    question.present.sphere_known = list->places_only;
    rows = std::move(list->rows);
    const auto folder = std::filesystem::path{arguments.poses}.parent_path();
    for (auto& row : rows) row.scan = (folder / row.scan).string();
  } else {
    if (!arguments.poses.empty())
      return unexpected(
          std::string{"the robot carries the scanner and its scans have the poses: leave --poses out and "
                      "name the scans"});
    for (const std::string& path : arguments.scans) rows.push_back({path});
  }
  for (const auto& row : rows) {
    auto scan = read_scan(row.scan, on_pivot);
    if (!scan) return unexpected(scan.error());
    scan->T_base_holder = row.T_base_holder;
    question.scans.push_back(std::move(*scan));
  }
  return question;
}

void print_transform(const char* name, const Eigen::Isometry3d& T) {
  const Eigen::Vector3d xyz = T.translation(), rpy = to_wpr_deg(T.linear());
  std::printf("%s = { xyz_mm = [%.3f, %.3f, %.3f], rpy_deg = [%.4f, %.4f, %.4f] }\n", name, xyz.x(), xyz.y(), xyz.z(),
              rpy.x(), rpy.y(), rpy.z());
}

void print_answer(const CalibrateArguments& arguments, const Question& question, const Answer& answer,
                  const std::vector<Tolerance>& tolerances) {
  std::printf("points  off when left out\n");
  for (const auto& pose : answer.poses)
    std::printf("%6zu  %8.2f mm  %s\n", pose.points, pose.error_mm, pose.name.c_str());
  std::printf(
      "Each scan left out in turn, its sphere lies %.2f ± %.2f mm from where the others say (root mean square).\n",
      answer.left_out_mm, answer.left_out_se_mm);
  std::printf("Noise, 1 sd: %.2f mm of a point along its ray, %.2f mm per axis of the robot's poses.\n",
              answer.point_sd_mm, answer.place_sd_mm);
  const double turn_deg = answer.turn_95_rad * 180 / std::numbers::pi;
  std::printf(
      "Hold-out error: the new mount displaces points of the supply by %.2f ± %.2f mm; with 95 %% certainty by no "
      "more than %.2f mm and %.2f deg.\n",
      answer.hold_out_mm, answer.hold_out_se_mm, answer.hold_out_95_mm, turn_deg);
  std::printf("The mount of %s lies %.2f mm from it.\n", arguments.cell.c_str(),
              apart_mm(answer.mount, question.present.mount, answer.seen));
  for (const Tolerance& tolerance : tolerances) {
    const bool suffices = answer.hold_out_95_mm <= kShare * tolerance.mm && turn_deg <= kShare * tolerance.deg;
    std::printf("%s: %s: half of %.2f mm", tolerance.name.c_str(),
                suffices ? "it suffices" : "it does not suffice, more scans make it better", tolerance.mm);
    if (tolerance.deg < 180) std::printf(" and %.0f deg", tolerance.deg);
    std::printf(" is for calibration\n");
  }
  std::printf("\n");
  if (answer.mount.on_pivot) {
    std::printf("[pivot]\n");
    print_transform("T_base_pivot", answer.mount.T_base_root);
    std::printf("[scanner]\n");
    print_transform("T_pivot_scanner", answer.mount.T_carrier_scanner);
  } else {
    std::printf("[scanner]\n");
    print_transform("T_flange_scanner", answer.mount.T_carrier_scanner);
  }
}

int run(const CalibrateArguments& arguments) {
  const auto cell = config::load(arguments.cell);
  if (!cell)
    return complain(
        2, arguments.cell + " is not a good cell file; see all findings with: binpick check " + arguments.cell);
  const auto wanted = tolerances(arguments, *cell);
  if (!wanted) return complain(2, wanted.error());
  const auto question = read_question(arguments, *cell);
  if (!question) return complain(2, question.error());
  const auto answer = vision::calibration::calibrate(*question);
  if (!answer) return complain(1, answer.error());
  print_answer(arguments, *question, *answer, *wanted);
  return 0;
}
}  // namespace

void add_calibrate(CLI::App& app, int& exit_status) {
  auto arguments = std::make_shared<CalibrateArguments>();
  auto* command = app.add_subcommand(
      "calibrate",
      "Where the scanner stands, from scans of a sphere; prints lines for the cell file (docs/calibration.md).");
  command->add_option("CELL.toml", arguments->cell, "the cell file")->required();
  command->add_option("SCAN", arguments->scans, "records of scans that the robot carried the scanner on");
  command->add_option("--sphere-mm", arguments->sphere_mm, "the sphere's diameter, measured")
      ->required()
      ->check(CLI::Range(5.0, 1000.0));
  command->add_option("--poses", arguments->poses, "scanner on a pivot: a table of scans and of where the sphere was");
  auto* part =
      command->add_option("--part", arguments->parts, "does it suffice for this PART.toml; default: the cell's");
  command->add_option("--tolerance-mm", arguments->tolerance_mm, "does it suffice for picks of this tolerance")
      ->check(CLI::Range(0.01, 1000.0))
      ->excludes(part);
  command->callback([arguments, &exit_status] { exit_status = run(*arguments); });
}
}  // namespace binpick::tools
