#include "bench/scenes/pose_measure.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

namespace binpick::bench {
namespace {
using Eigen::Isometry3d;
using Eigen::Matrix3d;
using Eigen::Vector3d;
using Kind = vision::Symmetry::Kind;

Matrix3d surface_spread(const vision::Mesh& mesh, const Vector3d& centroid) {
  Matrix3d sum = Matrix3d::Zero();
  double area = 0;
  for (const auto& corners : mesh.triangles) {
    std::array<Vector3d, 3> p;
    for (std::size_t k = 0; k < 3; ++k) p[k] = mesh.vertices_mm[corners[k]].cast<double>() - centroid;
    const double own = 0.5 * (p[1] - p[0]).cross(p[2] - p[0]).norm();
    const Vector3d s = p[0] + p[1] + p[2];
    sum += own / 12 * (s * s.transpose() + p[0] * p[0].transpose() + p[1] * p[1].transpose() + p[2] * p[2].transpose());
    area += own;
  }
  const Eigen::SelfAdjointEigenSolver<Matrix3d> solver{Matrix3d{sum / area}};
  return solver.operatorSqrt();
}

Vector3d turn_vector(const Matrix3d& R) {
  const Eigen::AngleAxisd turn{R};
  return turn.angle() * turn.axis();
}
}  // namespace

PoseMeasure::PoseMeasure(const vision::Mesh& mesh, const vision::Symmetry& symmetry)
    : symmetry_{symmetry},
      centroid_mm_{mesh.centroid_mm()},
      spread_mm_{surface_spread(mesh, centroid_mm_)},
      diameter_mm_{mesh.diameter_mm()} {
  const Matrix3d squared = spread_mm_ * spread_mm_;
  const double along = symmetry_.axis.dot(squared * symmetry_.axis);
  revolution_mm_ = std::sqrt(along + 0.5 * (squared.trace() - along));
}

bool PoseMeasure::revolution() const {
  return symmetry_.kind == Kind::Revolution || symmetry_.kind == Kind::RevolutionFlip;
}

double PoseMeasure::distance_mm(const Isometry3d& a, const Isometry3d& b) const {
  const double moved = (a * centroid_mm_ - b * centroid_mm_).squaredNorm();
  if (symmetry_.kind == Kind::Sphere) return std::sqrt(moved);
  if (revolution()) {
    const Vector3d e = a.linear() * symmetry_.axis, f = b.linear() * symmetry_.axis;
    double turned = (e - f).squaredNorm();
    if (symmetry_.kind == Kind::RevolutionFlip) turned = std::min(turned, (e + f).squaredNorm());
    return std::sqrt(moved + revolution_mm_ * revolution_mm_ * turned);
  }
  double turned = (a.linear() * spread_mm_ - b.linear() * spread_mm_).squaredNorm();
  if (symmetry_.kind == Kind::Finite)
    for (const Matrix3d& g : symmetry_.rotations)
      turned = std::min(turned, (a.linear() * g * spread_mm_ - b.linear() * spread_mm_).squaredNorm());
  return std::sqrt(moved + turned);
}

PoseMeasure::Error PoseMeasure::error(const Isometry3d& a, const Isometry3d& b) const {
  Error error;
  error.centroid_mm = a * centroid_mm_ - b * centroid_mm_;
  if (symmetry_.kind == Kind::Sphere) return error;
  if (revolution()) {
    const Vector3d f = b.linear() * symmetry_.axis;
    Vector3d e = a.linear() * symmetry_.axis;
    if (symmetry_.kind == Kind::RevolutionFlip && e.dot(f) < 0) e = -e;
    const Vector3d cross = f.cross(e);
    if (cross.norm() > 0) error.turn_rad = std::atan2(cross.norm(), e.dot(f)) * cross.normalized();
    return error;
  }
  error.turn_rad = turn_vector(a.linear() * b.linear().transpose());
  if (symmetry_.kind != Kind::Finite) return error;
  for (const Matrix3d& g : symmetry_.rotations) {
    const Vector3d turn = turn_vector(a.linear() * g * b.linear().transpose());
    if (turn.norm() < error.turn_rad.norm()) error.turn_rad = turn;
  }
  return error;
}

double PoseMeasure::normalised_error_squared(const Isometry3d& a, const Isometry3d& truth,
                                             const Eigen::Matrix<double, 6, 6>& covariance) const {
  const Error own = error(a, truth);
  // What the symmetry leaves: all of the translation, and of the rotation all, the part across the axis, or nothing.
  Eigen::Matrix<double, 6, Eigen::Dynamic> free = Eigen::Matrix<double, 6, 6>::Identity();
  if (symmetry_.kind == Kind::Sphere) free = Eigen::Matrix<double, 6, 6>::Identity().leftCols<3>();
  if (revolution()) {
    const Vector3d axis = truth.linear() * symmetry_.axis, across = axis.unitOrthogonal();
    free = Eigen::Matrix<double, 6, 5>::Zero();
    free.topLeftCorner<3, 3>().setIdentity();
    free.block<3, 1>(3, 3) = across;
    free.block<3, 1>(3, 4) = axis.cross(across);
  }
  Eigen::Matrix<double, 6, 1> e;
  e << own.centroid_mm, own.turn_rad;
  const Eigen::VectorXd reduced = free.transpose() * e;
  const Eigen::LDLT<Eigen::MatrixXd> solver{Eigen::MatrixXd{free.transpose() * covariance * free}};
  if (solver.info() != Eigen::Success || !solver.isPositive() || !(solver.vectorD().minCoeff() > 0)) return -1;
  return reduced.dot(solver.solve(reduced)) / static_cast<double>(reduced.size());
}

vision::Symmetry judged_symmetry(const vision::Mesh& mesh, double noise_mm) {
  return vision::find_symmetry(mesh, std::max(0.5 * noise_mm, 0.005 * mesh.diameter_mm()));
}
}  // namespace binpick::bench
