#include "tests/emulators/program/scan_paths.hpp"

#include <cmath>
#include <numbers>

namespace binpick::emulators {
namespace {
/// How the scanner is carried, by what it can see: its height over the floor, its speeds, and how far beyond the
/// supply's walls it goes.
struct Manner {
  double height_mm, speed_mm_s, speed_deg_s, beyond_mm;
};
Manner manner_of(const config::Config& config) {
  if (config.scanner_model == config::ScannerModel::Lms400) return {1800, 250, 20, 40};
  return {500, 100, 10, 20};
}

/// The scanner over the supply's middle, moved by y and turned by `pan_rad` about its own x; it looks down, its line
/// along the supply's x.
Eigen::Isometry3d scanner_over(double y_mm, double height_mm, double pan_rad) {
  return Eigen::Translation3d{0, y_mm, height_mm} *
         Eigen::AngleAxisd{std::numbers::pi + pan_rad, Eigen::Vector3d::UnitX()};
}
}  // namespace

std::map<std::uint16_t, ScanPath> scan_paths(const config::Config& config, const config::Supply& supply) {
  const Manner manner = manner_of(config);
  const auto flange = [&](double y_mm, double pan_rad) {
    const Transform<frame::Supply, frame::Scanner> T_supply_scanner{scanner_over(y_mm, manner.height_mm, pan_rad)};
    return supply.T_base_supply * T_supply_scanner * config.T_flange_scanner.inverse();
  };
  const double reach_mm = supply.size_mm.y() / 2 + manner.beyond_mm;
  const double pan_rad = std::atan2(reach_mm, manner.height_mm);
  return {
      {kLinearPath, {flange(-reach_mm, 0), flange(reach_mm, 0), from_s(2 * reach_mm / manner.speed_mm_s)}},
      {kPanPath,
       {flange(0, -pan_rad), flange(0, pan_rad), from_s(2 * pan_rad * 180 / std::numbers::pi / manner.speed_deg_s)}}};
}
}  // namespace binpick::emulators
