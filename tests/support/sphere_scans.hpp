#pragma once

#include <cstdint>

#include "vision/calibration/calibrate.hpp"

/// Emulated scans of a sphere by a scanner whose true mount differs from the cell file's.
namespace binpick::support {
enum class SphereScanner { Lms400, Lps36 };
enum class SphereCarrier { Pivot, Robot };

/// The emulated scanners with their own noise, over an empty supply with its walls. A pivot's scanner sees the sphere
/// on a rod in the robot's gripper, from the side; a robot carries the scanner past a sphere that stands on a rod.
struct SphereScans {
  SphereScanner scanner = SphereScanner::Lms400;
  SphereCarrier carrier = SphereCarrier::Pivot;
  int scans = 12;
  std::uint64_t seed = 1;
  /// The cell file's mount: each axis of each transform that far from the truth, 1 sd.
  double mount_shift_mm = 10, mount_turn_deg = 1.5;
  /// Noise of the carriers, 1 sd per axis: a pose of the robot as it says it, constant over a scan; each sample of it
  /// on the way; a pivot's angle over a sweep, and each sample, told in steps of the third.
  double pose_mm = 0.1, pose_deg = 0.01, sample_mm = 0.05;
  double sweep_deg = 0.01, angle_deg = 0.01, angle_step_deg = 0.01;
  bool turned = true;      ///< The flange is turned between scans; false: always the same way.
  bool spread_out = true;  ///< The sphere is met all over the field; false: always at the same place in it.
  bool quiet = false;      ///< No noise of scanner and carriers at all.
};
struct EmulatedScans {
  vision::calibration::Question question;
  vision::calibration::Mount truth;
};
/// The same values, the same scans.
EmulatedScans scan_spheres(const SphereScans& wanted);

/// How far the mount really displaces points of the supply, root mean square, mm: what Answer::hold_out_mm estimates.
double true_error_mm(const EmulatedScans& emulated, const vision::calibration::Answer& answer);
}  // namespace binpick::support
