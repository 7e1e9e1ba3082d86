#pragma once

#include <Eigen/Geometry>

#include "vision/mesh.hpp"
#include "vision/symmetry.hpp"

namespace binpick::bench {
/// How far apart two poses of a part are (Brégier et al., 2017): root of the mean squared displacement of its surface
/// points, least over its proper symmetry group.
class PoseMeasure {
 public:
  PoseMeasure(const vision::Mesh& mesh, const vision::Symmetry& symmetry);

  double distance_mm(const Eigen::Isometry3d& a, const Eigen::Isometry3d& b) const;

  struct Error {
    Eigen::Vector3d centroid_mm = Eigen::Vector3d::Zero();  ///< a's less b's.
    Eigen::Vector3d turn_rad = Eigen::Vector3d::Zero();     ///< Turns b into a; for a revolution: its axis into a's.
    double angle_rad() const { return turn_rad.norm(); }
  };
  /// Of the symmetric pose that is nearest.
  Error error(const Eigen::Isometry3d& a, const Eigen::Isometry3d& b) const;
  /// Mahalanobis distance squared over the degrees of freedom that the symmetry leaves; covariance of (translation mm,
  /// rotation rad), axes of the common frame, at the centroid. Negative: the covariance is none.
  double normalised_error_squared(const Eigen::Isometry3d& a, const Eigen::Isometry3d& truth,
                                  const Eigen::Matrix<double, 6, 6>& covariance) const;

  const vision::Symmetry& symmetry() const { return symmetry_; }
  const Eigen::Vector3d& centroid_mm() const { return centroid_mm_; }
  double diameter_mm() const { return diameter_mm_; }
  /// Square root of the surface's covariance about its centroid.
  const Eigen::Matrix3d& spread_mm() const { return spread_mm_; }

 private:
  bool revolution() const;

  vision::Symmetry symmetry_;
  Eigen::Vector3d centroid_mm_;
  Eigen::Matrix3d spread_mm_;
  double revolution_mm_ = 0;  ///< What the distance of two axes (as unit vectors) is multiplied with.
  double diameter_mm_ = 0;
};

/// The symmetry that poses are judged by: what the class's scanner can tell, as training decides it.
vision::Symmetry judged_symmetry(const vision::Mesh& mesh, double noise_mm);
}  // namespace binpick::bench
