#pragma once

#include <Eigen/Geometry>
#include <string>
#include <vector>

#include "base/expected.hpp"
#include "vision/calibration/mount.hpp"

/// Finding the sphere in a scan whose scanner stands only roughly where the cell file says.
namespace binpick::vision::calibration {
/// A profile with where its carrier was: point i lies at (x_mm[i], 0, z_mm[i]) in the scanner frame, NaN: not measured.
struct CarriedProfile {
  Eigen::Isometry3d T_root_carrier;  ///< pivot_turned(angle), or T_base_flange.
  std::vector<float> x_mm, z_mm;
};
/// One scan of the sphere.
struct SphereScan {
  std::string name;  ///< For messages.
  std::vector<CarriedProfile> profiles;
  /// Of what held the sphere: the flange's pose, or the sphere's own known place. The identity: it stood in the cell.
  Eigen::Isometry3d T_base_holder = Eigen::Isometry3d::Identity();
};

/// What a scan shows of the sphere and of what is near it.
struct SphereSight {
  struct Line {
    Eigen::Isometry3d T_root_carrier;
    std::vector<Eigen::Vector2d> points_mm;  ///< x and z in the scanner frame.
  };
  std::string name;
  Eigen::Isometry3d T_base_holder = Eigen::Isometry3d::Identity();
  std::vector<Line> lines;    ///< Those that come near it.
  Eigen::Vector3d centre_mm;  ///< In the base, with the mount that it was searched with.
  std::size_t points = 0;     ///< That lie on it.
};

/// Finds the one sphere of this radius. The mount may be wrong by 100 mm and 10 degrees: that moves the sphere as a
/// whole and shears it a little. Normals of small patches vote for the centre; the best must then really be a sphere,
/// seen in full where nothing hides it. The error is text: what was found instead.
Expected<SphereSight, std::string> find_sphere(const SphereScan& scan, const Mount& mount, double radius_mm);
}  // namespace binpick::vision::calibration
