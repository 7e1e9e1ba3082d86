#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "vision/calibration/sphere_search.hpp"

/// One adjustment of all scans: the mount, where the sphere sat on its holder, and where it was in each scan.
///
/// Unknown are the mount (Mount::unknowns()), the sphere on its holder o (3, unless known), and its centre c_k in each
/// scan. Observed are points, each by how much longer it is than its ray to the sphere (`point_sd`, with Tukey's
/// weights), and that c_k is where the holder says, T_base_holder · o (`place_sd`: what the carriers' poses are good
/// for, estimated from how well they agree). The centres are eliminated, so a scan is one summand of the normal
/// equations and can be left out again.
namespace binpick::vision::calibration {
struct Arrangement {
  Mount mount;
  Eigen::Vector3d p_holder_sphere_mm = Eigen::Vector3d::Zero();
  bool sphere_known = false;  ///< p_holder_sphere_mm is given.
  int unknowns() const { return mount.unknowns() + (sphere_known ? 0 : 3); }
};

struct Adjusted {
  Arrangement arrangement;
  std::vector<Eigen::Vector3d> centres_mm;   ///< c_k, in the base.
  double point_sd_mm = 0, place_sd_mm = 0;   ///< As estimated; place per axis.
  std::vector<Eigen::MatrixXd> information;  ///< Of each scan on the unknowns of the arrangement.
  std::vector<double> measuring_mm2;  ///< What measuring one sphere does to its centre: points and pose, squared sd.
  /// Of the arrangement's unknowns, with the little that is known without scans: the present mount is right within 100
  /// mm and 10 degrees (1 sd). So it exists even when the scans say nothing of some unknown.
  Eigen::MatrixXd covariance() const;
};
Adjusted adjust(std::span<const SphereSight> sights, const Arrangement& start, double radius_mm);

/// A scan that had no part in the adjustment, against what that says of it.
struct HeldOut {
  Eigen::Vector3d error_mm;  ///< Centre that the scan measures, less the one that the holder says, in the base.
  /// What of its square is expected to come from the mount and the sphere on its holder as the other scans have them,
  /// by the sd of the whole adjustment; the rest is Adjusted::measuring_mm2.
  double mount_mm2 = 0;
};
HeldOut hold_out(std::span<const SphereSight> sights, const Adjusted& whole, std::size_t left_out, double radius_mm);

/// The radius that the points themselves say, and its standard error; each scan with a centre of its own.
struct RadiusSeen {
  double radius_mm = 0, se_mm = 0;
};
RadiusSeen radius_of(std::span<const SphereSight> sights, const Adjusted& whole, double radius_mm);
}  // namespace binpick::vision::calibration
