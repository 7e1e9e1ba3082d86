#include "drivers/robot/dialect.hpp"

#include <cmath>

#include "base/check.hpp"
#include "base/rotation.hpp"

namespace binpick::drivers::robot {
namespace {
/// 0.0001 degrees are 0.002 mm at a lever of 1 m.
constexpr int kDegreeDecimals = 4;
constexpr double kHalfStep_deg = 0.5e-4;

/// -180 excluded and 180 included, as it will be rounded: half a turn has one sign.
double written_deg(double angle_deg) {
  const double wrapped = std::remainder(angle_deg, 360.0);
  return wrapped < -180.0 + kHalfStep_deg ? 180.0 : wrapped;
}

/// W, P, R. With P = 90 only W - R means anything, with P = -90 only W + R: R is 0 then.
Eigen::Vector3d written_wpr_deg(const Eigen::Matrix3d& R) {
  Eigen::Vector3d wpr = to_wpr_deg(R);
  if (std::abs(wpr.y()) > 90.0 - kHalfStep_deg) {
    wpr.x() += wpr.y() > 0 ? -wpr.z() : wpr.z();
    wpr.z() = 0.0;
  }
  return {written_deg(wpr.x()), wpr.y(), written_deg(wpr.z())};
}

/// O, A, T. With A = 180, a tool that points straight down, only O - T means anything, with A = 0 only O + T: T is 0
/// then.
Eigen::Vector3d written_oat_deg(const Eigen::Matrix3d& R) {
  Eigen::Vector3d oat = to_oat_deg(R);
  const bool down = oat.y() > 180.0 - kHalfStep_deg;
  if (down || oat.y() < kHalfStep_deg) {
    oat.x() += down ? -oat.z() : oat.z();
    oat.z() = 0.0;
  }
  return {written_deg(oat.x()), oat.y(), written_deg(oat.z())};
}

// socket_read_ascii_float() of URScript reads one group in parentheses; lengths are metres, the rotation a rotation
// vector in radians (Universal Robots, script manual).
constexpr Format kUniversalRobots{.request_end = "\n",
                                  .open = "(",
                                  .close = ")",
                                  .end = "\n",
                                  .pose_break = ",",
                                  .integer_width = 0,
                                  .real_width = 0,
                                  .mm_per_unit = 1e3,
                                  .length_decimals = 6,
                                  .angle_decimals = 7,
                                  .angle_max = 3.1415927,
                                  .to_angles = to_rotation_vector,
                                  .from_angles = from_rotation_vector};

// KAREL reads a line into a STRING of 128 characters, hence three lines; columns are fixed, so that SUB_STR() finds
// each number. XYZWPR is millimetres and degrees, R = Rz(R) Ry(P) Rx(W) (Roboception, rc_visard manual, "FANUC XYZ-WPR
// format").
constexpr Format kFanuc{.request_end = "\r\n",
                        .open = "",
                        .close = "\r\n",
                        .end = "",
                        .pose_break = "\r\n",
                        .integer_width = 5,
                        .real_width = 10,
                        .mm_per_unit = 1,
                        .length_decimals = 3,
                        .angle_decimals = kDegreeDecimals,
                        .angle_max = 180,
                        .to_angles = written_wpr_deg,
                        .from_angles = from_wpr_deg};

// TCP_RECV of AS fills strings of at most 255 characters; $DECODE() and VAL() take one line apart at its commas. O A T
// are degrees, R = Rz(O) Ry(A) Rz(T) (Basler, rc_visard manual, "Kawasaki XYZ-OAT format").
constexpr Format kKawasaki{.request_end = "\r\n",
                           .open = "",
                           .close = "\r\n",
                           .end = "",
                           .pose_break = ",",
                           .integer_width = 0,
                           .real_width = 0,
                           .mm_per_unit = 1,
                           .length_decimals = 3,
                           .angle_decimals = kDegreeDecimals,
                           .angle_max = 180,
                           .to_angles = written_oat_deg,
                           .from_angles = from_oat_deg};
}  // namespace

const Format& format_of(Dialect dialect) {
  switch (dialect) {
    case Dialect::UniversalRobots:
      return kUniversalRobots;
    case Dialect::Fanuc:
      return kFanuc;
    case Dialect::Kawasaki:
      return kKawasaki;
  }
  check_failed("the dialect is one of Dialect", __FILE__, __LINE__);
}
}  // namespace binpick::drivers::robot
