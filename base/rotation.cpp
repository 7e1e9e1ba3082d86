#include "base/rotation.hpp"

#include <Eigen/Geometry>
#include <cmath>
#include <numbers>

namespace binpick {
namespace {
constexpr double kDegPerRad = 180.0 / std::numbers::pi;
/// Below this sine the direction that it scales is rounding noise of a matrix of doubles.
constexpr double kSingularSine = 1e-9;

Eigen::Matrix3d about(const Eigen::Vector3d& axis, double angle_deg) {
  return Eigen::AngleAxisd(angle_deg / kDegPerRad, axis).toRotationMatrix();
}
}  // namespace

Eigen::Vector3d to_rotation_vector(const Eigen::Matrix3d& R) {
  const Eigen::Vector3d w{R(2, 1) - R(1, 2), R(0, 2) - R(2, 0), R(1, 0) - R(0, 1)};  // 2 sin(angle) * axis
  const double two_sin = w.norm();
  const double two_cos = R.trace() - 1.0;
  const double angle = std::atan2(two_sin, two_cos);
  if (two_cos > 0.0 && two_sin < 2 * kSingularSine) return 0.5 * w;  // no turn to speak of
  if (two_cos > -1.0) return angle / two_sin * w;
  // Towards half a turn w fades, so the axis comes from R + R^T = 2 cos(angle) I + 2 (1 - cos(angle)) axis axis^T, by
  // its largest component; w still tells the sign.
  const double cosine = 0.5 * two_cos;
  const Eigen::Matrix3d square = (0.5 * (R + R.transpose()) - cosine * Eigen::Matrix3d::Identity()) / (1.0 - cosine);
  Eigen::Index k = 0;
  square.diagonal().maxCoeff(&k);
  Eigen::Vector3d axis = square.col(k).normalized();
  if (axis.dot(w) < 0.0) axis = -axis;
  return angle * axis;
}

Eigen::Matrix3d from_rotation_vector(const Eigen::Vector3d& v_rad) {
  const double angle = v_rad.norm();
  if (angle < 1e-12) {
    Eigen::Matrix3d R;
    R << 1, -v_rad.z(), v_rad.y(), v_rad.z(), 1, -v_rad.x(), -v_rad.y(), v_rad.x(), 1;
    return R;
  }
  return Eigen::AngleAxisd(angle, v_rad / angle).toRotationMatrix();
}

Eigen::Vector3d to_wpr_deg(const Eigen::Matrix3d& R) {
  const double cos_p = std::hypot(R(0, 0), R(1, 0));
  const double p = std::atan2(-R(2, 0), cos_p);  // asin loses precision near 90 degrees
  if (cos_p < kSingularSine) return kDegPerRad * Eigen::Vector3d{std::atan2(-R(1, 2), R(1, 1)), p, 0.0};
  return kDegPerRad * Eigen::Vector3d{std::atan2(R(2, 1), R(2, 2)), p, std::atan2(R(1, 0), R(0, 0))};
}

Eigen::Matrix3d from_wpr_deg(const Eigen::Vector3d& wpr_deg) {
  return about(Eigen::Vector3d::UnitZ(), wpr_deg.z()) * about(Eigen::Vector3d::UnitY(), wpr_deg.y()) *
         about(Eigen::Vector3d::UnitX(), wpr_deg.x());
}

Eigen::Vector3d to_oat_deg(const Eigen::Matrix3d& R) {
  const double sin_a = std::hypot(R(2, 0), R(2, 1));
  const double a = std::atan2(sin_a, R(2, 2));
  if (sin_a < kSingularSine) {
    const double o = R(2, 2) > 0 ? std::atan2(R(1, 0), R(0, 0)) : std::atan2(-R(1, 0), -R(0, 0));
    return kDegPerRad * Eigen::Vector3d{o, a, 0.0};
  }
  return kDegPerRad * Eigen::Vector3d{std::atan2(R(1, 2), R(0, 2)), a, std::atan2(R(2, 1), -R(2, 0))};
}

Eigen::Matrix3d from_oat_deg(const Eigen::Vector3d& oat_deg) {
  return about(Eigen::Vector3d::UnitZ(), oat_deg.x()) * about(Eigen::Vector3d::UnitY(), oat_deg.y()) *
         about(Eigen::Vector3d::UnitZ(), oat_deg.z());
}
}  // namespace binpick
