#pragma once

#include <string>
#include <vector>

#include "base/expected.hpp"
#include "vision/calibration/adjustment.hpp"

/// A scanner's mount from scans of a sphere, and what it is good for.
namespace binpick::vision::calibration {
struct Question {
  Arrangement present;  ///< As the cell file has it; right within 100 mm and 10 degrees.
  double sphere_radius_mm = 0;
  std::vector<SphereScan> scans;
  /// Where the error counts, in the base: for a scanner on a pivot. For one on a robot all that the scans saw.
  std::vector<Eigen::Vector3d> places_mm;
};

struct Pose {
  std::string name;
  std::size_t points = 0;  ///< On the sphere.
  double error_mm = 0;     ///< Of the sphere's centre as predicted without this scan.
};

struct Answer {
  Mount mount;
  Eigen::Vector3d p_holder_sphere_mm;
  double point_sd_mm = 0;  ///< Of one measured point.
  double place_sd_mm = 0;  ///< Of where the robot said that the sphere, or its scanner, was; per axis.
  std::vector<Pose> poses;
  std::vector<SeenPoint> seen;  ///< The points that the errors below are taken over.

  /// H: each scan is left out of the adjustment in turn; how far its sphere then lies from where the others say, root
  /// mean square. It has in it the error of measuring that one sphere.
  double left_out_mm = 0, left_out_se_mm = 0;
  /// The hold-out error: how far the calibrated mount displaces points of the supply. Of H², that part which comes from
  /// the mount,
  ///   E² = F · mean_j tr(J_j P J_jᵀ)   with   F = Σ_k |e_k|² / Σ_k (tr S_k + tr G_k P_k G_kᵀ).
  /// e_k: error of scan k when left out; S_k: what measuring one sphere contributes to it, G_k P_k G_kᵀ what the mount
  /// of the other scans does, both for the adjustment's own sd; J_j: what a step of the mount does to point j; P: the
  /// covariance of the mount from all scans. F is 1 where the adjustment's sd tell all; what they hide (correlated
  /// noise, a robot that is bent) the left-out scans show, and it scales the whole. The error of one calibration is
  /// random: E²'s distribution is taken as a gamma's with its mean and variance (Satterthwaite), `hold_out_mm` is its
  /// median, `hold_out_95_mm` what is not exceeded with 95 % certainty, F's own uncertainty included.
  double hold_out_mm = 0, hold_out_se_mm = 0, hold_out_95_mm = 0;
  double turn_95_rad = 0;  ///< The same for how far what is seen is turned.
};

/// The error is text of one line: what, where, what to do. It names the kind of pose that is missing when the scans do
/// not determine the mount.
Expected<Answer, std::string> calibrate(const Question& question);
}  // namespace binpick::vision::calibration
