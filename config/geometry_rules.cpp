#include <algorithm>
#include <cmath>
#include <numbers>

#include "config/rules.hpp"
#include "config/wording.hpp"

namespace binpick::config {
namespace {
/// A base, or a scanner's mount, nearer than this is metres for millimetres.
constexpr double kMetresMm = 5;

std::string rounded(double v) { return number_text(std::round(v * 1000) / 1000); }
std::string whole(double v) { return number_text(std::round(v) + 0.0); }

/// What a scanner measures between, along its middle ray. Makers' ratings, partly from memory: SICK LMS 400 0.7 … 3 m,
/// Leuze LPS 36 200 … 800 mm, LPS 36 HI 200 … 600 mm.
struct Range {
  const char* model;
  double min_mm, max_mm;
};
Range range_of(ScannerModel model) {
  switch (model) {
    case ScannerModel::Lms400:
      return {"an LMS 400", 700, 3000};
    case ScannerModel::Lps36:
      return {"an LPS 36", 200, 800};
    case ScannerModel::Lps36Hi:
      return {"an LPS 36 HI", 200, 600};
  }
  return {"a scanner", 0, 0};
}

/// The floor, and whatever lies in the lower half of the supply, has to be within the scanner's range.
void check_stand_off(const Config& c, const Supply& supply, double floor_mm, double per_height, const Places& places,
                     Findings& findings) {
  const Range range = range_of(c.scanner_model);
  const double half_full_mm = floor_mm - per_height * supply.size_mm.z() / 2;
  if (floor_mm <= range.max_mm && half_full_mm >= range.min_mm) return;
  findings.add(places.of("T_base_supply"),
               "in the middle of the sweep the scanner is " + whole(floor_mm) + " mm from the supply's floor and " +
                   whole(half_full_mm) + " mm from half its walls' height, but " + range.model + " measures from " +
                   whole(range.min_mm) + " to " + whole(range.max_mm) + " mm; mount it " +
                   (floor_mm > range.max_mm ? "nearer" : "farther away") + ", or correct the transforms");
}

/// In the middle of a sweep the scanner's middle ray goes down into the supply, or at most half its size beside it.
/// What looks elsewhere is metres for millimetres, radians for degrees, or a mount with a wrong sign.
void check_views(const Config& c, const CellPlaces& at, Findings& findings) {
  const bool mounted =
      c.carrier == Carrier::Pivot && at.given("pivot", "T_base_pivot") && at.given("scanner", "T_pivot_scanner");
  for (std::size_t i = 0; mounted && i < c.supplies.size(); ++i) {
    const Supply& supply = c.supplies[i];
    const Places& places = at.supplies[i];
    const auto given = [&](const char* key) { return places.given(key); };
    if (!given("T_base_supply") || !given("size_mm") || !given("sweep_start_deg") || !given("sweep_end_deg")) continue;
    const double pivot_rad = (supply.sweep_start.in_rad() + supply.sweep_end.in_rad()) / 2;
    const double ray_rad = c.scanner_model == ScannerModel::Lms400
                               ? c.lms400.start.in_rad() + c.lms400.range.in_rad() / 2
                               : std::numbers::pi / 2;
    const Eigen::Isometry3d T_supply_scanner = supply.T_base_supply.iso.inverse() * c.mount.T_base_pivot.iso *
                                               Eigen::AngleAxisd(pivot_rad, Eigen::Vector3d::UnitZ()) *
                                               c.mount.T_pivot_scanner.iso;
    const Eigen::Vector3d from = T_supply_scanner.translation();
    const Eigen::Vector3d ray = T_supply_scanner.linear() * Eigen::Vector3d{std::cos(ray_rad), 0, std::sin(ray_rad)};
    std::string where;
    if (from.z() < supply.size_mm.z()) {
      where = "the scanner stands at z = " + rounded(std::round(from.z()) + 0.0) + " mm, below the walls' tops";
    } else if (ray.z() > -0.1) {
      where = "it never looks down into it";
    } else {
      const Eigen::Vector3d hit = from - ray * (from.z() / ray.z());
      if (std::abs(hit.x()) <= supply.size_mm.x() && std::abs(hit.y()) <= supply.size_mm.y()) {
        check_stand_off(c, supply, -from.z() / ray.z(), -1 / ray.z(), places, findings);
        continue;
      }
      where = "it meets the floor at x = " + rounded(std::round(hit.x()) + 0.0) +
              ", y = " + rounded(std::round(hit.y()) + 0.0) + " mm from its middle";
    }
    findings.add(
        places.of("T_base_supply"),
        "in the middle of the sweep the scanner does not look into the supply: " + where +
            "; correct T_base_pivot, T_pivot_scanner, T_base_supply (mm, degrees, signs) or the sweep's angles");
  }
}

void check_reach(const Config& c, const CellPlaces& at, Findings& findings) {
  if (c.reach.radius_max_mm > 0 && c.reach.axis_min_mm >= c.reach.radius_max_mm)
    findings.add(at.of("reach", at.given("reach", "radius_max_mm") ? "radius_max_mm" : "axis_min_mm"),
                 "reach.radius_max_mm = " + rounded(c.reach.radius_max_mm) +
                     " leaves nothing outside of reach.axis_min_mm = " + rounded(c.reach.axis_min_mm) +
                     "; use more, or 0 for no limit");
}

/// Where the robot carries the scanner, no ray tells of wrong units.
void check_carried(const Config& c, const CellPlaces& at, Findings& findings) {
  if (c.carrier != Carrier::Robot) return;
  const double mount_mm = c.T_flange_scanner.iso.translation().norm();
  if (at.given("scanner", "T_flange_scanner") && mount_mm > 0 && mount_mm < kMetresMm)
    findings.add(at.of("scanner", "T_flange_scanner"), "scanner.T_flange_scanner puts the scanner " +
                                                           rounded(mount_mm) +
                                                           " mm from the flange's middle; give xyz_mm in mm");
  for (std::size_t i = 0; i < c.supplies.size(); ++i) {
    const Supply& supply = c.supplies[i];
    if (!at.supplies[i].given("T_base_supply") || !at.supplies[i].given("size_mm")) continue;
    const Eigen::Vector3d base_mm = supply.T_base_supply.iso.inverse().translation();
    const Eigen::Vector3d half_mm = supply.size_mm / 2;
    if (std::abs(base_mm.x()) < half_mm.x() && std::abs(base_mm.y()) < half_mm.y() && base_mm.z() > -kMetresMm &&
        base_mm.z() < std::max(supply.size_mm.z(), kMetresMm))
      findings.add(at.supplies[i].of("T_base_supply"), "supply.T_base_supply puts the robot's base into the supply, " +
                                                           rounded(base_mm.norm()) +
                                                           " mm from the middle of its floor; give xyz_mm in mm");
  }
}

/// Parts are lifted along the base's z; where that does not lead out of the supply every program would hit something.
void check_up(const Config& c, const CellPlaces& at, Findings& findings) {
  constexpr double kSlantMax = std::numbers::pi / 3;
  for (std::size_t i = 0; i < c.supplies.size(); ++i) {
    if (!at.supplies[i].given("T_base_supply")) continue;
    const double slant_rad = std::acos(std::clamp(c.supplies[i].T_base_supply.iso.linear()(2, 2), -1.0, 1.0));
    if (slant_rad > kSlantMax)
      findings.add(at.supplies[i].of("T_base_supply"),
                   "the supply's z axis, out of it, and the base's, along which parts are lifted, are " +
                       whole(slant_rad * 180 / std::numbers::pi) +
                       " deg apart, 60 are allowed; correct rpy_deg, or give the arm on a ceiling or wall a user frame "
                       "whose z points up");
  }
}

/// A supply of which nothing is within reach.
void check_supplies_reach(const Config& c, const CellPlaces& at, Findings& findings) {
  if (!at.given("reach", "radius_max_mm") || c.reach.radius_max_mm <= c.reach.axis_min_mm) return;
  for (std::size_t i = 0; i < c.supplies.size(); ++i) {
    const Supply& supply = c.supplies[i];
    if (!at.supplies[i].given("T_base_supply") || !at.supplies[i].given("size_mm")) continue;
    const Eigen::Vector3d base_mm = supply.T_base_supply.iso.inverse().translation();
    const Eigen::Vector3d low{-supply.size_mm.x() / 2, -supply.size_mm.y() / 2, 0};
    const Eigen::Vector3d high{supply.size_mm.x() / 2, supply.size_mm.y() / 2, supply.size_mm.z()};
    const double nearest_mm = (base_mm - base_mm.cwiseMax(low).cwiseMin(high)).norm();
    if (nearest_mm > c.reach.radius_max_mm)
      findings.add(at.supplies[i].of("T_base_supply"),
                   "no place of the supply is nearer than " + whole(nearest_mm) +
                       " mm to the robot's base, beyond reach.radius_max_mm = " + rounded(c.reach.radius_max_mm) +
                       "; correct T_base_supply (mm), or the reach");
  }
}
void check_sizes(const Config& c, const CellPlaces& at, Findings& findings) {
  for (std::size_t i = 0; i < c.supplies.size(); ++i) {
    const Eigen::Vector3d& size = c.supplies[i].size_mm;
    if (!at.supplies[i].given("size_mm")) continue;
    if (size.head<2>().minCoeff() < 10)
      findings.add(at.supplies[i].of("size_mm"), "supply.size_mm is less than 10 mm along x or y; give mm");
    if (c.supplies[i].locate && size.z() < 20)
      findings.add(
          at.supplies[i].of("locate"),
          "supply.locate looks for a rim, and supply.size_mm gives no walls of 20 mm or more; give their height, "
          "or leave locate out");
  }
}
}  // namespace

void check_geometry(const Config& config, const CellPlaces& places, Findings& findings) {
  check_up(config, places, findings);
  check_views(config, places, findings);
  check_carried(config, places, findings);
  check_reach(config, places, findings);
  check_supplies_reach(config, places, findings);
  check_sizes(config, places, findings);
}
}  // namespace binpick::config
