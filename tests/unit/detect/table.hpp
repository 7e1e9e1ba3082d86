#pragma once

#include <cstdint>
#include <limits>
#include <numbers>
#include <random>
#include <vector>

#include "tests/unit/detect/shapes.hpp"
#include "vision/grasp.hpp"
#include "vision/rasteriser.hpp"

/// A table of bars, a gripper with two jaws, and the picture that a scanner without shadows would have.
namespace binpick::vision::table {
using Eigen::Vector3d;
inline constexpr double kPi = std::numbers::pi;
inline constexpr double kNoiseMm = 0.2;
inline const SupplyBox kSupply{{300, 240, 80}};

/// A bar of 60 × 20 × 20 mm, its middle at the origin.
inline Mesh bar() {
  Mesh mesh;
  shapes::add_box(mesh, {-30, -10, -10}, {30, 10, 10});
  return mesh;
}

/// A block of 60 × 60 × 20 mm with a bore of 30 × 30 mm, of four pieces.
inline Mesh frame_part() {
  Mesh mesh;
  shapes::add_box(mesh, {-30, -30, -10}, {-15, 30, 10});
  shapes::add_box(mesh, {15, -30, -10}, {30, 30, 10});
  shapes::add_box(mesh, {-15, -30, -10}, {15, -15, 10});
  shapes::add_box(mesh, {-15, 15, -10}, {15, 30, 10});
  return mesh;
}

/// Two jaws of 8 × 12 × 40 mm that open to 44 mm, under a palm of 60 × 40 × 30 mm.
inline Gripper two_jaws() {
  Gripper gripper;
  gripper.jaws = Gripper::Jaws{44, {8, 12, 40}, 6};
  Gripper::Solid palm;
  palm.size_mm = {60, 40, 30};
  palm.T_tcp_solid.translation().z() = 6 - 40 - 15;
  gripper.body = {palm};
  return gripper;
}

/// From above, the jaws along the object's y.
inline Grasp across_bar(double tilt_rad = 0) {
  Grasp grasp;
  grasp.name = "across";
  grasp.T_object_tcp.iso.linear() =
      (Eigen::AngleAxisd(kPi, Vector3d::UnitX()) * Eigen::AngleAxisd(kPi / 2, Vector3d::UnitZ()) *
       Eigen::AngleAxisd(tilt_rad, Vector3d::UnitY()))
          .toRotationMatrix();
  grasp.T_object_tcp.iso.translation() = Vector3d(0, 0, 2);
  grasp.opening_mm = 36;
  grasp.holding_mm = 20;
  grasp.approach_mm = 60;
  return grasp;
}

inline ReachLimits usual() {
  ReachLimits limits;
  limits.clearance_mm = kNoiseMm;
  return limits;
}

/// What lies in the supply, the picture of it, and what was found.
struct Table {
  explicit Table(const Mesh& mesh) : part{mesh}, rasteriser{mesh} {
    image.pixel_mm = 1;
    image.origin_mm = -0.5 * kSupply.size_mm.head<2>() + Eigen::Vector2d{0.5, 0.5};
    image.z_mm.setZero(240, 300);
  }
  /// Seen, and found if it is said so.
  void lay(const Vector3d& at, double turn_rad = 0, double tilt_rad = 0, bool found = true) {
    lay(Eigen::Translation3d{at} * Eigen::AngleAxisd(turn_rad, Vector3d::UnitZ()) *
            Eigen::AngleAxisd(tilt_rad, Vector3d::UnitX()),
        found);
  }
  void lay(const Eigen::Isometry3d& T_supply_object, bool found = true) {
    Detection detection;
    detection.T_supply_object.iso = T_supply_object;
    detection.score = 0.95;
    Template drawn;
    rasteriser.draw(T_supply_object.linear().cast<float>(), T_supply_object.translation().cast<float>(), image.pixel_mm,
                    image.origin_mm, drawn);
    for (int r = 0; r < drawn.rows; ++r)
      for (int c = 0; c < drawn.cols; ++c) {
        float& z = image.z_mm(r + drawn.row0, c + drawn.col0);
        if (drawn.triangle[drawn.at(r, c)] >= 0) z = std::max(z, drawn.top_mm[drawn.at(r, c)]);
      }
    if (found) report.detections.push_back(detection);
  }
  void lay_block(double x0, double x1, double y0, double y1, float z) {
    for (Eigen::Index r = 0; r < image.z_mm.rows(); ++r)
      for (Eigen::Index c = 0; c < image.z_mm.cols(); ++c) {
        const double x = image.origin_mm.x() + static_cast<double>(c), y = image.origin_mm.y() + static_cast<double>(r);
        if (x >= x0 && x <= x1 && y >= y0 && y <= y1) image.z_mm(r, c) = z;
      }
  }
  void add_noise(std::uint32_t seed) {
    std::mt19937 random{seed};
    std::normal_distribution<float> noise{0, static_cast<float>(kNoiseMm)};
    for (Eigen::Index i = 0; i < image.z_mm.size(); ++i) image.z_mm.data()[i] += noise(random);
  }
  GraspChoice choose(const std::vector<Grasp>& grasps, const ReachLimits& limits = usual(),
                     const Gripper& gripper = two_jaws(), const Symmetry& symmetry = {}) const {
    const GripperScene scene{image, part, kNoiseMm, gripper};
    return choose_grasps(report, symmetry, grasps, kSupply, limits, &scene);
  }
  /// Of the first detection.
  Obstacle why_not(const Grasp& grasp, const ReachLimits& limits = usual(), const Gripper& gripper = two_jaws()) const {
    const GraspChoice choice = choose({grasp}, limits, gripper);
    for (const Reachable& free : choice.reachable)
      if (free.detection == 0) return Obstacle::None;
    for (const Unreachable& unreachable : choice.unreachable)
      if (unreachable.detection == 0) return unreachable.why;
    return Obstacle::NoGrasp;
  }

  Mesh part;
  Rasteriser rasteriser;
  DepthImage image;
  DetectionReport report;
};
inline constexpr float kHole = std::numeric_limits<float>::quiet_NaN();
}  // namespace binpick::vision::table
