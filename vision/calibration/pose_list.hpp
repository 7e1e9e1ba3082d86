#pragma once

#include <Eigen/Geometry>
#include <string>
#include <string_view>
#include <vector>

#include "base/expected.hpp"

namespace binpick::vision::calibration {
/// Which scan was taken with the sphere held where: a table of commas or semicolons, its columns named by its first
/// line. `scan` is the scan's file; `x_mm, y_mm, z_mm` with `rx_rad, ry_rad, rz_rad` (Universal Robots),
/// `w_deg, p_deg, r_deg` (Fanuc) or `o_deg, a_deg, t_deg` (Kawasaki) is the pose, in the base, of the flange or of any
/// tool that holds the sphere; x, y and z alone are the place of the sphere's centre. Empty lines and those that begin
/// with # are left out.
struct PoseList {
  struct Row {
    std::string scan;
    Eigen::Isometry3d T_base_holder = Eigen::Isometry3d::Identity();
  };
  bool places_only = false;  ///< The holder's origin is the sphere's centre.
  std::vector<Row> rows;
};
/// The error is text that begins with `path` and the line.
Expected<PoseList, std::string> parse_pose_list(std::string_view text, const std::string& path);
}  // namespace binpick::vision::calibration
