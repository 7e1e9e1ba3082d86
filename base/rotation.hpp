#pragma once

#include <Eigen/Core>

/// Rotations as the makers of robots write them. `R` is the rotation of the tool in the base, p_base = R * p_tool, and
/// has to be orthonormal with determinant 1. All functions are pure; the singular cases have one defined answer.
namespace binpick {
/// Universal Robots: rotation vector, axis times angle, radians, length 0 … pi. Half a turn may come with either sign
/// of the axis: both are the same rotation.
Eigen::Vector3d to_rotation_vector(const Eigen::Matrix3d& R);
/// Any length: v and -(2 pi - |v|) v / |v| are the same rotation.
Eigen::Matrix3d from_rotation_vector(const Eigen::Vector3d& v_rad);

/// Fanuc: W, P, R in degrees, R = Rz(R) Ry(P) Rx(W) (fixed axes x, y, z). P within ±90; at P = ±90 only W ∓ R is
/// defined, and R is 0. Angles in our own files (rpy_deg) are the same three.
Eigen::Vector3d to_wpr_deg(const Eigen::Matrix3d& R);
Eigen::Matrix3d from_wpr_deg(const Eigen::Vector3d& wpr_deg);

/// Kawasaki: O, A, T in degrees, R = Rz(O) Ry(A) Rz(T). A within 0 … 180; at both ends only O ± T is defined, and T is
/// 0. A tool that points straight down is such an end, so in bin picking it is the usual case.
Eigen::Vector3d to_oat_deg(const Eigen::Matrix3d& R);
Eigen::Matrix3d from_oat_deg(const Eigen::Vector3d& oat_deg);
}  // namespace binpick
