#pragma once

#include <Eigen/Geometry>

/// Rigid transforms that know their frames: T_a_b maps coordinates in b to coordinates in a, p_a = T_a_b * p_b.
namespace binpick {
namespace frame {
struct Base;     ///< Robot base, z up.
struct Flange;   ///< The robot's tool flange.
struct Tcp;      ///< Tool centre point; z points out of the tool, the way it approaches.
struct Pivot;    ///< Pivot at angle zero; z is the axis of rotation, positive angles counter-clockwise about it.
struct Scanner;  ///< Optical centre of the line scanner; x and z span the scan plane, z points straight ahead, y
                 ///< normal.
struct Supply;   ///< The charge carrier: origin in the middle of its floor, z up, x and y along its walls.
struct Object;   ///< The mesh's own frame.
}  // namespace frame

/// Rigid transform with p_to = T_to_from * p_from; translation in millimetres.
/// A product whose inner frames differ does not compile.
template <class To, class From>
struct Transform {
  Eigen::Isometry3d iso = Eigen::Isometry3d::Identity();

  Transform<From, To> inverse() const { return {iso.inverse()}; }
  Eigen::Vector3d operator*(const Eigen::Vector3d& p_from) const { return iso * p_from; }
};

template <class A, class B, class C>
Transform<A, C> operator*(const Transform<A, B>& T_a_b, const Transform<B, C>& T_b_c) {
  return {T_a_b.iso * T_b_c.iso};
}
}  // namespace binpick
