#include "vision/calibration/mount.hpp"

#include <cmath>

#include "base/check.hpp"

namespace binpick::vision::calibration {
namespace {
using Eigen::Isometry3d;
using Eigen::Matrix3d;
using Eigen::Vector3d;

Matrix3d crossing(const Vector3d& v) {
  Matrix3d m;
  m << 0, -v.z(), v.y(), v.z(), 0, -v.x(), -v.y(), v.x(), 0;
  return m;
}

Isometry3d small_motion(const Vector3d& shift, const Vector3d& turn) {
  const double angle = turn.norm();
  Isometry3d motion = Isometry3d::Identity();
  if (angle > 0) motion.linear() = Eigen::AngleAxisd{angle, turn / angle}.toRotationMatrix();
  motion.translation() = shift;
  return motion;
}

/// Products of many rotations drift away from being one.
Isometry3d orthonormal(const Isometry3d& T) {
  Isometry3d out = T;
  out.linear() = Eigen::Quaterniond{T.linear()}.normalized().toRotationMatrix();
  return out;
}
}  // namespace

Mount Mount::moved(const Eigen::VectorXd& step) const {
  BINPICK_CHECK(step.size() == unknowns());
  Mount out = *this;
  if (on_pivot) out.T_base_root = orthonormal(T_base_root * small_motion({step[0], step[1], 0}, {step[2], step[3], 0}));
  const auto own = step.tail<6>();
  out.T_carrier_scanner = orthonormal(T_carrier_scanner * small_motion(own.head<3>(), own.tail<3>()));
  return out;
}

Eigen::Matrix3Xd Mount::shift_by_step(const Isometry3d& T_root_carrier, const Vector3d& p_scanner_mm) const {
  Eigen::Matrix3Xd by_step(3, unknowns());
  const Matrix3d R_base_scanner = T_base_scanner(T_root_carrier).linear();
  if (on_pivot) {
    const Matrix3d& R = T_base_root.linear();
    const Vector3d p_root = T_root_carrier * (T_carrier_scanner * p_scanner_mm);
    by_step.leftCols<2>() = R.leftCols<2>();
    by_step.middleCols<2>(2) = (-R * crossing(p_root)).leftCols<2>();
  }
  by_step.middleCols<3>(unknowns() - 6) = R_base_scanner;
  by_step.rightCols<3>() = -R_base_scanner * crossing(p_scanner_mm);
  return by_step;
}

Eigen::Matrix3Xd Mount::turn_by_step(const Isometry3d& T_root_carrier) const {
  Eigen::Matrix3Xd by_step = Eigen::Matrix3Xd::Zero(3, unknowns());
  if (on_pivot) by_step.middleCols<2>(2) = T_base_root.linear().leftCols<2>();
  by_step.rightCols<3>() = T_base_scanner(T_root_carrier).linear();
  return by_step;
}

Mount on_pivot(const ScannerMount& mount) { return {true, mount.T_base_pivot.iso, mount.T_pivot_scanner.iso}; }

Mount on_flange(const Transform<frame::Flange, frame::Scanner>& T_flange_scanner) {
  return {false, Isometry3d::Identity(), T_flange_scanner.iso};
}

Isometry3d pivot_turned(Angle angle) { return Isometry3d{Eigen::AngleAxisd{angle.in_rad(), Vector3d::UnitZ()}}; }

std::optional<SeenPoint> seen_from_pivot(const Mount& mount, const Vector3d& p_base_mm) {
  // The scan plane contains the point where n · Rz(-angle) p = n · t: a sine and a cosine of the angle.
  const Vector3d p = mount.T_base_root.inverse() * p_base_mm;
  const Vector3d n = mount.T_carrier_scanner.linear().col(1), t = mount.T_carrier_scanner.translation();
  const double cosine = n.x() * p.x() + n.y() * p.y(), sine = n.x() * p.y() - n.y() * p.x();
  const double rest = n.dot(t) - n.z() * p.z(), size = std::hypot(cosine, sine);
  if (size <= std::abs(rest)) return std::nullopt;
  std::optional<SeenPoint> best;
  for (const double side : {-1.0, 1.0}) {
    const Isometry3d turn = pivot_turned(Angle::rad(std::atan2(sine, cosine) + side * std::acos(rest / size)));
    const SeenPoint seen{turn, (turn * mount.T_carrier_scanner).inverse() * p};
    if (seen.p_scanner_mm.z() > 0 && (!best || seen.p_scanner_mm.z() > best->p_scanner_mm.z())) best = seen;
  }
  return best;
}

double apart_mm(const Mount& a, const Mount& b, std::span<const SeenPoint> points) {
  BINPICK_CHECK(!points.empty());
  double sum = 0;
  for (const SeenPoint& seen : points)
    sum += (a.T_base_scanner(seen.T_root_carrier) * seen.p_scanner_mm -
            b.T_base_scanner(seen.T_root_carrier) * seen.p_scanner_mm)
               .squaredNorm();
  return std::sqrt(sum / static_cast<double>(points.size()));
}
}  // namespace binpick::vision::calibration
