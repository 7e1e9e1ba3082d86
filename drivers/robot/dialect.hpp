#pragma once

#include <Eigen/Core>
#include <string_view>

#include "drivers/robot/session.hpp"

/// All in which the makers' controllers differ: how numbers, poses and lines are written. The requests, the
/// fields of an answer and their order are the same for all (codec.hpp).
namespace binpick::drivers::robot {
struct Format {
  std::string_view request_end;  ///< Behind a request, as the maker's program sends it; read are CR, LF and CR LF.
  std::string_view open, close;  ///< Around the fields; an answer is whole when `close` has come.
  std::string_view end;          ///< Behind `close`; the controller does not wait for it.
  std::string_view pose_break;   ///< Between the heading, the approach pose, and the rest: grasp, retreat, last report.
  int integer_width;             ///< Zeros in front up to this width; 0: as long as the number is.
  int real_width;                ///< The same for lengths and angles, decimals and sign included.
  double mm_per_unit;
  int length_decimals;
  int angle_decimals;
  double angle_max;  ///< No angle is larger, in the dialect's unit, as it is rounded.
  /// The three numbers of a rotation, in the maker's order. Where the notation is singular (and where the written
  /// decimals cannot tell the pose from a singular one), one rotation has one text, whatever its rounding noise.
  Eigen::Vector3d (*to_angles)(const Eigen::Matrix3d& R);
  Eigen::Matrix3d (*from_angles)(const Eigen::Vector3d& angles);
};

const Format& format_of(Dialect dialect);
}  // namespace binpick::drivers::robot
