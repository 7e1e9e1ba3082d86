#include "bench/scenes/noise_truth.hpp"

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <map>
#include <numbers>
#include <stdexcept>

#include "bench/scenes/precision.hpp"
#include "tests/emulators/scanner/phase_shift.hpp"
#include "tests/emulators/scanner/scanner_view.hpp"
#include "vision/cloud.hpp"

namespace binpick::bench {
namespace {
using Eigen::Vector3d;
using Cell = std::array<int, 3>;

constexpr double kCube_mm = 10, kRadius_mm = 30;
/// Means that belong to a plane: three times as far as the worst of the real table's residuals.
constexpr double kBand_mm = 15;
/// A real LMS 400 looking at a table: the scan of PointCloudLibrary's tutorials, means of 10 mm cubes.
constexpr double kRealP10_mm = 0.87, kRealMedian_mm = 1.17, kRealP90_mm = 1.90, kAllowed = 0.15;
/// How the table lies in that scan.
const Plane kRealTable{Vector3d{0.013, 0.879, 0.477}.normalized(), 1166};

Cell cell_of(const Vector3d& p, double edge_mm) {
  Cell cell;
  for (std::size_t k = 0; k < 3; ++k) cell[k] = static_cast<int>(std::floor(p[static_cast<int>(k)] / edge_mm));
  return cell;
}

void print_row(const char* what, const std::vector<Vector3d>& means) {
  const auto residuals = plane_residuals(means, kRadius_mm);
  std::printf("| %s | %zu | %.2f | %.2f | %.2f |\n", what, means.size(), quantile(residuals, 0.1),
              quantile(residuals, 0.5), quantile(residuals, 0.9));
}

bool near_the_real_one(const std::vector<Vector3d>& means) {
  const auto residuals = plane_residuals(means, kRadius_mm);
  for (const auto& [q, real] : {std::pair{0.1, kRealP10_mm}, {0.5, kRealMedian_mm}, {0.9, kRealP90_mm}})
    if (std::abs(quantile(residuals, q) - real) > kAllowed * real) return false;
  return true;
}
}  // namespace

std::vector<Vector3d> cube_means(const std::vector<Vector3d>& points, double cube_mm) {
  std::map<Cell, std::pair<Vector3d, int>> cubes;
  for (const Vector3d& p : points) {
    auto& [sum, n] = cubes.try_emplace(cell_of(p, cube_mm), Vector3d::Zero(), 0).first->second;
    sum += p;
    ++n;
  }
  std::vector<Vector3d> means;
  for (const auto& [cell, cube] : cubes) means.push_back(cube.first / cube.second);
  return means;
}

std::vector<Vector3d> column_means(const std::vector<Vector3d>& points, const Plane& plane, double cube_mm) {
  const Eigen::Matrix3d R = Eigen::Quaterniond::FromTwoVectors(plane.normal, Vector3d::UnitZ()).toRotationMatrix();
  std::map<Cell, std::pair<Vector3d, int>> columns;
  for (const Vector3d& p : points) {
    const Vector3d own = R * p;
    auto& [sum, n] = columns.try_emplace(cell_of({own.x(), own.y(), 0}, cube_mm), Vector3d::Zero(), 0).first->second;
    sum += own;
    ++n;
  }
  std::vector<Vector3d> means;
  for (const auto& [cell, column] : columns) means.push_back(column.first / column.second);
  return means;
}

std::vector<double> plane_residuals(const std::vector<Vector3d>& points, double radius_mm) {
  std::map<Cell, std::vector<Vector3d>> cells;
  for (const Vector3d& p : points) cells[cell_of(p, radius_mm)].push_back(p);
  std::vector<double> residuals;
  for (const Vector3d& centre : points) {
    const Cell cell = cell_of(centre, radius_mm);
    Vector3d sum = Vector3d::Zero();
    Eigen::Matrix3d squares = Eigen::Matrix3d::Zero();
    int n = 0;
    for (int k = 0; k < 27; ++k) {
      const auto it = cells.find({cell[0] + k % 3 - 1, cell[1] + k / 3 % 3 - 1, cell[2] + k / 9 - 1});
      if (it == cells.end()) continue;
      for (const Vector3d& p : it->second) {
        const Vector3d d = p - centre;
        if (d.norm() >= radius_mm) continue;
        sum += d;
        squares += d * d.transpose();
        ++n;
      }
    }
    if (n <= 10) continue;
    const Vector3d mean = sum / n;
    const Eigen::Matrix3d covariance = squares / n - mean * mean.transpose();
    residuals.push_back(std::sqrt(std::max(
        0.0, Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>{covariance, Eigen::EigenvaluesOnly}.eigenvalues()[0])));
  }
  std::ranges::sort(residuals);
  return residuals;
}

Plane largest_plane(const std::vector<Vector3d>& points, double band_mm) {
  if (points.size() < 3) throw std::runtime_error{"a plane needs three points"};
  emulators::Random random{7};
  Plane best;
  std::size_t most = 0;
  for (int trial = 0; trial < 2000; ++trial) {
    std::array<Vector3d, 3> p;
    for (Vector3d& q : p) q = points[random.next() % points.size()];
    Plane plane;
    plane.normal = (p[1] - p[0]).cross(p[2] - p[0]).normalized();
    if (!(plane.normal.norm() > 0.5)) continue;  // on one line: normalised, nothing stays nothing
    plane.distance_mm = -plane.normal.dot(p[0]);
    if (plane.distance_mm < 0) plane.normal = -plane.normal, plane.distance_mm = -plane.distance_mm;
    std::size_t count = 0;
    for (std::size_t i = 0; i < points.size(); i += 10)
      count += std::abs(plane.normal.dot(points[i]) + plane.distance_mm) < band_mm;
    if (count > most) most = count, best = plane;
  }
  return best;
}

std::vector<Vector3d> points_of(const std::vector<Vector3d>& points, const Plane& plane, double band_mm) {
  std::vector<Vector3d> own;
  for (const Vector3d& p : points)
    if (std::abs(plane.normal.dot(p) + plane.distance_mm) < band_mm) own.push_back(p);
  return own;
}

std::vector<Vector3d> table_scan(const TableScan& scan) {
  const double step_rad = scan.step_deg * std::numbers::pi / 180,
               line_step_rad = scan.line_step_deg * std::numbers::pi / 180;
  const auto count = static_cast<std::size_t>(std::lround(70 / scan.step_deg));
  constexpr double kNear_mm = 900, kFar_mm = 1800;
  // The table is the world's floor; the scanner's own frame at the middle line is the frame of the answer.
  const emulators::World world{{4000, 4000, 0}};
  Eigen::Isometry3d T_floor_scan = Eigen::Isometry3d::Identity();
  T_floor_scan.linear() = Eigen::Quaterniond::FromTwoVectors(scan.table.normal, Vector3d::UnitZ()).toRotationMatrix();
  T_floor_scan.translation() = Vector3d{0, 0, scan.table.distance_mm};
  // Lines in the frame's x and -z; the pivot turns about its x.
  emulators::ScannerPlace place;
  place.T_base_supply.iso = T_floor_scan.inverse();
  Eigen::Matrix3d pivot;
  pivot.col(2) = Vector3d::UnitX();
  pivot.col(0) = Vector3d::UnitY();
  pivot.col(1) = Vector3d::UnitZ();
  place.T_base_pivot.iso.linear() = pivot;
  Eigen::Matrix3d scanner;  // x along the pivot's z, z against its y
  scanner.col(0) = Vector3d::UnitZ();
  scanner.col(2) = -Vector3d::UnitY();
  scanner.col(1) = scanner.col(2).cross(scanner.col(0));
  place.T_pivot_scanner.iso.linear() = scanner;
  double angle = 0;
  emulators::RangeNoise noise;
  noise.sigma_mm = scan.sigma_mm;
  const emulators::ScannerView view{world, emulators::on_pivot(place, [&](TimePoint) { return Angle::rad(angle); }),
                                    noise};
  std::vector<Vector3d> points;
  const Angle first = Angle::deg(55), step = Angle::rad(step_rad);
  for (int line = 0; line < scan.lines; ++line) {
    angle = (scan.first_line + line) * line_step_rad;
    const auto measured = view(TimePoint{} + std::chrono::milliseconds{1000 + 3 * line}, first, step, count);
    const Eigen::Isometry3d T =
        place.T_base_pivot.iso * Eigen::AngleAxisd{angle, Vector3d::UnitZ()} * place.T_pivot_scanner.iso;
    for (std::size_t i = 0; i < count; ++i) {
      const auto range = static_cast<double>(std::round(measured.range_mm[i]));
      if (!(range > kNear_mm && range < kFar_mm)) continue;
      const double at = (first.in_rad()) + static_cast<double>(i) * step_rad;
      points.push_back(T * Vector3d{range * std::cos(at), 0, range * std::sin(at)});
    }
  }
  return points;
}

void print_noise_truth(const std::string& cloud) {
  std::printf(
      "Rms distance from the plane of the means within 30 mm.\n"
      "| | means | p10 mm | median mm | p90 mm |\n|---|---|---|---|---|\n");
  std::printf("| a real LMS 400, as published | | %.2f | %.2f | %.2f |\n", kRealP10_mm, kRealMedian_mm, kRealP90_mm);
  // As the cell scans: the file's raw points are lost, and its cubes lie aslant; so the class's 3 mm are checked by
  // what detection sees of them, the means of columns.
  TableScan cell;
  cell.table = {Vector3d::UnitZ(), 920};
  cell.step_deg = 0.25;
  cell.line_step_deg = 0.175;
  cell.lines = 343;
  cell.first_line = 0;  // ranges from 920 to 1800 mm, as in the real scan
  const auto columns = column_means(table_scan(cell), cell.table, kCube_mm);
  print_row("emulated, 3 mm of noise, as a cell scans, means of columns", columns);
  // As the file was made: as dense, the same table, the same cubes.
  TableScan file;
  file.table = kRealTable;
  for (const double sigma : {1.6, 3.0}) {
    file.sigma_mm = sigma;
    const auto cubes = cube_means(points_of(table_scan(file), kRealTable, 2 * kBand_mm), kCube_mm);
    print_row(sigma < 2 ? "emulated, 1.6 mm, as the real scan was made, means of cubes" : "emulated, 3 mm, the same",
              cubes);
  }
  std::printf("as a cell scans: %s 15 %% of the real one\n", near_the_real_one(columns) ? "all within" : "NOT within");
  if (cloud.empty()) return;
  const auto loaded = vision::load_cloud(cloud);
  if (!loaded) throw std::runtime_error{loaded.error().text};
  std::vector<Vector3d> points;
  for (const Eigen::Vector3f& p : *loaded) points.push_back(p.cast<double>());
  const Plane plane = largest_plane(points, kBand_mm);
  std::printf("%s: %zu points, largest plane normal %.3f %.3f %.3f, %.0f mm away\n", cloud.c_str(), points.size(),
              plane.normal.x(), plane.normal.y(), plane.normal.z(), plane.distance_mm);
  const auto own = points_of(points, plane, kBand_mm);
  print_row("largest plane of the file, means of cubes", cube_means(own, kCube_mm));
  print_row("largest plane of the file, means of columns", column_means(own, plane, kCube_mm));
}
}  // namespace binpick::bench
