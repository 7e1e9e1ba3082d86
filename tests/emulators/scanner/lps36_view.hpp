#pragma once

#include <cstdint>

#include "tests/emulators/scanner/lps36_device.hpp"
#include "tests/emulators/scanner/scanner_place.hpp"
#include "tests/emulators/world/world.hpp"

namespace binpick::emulators {
/// How an LPS 36 measures and errs. Default: the standard model as its data sheet is remembered.
struct LightSection {
  double half_width_per_mm = 0.375;               ///< Of the laser's fan: 300 mm at 800 mm.
  double range_min_mm = 200, range_max_mm = 800;  ///< Outside: nothing measured.
  double sigma_mm = 0.5, stand_off_mm = 500;      ///< Noise of the depth there; it grows with the depth squared.
  double baseline_mm = 110;                       ///< From laser to camera, along -y of the scanner frame.
  double spot_mm = 1.5;  ///< Along the line: at a jump it lies on both surfaces. 0: a thin ray.
  bool dropouts = true;  ///< Grazing surfaces are lost, in runs.
  std::uint64_t seed = 1;

  static LightSection hi() {
    LightSection hi;
    hi.half_width_per_mm = 70.0 / 600;
    hi.range_max_mm = 600;
    hi.sigma_mm = 0.12;
    hi.stand_off_mm = 420;
    hi.spot_mm = 0.8;
    return hi;
  }
  LightSection exact() const {
    LightSection exact = *this;
    exact.sigma_mm = exact.spot_mm = 0;
    exact.dropouts = false;
    return exact;
  }
};

/// The emulated light-section scanner's eye: a sheet of laser light in the x, z plane, looked at from beside it. What
/// the camera does not see is not measured. Noise after triangulation: sigma grows with the depth squared and with
/// grazing light; at jumps two peaks near each other run into one between them, of two far apart the brighter counts.
/// The same time and seed give the same line.
class Lps36View {
 public:
  /// `world` must outlive this; objects may vanish from it between lines.
  Lps36View(const World& world, WhereScanner where, const LightSection& device = {});

  PointLine operator()(TimePoint at, std::size_t points) const;

 private:
  struct Peak;
  Peak peak(const Eigen::Isometry3d& T_supply_scanner, double slope) const;
  Peak peak_of_spot(const Eigen::Isometry3d& T_supply_scanner, double slope) const;
  double sigma_at(double depth_mm) const;

  const World* world_;
  WhereScanner where_;
  LightSection device_;
};
}  // namespace binpick::emulators
