#pragma once

#include <Eigen/Core>
#include <array>
#include <string_view>

#include "vision/knowledge_base.hpp"

/// The scene benchmark: piles, scanners, truth and metric that detection is judged by. All of it is simulation.
namespace binpick::bench {
/// One device class as it stands over its supply. Noise, spacing and stand-off are vision::figures_of(scanner).
struct ClassSetting {
  vision::ScannerClass scanner;
  std::string_view name;      ///< As in a PART.toml.
  Eigen::Vector3d supply_mm;  ///< Inner x, y and wall height.
  bool triangulation;         ///< A laser sheet in x, z that is carried along y; else time of flight from one place.
  double baseline_mm;         ///< Triangulation: from laser to camera, along y.
  double quantum_mm;          ///< Steps of the values on the wire.
  double jitter_mm;           ///< Of the carrier from profile to profile, 1 sd, each axis.
  double jitter_rad;
  double spot_along_mm, spot_across_mm;  ///< Light spot, along and across the profile.
};

const std::array<ClassSetting, 3>& class_settings();
const ClassSetting& setting_of(vision::ScannerClass scanner);
/// Null: no such class.
const ClassSetting* find_setting(std::string_view name);
}  // namespace binpick::bench
