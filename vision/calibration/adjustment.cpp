#include "vision/calibration/adjustment.hpp"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>

#include "base/check.hpp"

namespace binpick::vision::calibration {
namespace {
using Eigen::Matrix3d;
using Eigen::MatrixXd;
using Eigen::RowVector3d;
using Eigen::Vector3d;
using Eigen::VectorXd;

/// A point counts where its ray passes the centre within this share of the radius: 57 degrees of incidence. Chosen by
/// where the sphere is, not by what was measured, so that noise does not choose. Beyond it lie mixed pixels.
constexpr double kLimb = 0.84;
/// While the mount is still wrong: a point this near the surface, as a share of the radius.
constexpr double kRoughly = 0.2;
constexpr double kTukey = 4.685;
constexpr double kPointSdMin_mm = 0.005, kPlaceSdMin_mm = 0.01;
constexpr double kPlaceSdFirst_mm = 1;
constexpr int kRoughRounds = 6, kRounds = 10, kRadiusRounds = 6;
/// What is known without a scan, 1 sd.
constexpr double kShiftKnown_mm = 100, kTurnKnown_rad = 10 * std::numbers::pi / 180, kSphereKnown_mm = 5000;

enum class Stage {
  Rough,  ///< Distances from the surface: defined for every point.
  Fine,   ///< Along the rays, where the scanner's noise is: free of the bias that distances have on a small sphere.
};

/// How far a point is off the sphere and how that changes with the sphere's centre, both in the scanner frame.
struct Off {
  double mm = 0;
  RowVector3d by_centre;
};
std::optional<Off> off_sphere(const Eigen::Vector2d& point, const Vector3d& centre, double radius, Stage stage) {
  const Vector3d p{point.x(), 0, point.y()};
  if (stage == Stage::Rough) {
    const Vector3d d = p - centre;
    const double distance = d.norm();
    if (std::abs(distance - radius) > kRoughly * radius || d.dot(centre) > 0) return std::nullopt;
    return Off{distance - radius, -d.transpose() / distance};
  }
  const double range = p.norm();
  const Vector3d ray = p / range;
  const double along = ray.dot(centre), miss2 = centre.squaredNorm() - along * along;
  if (along <= 0 || miss2 > kLimb * kLimb * radius * radius) return std::nullopt;
  const double met = along - std::sqrt(radius * radius - miss2);
  const Vector3d n = (met * ray - centre) / radius;  // outwards, towards the scanner
  return Off{range - met, n.transpose() / -n.dot(ray)};
}

double tukey(double off, double sd) {
  const double u = off / (kTukey * sd);
  return std::abs(u) >= 1 ? 0 : (1 - u * u) * (1 - u * u);
}

/// The points' part of the normal equations of one scan: unknowns of the mount, and its centre.
struct Sums {
  MatrixXd mount;         // m × m
  MatrixXd mount_centre;  // m × 3
  Matrix3d centre = Matrix3d::Zero();
  VectorXd mount_right;
  Vector3d centre_right = Vector3d::Zero();
  double weight = 0;
};
Sums sums_of(const SphereSight& sight, const Mount& mount, const Vector3d& centre_base, double radius, double sd,
             Stage stage) {
  const int m = mount.unknowns();
  Sums sums{MatrixXd::Zero(m, m), MatrixXd::Zero(m, 3), Matrix3d::Zero(), VectorXd::Zero(m), Vector3d::Zero(), 0};
  for (const SphereSight::Line& line : sight.lines) {
    const Eigen::Isometry3d T = mount.T_base_scanner(line.T_root_carrier);
    const Vector3d centre = T.inverse() * centre_base;
    // A line is a line's worth of these: the rows of all its points are multiples of three.
    Matrix3d squares = Matrix3d::Zero();
    Vector3d right = Vector3d::Zero();
    for (const Eigen::Vector2d& point : line.points_mm) {
      const auto off = off_sphere(point, centre, radius, stage);
      if (!off) continue;
      const double weight = tukey(off->mm, sd) / (sd * sd);
      squares += weight * off->by_centre.transpose() * off->by_centre;
      right -= weight * off->by_centre.transpose() * off->mm;
      sums.weight += weight;
    }
    // The centre moves in the scanner frame as it does in the base, less what the mount moves there.
    const Matrix3d R = T.linear().transpose();
    const Eigen::Matrix3Xd by_mount = -R * mount.shift_by_step(line.T_root_carrier, centre);
    sums.mount += by_mount.transpose() * squares * by_mount;
    sums.mount_centre += by_mount.transpose() * squares * R;
    sums.centre += R.transpose() * squares * R;
    sums.mount_right += by_mount.transpose() * right;
    sums.centre_right += R.transpose() * right;
  }
  return sums;
}

Vector3d place_of(const SphereSight& sight, const Arrangement& arrangement) {
  return sight.T_base_holder * arrangement.p_holder_sphere_mm;
}

/// The scan's whole part after its centre is eliminated.
struct Reduced {
  MatrixXd normal;
  VectorXd right;
  Matrix3d centre_inverse;
  MatrixXd centre_unknowns;  // 3 × n
  Vector3d centre_right;
  Vector3d centre_step(const VectorXd& step) const { return centre_inverse * (centre_right - centre_unknowns * step); }
};
Reduced reduced(const Sums& sums, const SphereSight& sight, const Arrangement& at, const Vector3d& centre,
                double place_sd) {
  const int n = at.unknowns(), m = at.mount.unknowns();
  const double tie = 1 / (place_sd * place_sd);
  const Vector3d apart = centre - place_of(sight, at);
  Reduced out{MatrixXd::Zero(n, n), VectorXd::Zero(n), {}, MatrixXd::Zero(3, n), sums.centre_right - tie * apart};
  out.normal.topLeftCorner(m, m) = sums.mount;
  out.right.head(m) = sums.mount_right;
  out.centre_unknowns.leftCols(m) = sums.mount_centre.transpose();
  if (!at.sphere_known) {
    const Matrix3d& R = sight.T_base_holder.linear();
    out.normal.bottomRightCorner<3, 3>() = tie * Matrix3d::Identity();
    out.right.tail<3>() = tie * R.transpose() * apart;
    out.centre_unknowns.rightCols<3>() = -tie * R;
  }
  out.centre_inverse = (sums.centre + tie * Matrix3d::Identity()).inverse();
  out.normal -= out.centre_unknowns.transpose() * out.centre_inverse * out.centre_unknowns;
  out.right -= out.centre_unknowns.transpose() * out.centre_inverse * out.centre_right;
  return out;
}

MatrixXd known_before(const Arrangement& arrangement) {
  VectorXd sd = VectorXd::Constant(arrangement.unknowns(), kSphereKnown_mm);
  const int m = arrangement.mount.unknowns();
  sd.segment<3>(m - 6).setConstant(kShiftKnown_mm);
  sd.segment<3>(m - 3).setConstant(kTurnKnown_rad);
  if (arrangement.mount.on_pivot) {
    sd.head<2>().setConstant(kShiftKnown_mm);
    sd.segment<2>(2).setConstant(kTurnKnown_rad);
  }
  return sd.cwiseAbs2().cwiseInverse().asDiagonal();
}

struct State {
  Arrangement arrangement;
  std::vector<Vector3d> centres;
};

std::vector<Reduced> reduced_all(std::span<const SphereSight> sights, const State& state, double radius,
                                 double point_sd, double place_sd, Stage stage) {
  std::vector<Reduced> all;
  for (std::size_t k = 0; k < sights.size(); ++k)
    all.push_back(reduced(sums_of(sights[k], state.arrangement.mount, state.centres[k], radius, point_sd, stage),
                          sights[k], state.arrangement, state.centres[k], place_sd));
  return all;
}

/// One Gauss-Newton step, held back only where the scans say nothing. Its size, in the unit of what was known before.
double step(std::span<const SphereSight> sights, State& state, double radius, double point_sd, double place_sd,
            Stage stage, std::optional<std::size_t> left_out = std::nullopt) {
  const std::vector<Reduced> all = reduced_all(sights, state, radius, point_sd, place_sd, stage);
  const MatrixXd before = known_before(state.arrangement);
  MatrixXd normal = before;
  VectorXd right = VectorXd::Zero(state.arrangement.unknowns());
  for (std::size_t k = 0; k < all.size(); ++k) {
    if (k == left_out) continue;
    normal += all[k].normal;
    right += all[k].right;
  }
  VectorXd change = normal.ldlt().solve(right);
  // No further than the search could have been wrong.
  const double size = std::sqrt(change.dot(before * change));
  if (size > 1) change /= size;
  const int m = state.arrangement.mount.unknowns();
  state.arrangement.mount = state.arrangement.mount.moved(change.head(m));
  if (!state.arrangement.sphere_known) state.arrangement.p_holder_sphere_mm += change.tail<3>();
  for (std::size_t k = 0; k < all.size(); ++k)
    if (k != left_out) state.centres[k] += all[k].centre_step(change);
  return size;
}

/// Normal's sd, from the median of how far points are off.
double spread_of_points(std::span<const SphereSight> sights, const State& state, double radius, Stage stage) {
  std::vector<double> sizes;
  for (std::size_t k = 0; k < sights.size(); ++k)
    for (const SphereSight::Line& line : sights[k].lines) {
      const Vector3d centre = state.arrangement.mount.T_base_scanner(line.T_root_carrier).inverse() * state.centres[k];
      for (const Eigen::Vector2d& point : line.points_mm)
        if (const auto off = off_sphere(point, centre, radius, stage)) sizes.push_back(std::abs(off->mm));
    }
  if (sizes.empty()) return kPointSdMin_mm;
  const auto middle = sizes.begin() + static_cast<std::ptrdiff_t>(sizes.size() / 2);
  std::ranges::nth_element(sizes, middle);
  return std::max(1.4826 * *middle, kPointSdMin_mm);
}

/// How well the holders' poses agree with the centres: squared differences over what of them the adjustment left free
/// (Helmert's estimate of a variance component).
double spread_of_places(std::span<const SphereSight> sights, const State& state, const std::vector<Reduced>& all,
                        double place_sd) {
  const int n = state.arrangement.unknowns();
  MatrixXd normal = known_before(state.arrangement);
  for (const Reduced& one : all) normal += one.normal;
  const MatrixXd covariance = normal.inverse();
  double squares = 0, free = 0;
  for (std::size_t k = 0; k < sights.size(); ++k) {
    squares += (state.centres[k] - place_of(sights[k], state.arrangement)).squaredNorm();
    MatrixXd by_unknowns = -all[k].centre_inverse * all[k].centre_unknowns;
    if (!state.arrangement.sphere_known) by_unknowns.rightCols<3>() -= sights[k].T_base_holder.linear();
    BINPICK_CHECK(by_unknowns.cols() == n);
    const Matrix3d left = all[k].centre_inverse + by_unknowns * covariance * by_unknowns.transpose();
    free += 3 - std::min(left.trace() / (place_sd * place_sd), 3.0);
  }
  return free < 0.5 ? place_sd : std::max(std::sqrt(squares / free), kPlaceSdMin_mm);
}
}  // namespace

MatrixXd Adjusted::covariance() const {
  MatrixXd normal = known_before(arrangement);
  for (const MatrixXd& one : information) normal += one;
  return normal.inverse();
}

Adjusted adjust(std::span<const SphereSight> sights, const Arrangement& start, double radius_mm) {
  State state{start, {}};
  Vector3d on_holder = Vector3d::Zero();
  for (const SphereSight& sight : sights) {
    state.centres.push_back(sight.centre_mm);
    on_holder += sight.T_base_holder.inverse() * sight.centre_mm / static_cast<double>(sights.size());
  }
  if (!start.sphere_known) state.arrangement.p_holder_sphere_mm = on_holder;

  double point_sd = 0, place_sd = kPlaceSdFirst_mm;
  for (int round = 0; round < kRoughRounds; ++round) {
    point_sd = spread_of_points(sights, state, radius_mm, Stage::Rough);
    for (int i = 0; i < 3; ++i) step(sights, state, radius_mm, point_sd, place_sd, Stage::Rough);
  }
  for (int round = 0; round < kRounds; ++round) {
    point_sd = spread_of_points(sights, state, radius_mm, Stage::Fine);
    for (int i = 0; i < 3; ++i)
      if (step(sights, state, radius_mm, point_sd, place_sd, Stage::Fine) < 1e-7) break;
    place_sd = spread_of_places(sights, state, reduced_all(sights, state, radius_mm, point_sd, place_sd, Stage::Fine),
                                place_sd);
  }
  step(sights, state, radius_mm, point_sd, place_sd, Stage::Fine);

  Adjusted out{state.arrangement, state.centres, point_sd, place_sd, {}, {}};
  for (Reduced& one : reduced_all(sights, state, radius_mm, point_sd, place_sd, Stage::Fine)) {
    const Matrix3d by_points = one.centre_inverse.inverse() - Matrix3d::Identity() / (place_sd * place_sd);
    out.measuring_mm2.push_back(by_points.inverse().trace() + 3 * place_sd * place_sd);
    out.information.push_back(std::move(one.normal));
  }
  return out;
}

HeldOut hold_out(std::span<const SphereSight> sights, const Adjusted& whole, std::size_t left_out, double radius_mm) {
  State others{whole.arrangement, whole.centres_mm};
  for (int i = 0; i < 4; ++i)
    step(sights, others, radius_mm, whole.point_sd_mm, whole.place_sd_mm, Stage::Fine, left_out);
  MatrixXd normal = known_before(whole.arrangement);
  for (std::size_t k = 0; k < sights.size(); ++k)
    if (k != left_out) normal += whole.information[k];

  // The centre by this scan's points alone.
  const SphereSight& sight = sights[left_out];
  Vector3d centre = whole.centres_mm[left_out];
  Sums sums;
  for (int i = 0; i < 6; ++i) {
    sums = sums_of(sight, others.arrangement.mount, centre, radius_mm, whole.point_sd_mm, Stage::Fine);
    centre += sums.centre.ldlt().solve(sums.centre_right);
  }
  const Matrix3d measured = sums.centre.inverse();
  MatrixXd by_unknowns = MatrixXd::Zero(3, whole.arrangement.unknowns());
  by_unknowns.leftCols(whole.arrangement.mount.unknowns()) = -measured * sums.mount_centre.transpose();
  if (!whole.arrangement.sphere_known) by_unknowns.rightCols<3>() = -sight.T_base_holder.linear();
  return {centre - place_of(sight, others.arrangement),
          (by_unknowns * normal.inverse() * by_unknowns.transpose()).trace()};
}

RadiusSeen radius_of(std::span<const SphereSight> sights, const Adjusted& whole, double radius_mm) {
  std::vector<Vector3d> centres = whole.centres_mm;
  RadiusSeen seen{radius_mm, 0};
  for (int round = 0; round < kRadiusRounds; ++round) {
    double information = 0, right = 0;
    for (std::size_t k = 0; k < sights.size(); ++k) {
      Eigen::Matrix4d normal = Eigen::Matrix4d::Zero();
      Eigen::Vector4d sums = Eigen::Vector4d::Zero();
      for (const SphereSight::Line& line : sights[k].lines) {
        const Eigen::Isometry3d T = whole.arrangement.mount.T_base_scanner(line.T_root_carrier);
        const Vector3d centre = T.inverse() * centres[k];
        for (const Eigen::Vector2d& point : line.points_mm) {
          const auto off = off_sphere(point, centre, seen.radius_mm, Stage::Fine);
          if (!off) continue;
          // A larger sphere about the same centre is met sooner, by the growth over the cosine of incidence.
          Eigen::Vector4d row;
          row << T.linear() * off->by_centre.transpose(), off->by_centre.norm();
          const double weight = tukey(off->mm, whole.point_sd_mm) / (whole.point_sd_mm * whole.point_sd_mm);
          normal += weight * row * row.transpose();
          sums -= weight * row * off->mm;
        }
      }
      const Matrix3d inverse = normal.topLeftCorner<3, 3>().inverse();
      const Eigen::RowVector3d cross = normal.bottomLeftCorner<1, 3>();
      information += normal(3, 3) - cross * inverse * cross.transpose();
      right += sums[3] - cross * inverse * sums.head<3>();
      centres[k] += inverse * sums.head<3>();
    }
    seen = {seen.radius_mm + right / information, 1 / std::sqrt(information)};
  }
  return seen;
}
}  // namespace binpick::vision::calibration
