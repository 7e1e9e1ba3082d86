#pragma once

#include <cstdint>

#include "tests/emulators/scanner/lms400_device.hpp"
#include "tests/emulators/scanner/scanner_place.hpp"
#include "tests/emulators/world/world.hpp"

namespace binpick::emulators {
/// How an LMS 400 errs. Default: as its data sheet is remembered; `exact()` for geometry alone.
struct RangeNoise {
  double sigma_mm = 3;       ///< One standard deviation on a white surface, head on. Grows with less light, see below.
  double sigma_max_mm = 10;  ///< On dark or grazing surfaces.
  double bias_mm = 0;        ///< Constant per part, within ± this; the real device has up to 4.
  double beam_mm = 3;        ///< Diameter of the spot: what lies across an edge mixes two distances. 0: a thin ray.
  bool dropouts = true;      ///< Weak echoes are lost, in runs.
  double range_min_mm = 700, range_max_mm = 3000;  ///< Outside: no measurement.
  std::uint64_t seed = 1;

  static RangeNoise exact() {
    RangeNoise noise;
    noise.sigma_mm = noise.sigma_max_mm = noise.beam_mm = 0;
    noise.dropouts = false;
    return noise;
  }
};

/// The emulated scanner's eye: each line is cast from where it really stands at that moment. All points of a
/// line belong to its middle: at 360 lines a second and 35 degrees a second of sweep, half a line is 0.05 degrees.
///
/// Noise, after phase-shift time of flight: sigma · sqrt(0.9 / (reflectance · cos incidence)) up to sigma_max; at edges
/// the phasors of nine rays across the spot are added, which gives points between or beside the two surfaces; below
/// some light no echo. The same time and seed give the same line.
class ScannerView {
 public:
  /// `world` must outlive this; objects may vanish from it between lines.
  ScannerView(const World& world, WhereScanner where, const RangeNoise& noise = {});

  ScanLine operator()(TimePoint middle, Angle first, Angle step, std::size_t points) const;

 private:
  const World* world_;
  WhereScanner where_;
  RangeNoise noise_;
};
}  // namespace binpick::emulators
