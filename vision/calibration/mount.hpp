#pragma once

#include <Eigen/Geometry>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "vision/registration.hpp"

/// Where a carried scanner stands, as calibration varies it.
namespace binpick::vision::calibration {
/// T_base_scanner = T_base_root · T_root_carrier · T_carrier_scanner. On a pivot the root is the pivot at angle zero
/// and T_root_carrier turns about its z axis; on a robot the root is the base and T_root_carrier the flange's pose.
struct Mount {
  bool on_pivot = true;
  Eigen::Isometry3d T_base_root = Eigen::Isometry3d::Identity();
  Eigen::Isometry3d T_carrier_scanner = Eigen::Isometry3d::Identity();

  Eigen::Isometry3d T_base_scanner(const Eigen::Isometry3d& T_root_carrier) const {
    return T_base_root * T_root_carrier * T_carrier_scanner;
  }
  /// Six for the scanner on its carrier: shifted along and turned about its own axes. On a pivot, before them, four for
  /// its axis: shifted along and tilted about the pivot's x and y. A shift along this axis and a turn about it would do
  /// the same to every point as one of the scanner on the pivot; those two of T_base_pivot stay as they are.
  int unknowns() const { return on_pivot ? 10 : 6; }
  /// Changed by one small step of all unknowns, mm and rad.
  Mount moved(const Eigen::VectorXd& step) const;
  /// What a small step does in the base to the point that the scanner sees at `p_scanner_mm`: 3 × unknowns().
  Eigen::Matrix3Xd shift_by_step(const Eigen::Isometry3d& T_root_carrier, const Eigen::Vector3d& p_scanner_mm) const;
  /// How it turns what is seen there, rad about the base's axes: 3 × unknowns().
  Eigen::Matrix3Xd turn_by_step(const Eigen::Isometry3d& T_root_carrier) const;
};
Mount on_pivot(const ScannerMount& mount);
Mount on_flange(const Transform<frame::Flange, frame::Scanner>& T_flange_scanner);
Eigen::Isometry3d pivot_turned(Angle angle);

/// A point as the scanner sees it: where its carrier was, and where the point lay in its frame.
struct SeenPoint {
  Eigen::Isometry3d T_root_carrier;
  Eigen::Vector3d p_scanner_mm;
};
/// How a scanner on a pivot sees a point of the base; nothing where its plane never meets it in front of it.
std::optional<SeenPoint> seen_from_pivot(const Mount& mount, const Eigen::Vector3d& p_base_mm);
/// By how much two mounts disagree on where points lie, root mean square, mm.
double apart_mm(const Mount& a, const Mount& b, std::span<const SeenPoint> points);
}  // namespace binpick::vision::calibration
