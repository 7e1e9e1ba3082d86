#include "vision/grasp.hpp"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <limits>
#include <numbers>

namespace binpick::vision {
namespace {
constexpr double kDegree = std::numbers::pi / 180.0;
constexpr double kRevolutionStep = 15 * kDegree;
/// Probabilities closer than this are equal; then the higher object goes first, as nothing lies on it.
constexpr double kProbabilityStep = 0.02;
constexpr double kHoldsMm = 3, kHoldsRad = 3 * kDegree;
/// Makes millimetres outside a wall and radians over the tilt limit comparable, to name the least bad grasp.
constexpr double kMillimetresPerRadian = 200.0;

Eigen::Matrix3d turn(double angle_rad, const Eigen::Vector3d& axis) {
  return Eigen::AngleAxisd(angle_rad, axis).toRotationMatrix();
}

/// Turns about the symmetry's centre that change nothing one could see; a continuous group in steps of 15 degrees.
std::vector<Eigen::Matrix3d> equivalent_turns(const Symmetry& symmetry) {
  if (symmetry.kind == Symmetry::Kind::None) return {Eigen::Matrix3d::Identity()};
  if (symmetry.kind == Symmetry::Kind::Finite) return symmetry.rotations;
  std::vector<Eigen::Matrix3d> across{Eigen::Matrix3d::Identity()};
  const Eigen::Vector3d perpendicular = symmetry.axis.unitOrthogonal();
  if (symmetry.kind == Symmetry::Kind::RevolutionFlip) across.push_back(turn(std::numbers::pi, perpendicular));
  if (symmetry.kind == Symmetry::Kind::Sphere)
    for (int k = 1; k <= 6; ++k) across.push_back(turn(30 * kDegree * k, perpendicular));
  std::vector<Eigen::Matrix3d> turns;
  const int steps = static_cast<int>(std::lround(2 * std::numbers::pi / kRevolutionStep));
  for (int k = 0; k < steps; ++k)
    for (const Eigen::Matrix3d& a : across) turns.push_back(turn(k * kRevolutionStep, symmetry.axis) * a);
  return turns;
}

Eigen::Isometry3d about(const Eigen::Vector3d& centre_mm, const Eigen::Matrix3d& R) {
  Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  T.linear() = R;
  T.translation() = centre_mm - R * centre_mm;
  return T;
}

struct Obstacle {
  double badness = 0;  ///< 0: reachable.
  std::string reason;
};

Obstacle obstacle(const Eigen::Isometry3d& T_supply_tcp, double tilt_rad, const SupplyBox& supply,
                  const ReachLimits& limits) {
  std::array<char, 120> text{};
  if (tilt_rad > limits.tilt_max_rad) {
    std::snprintf(text.data(), text.size(), "tilt %.0f deg is over %.0f deg", tilt_rad / kDegree,
                  limits.tilt_max_rad / kDegree);
    return {(tilt_rad - limits.tilt_max_rad) * kMillimetresPerRadian, text.data()};
  }
  if (supply.size_mm.x() <= 0 || supply.size_mm.y() <= 0) return {};
  constexpr std::array<const char*, 2> kMin{"wall x min", "wall y min"}, kMax{"wall x max", "wall y max"};
  Obstacle worst;
  for (std::size_t axis = 0; axis < 2; ++axis) {
    const auto at = static_cast<Eigen::Index>(axis);
    const double position = T_supply_tcp.translation()[at];
    const double outside = std::abs(position) - (0.5 * supply.size_mm[at] - limits.wall_clearance_mm);
    if (outside <= 1e-9 || outside <= worst.badness) continue;
    const char* wall = position > 0 ? kMax[axis] : kMin[axis];
    if (limits.wall_clearance_mm > 0)
      std::snprintf(text.data(), text.size(), "tcp %.0f mm too near to or outside the %s (clearance %.0f mm)", outside,
                    wall, limits.wall_clearance_mm);
    else
      std::snprintf(text.data(), text.size(), "tcp %.0f mm outside the %s", outside, wall);
    worst = {outside, text.data()};
  }
  return worst;
}

/// Of a normal error, in the direction in which it is largest.
double within(double limit, const Eigen::Matrix3d& covariance) {
  const double variance =
      Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>{covariance, Eigen::EigenvaluesOnly}.eigenvalues().maxCoeff();
  if (!(variance >= 0)) return 0;  // not a number
  return variance > 0 ? std::erf(limit / std::sqrt(2 * variance)) : 1;
}
}  // namespace

double probability_of_holding(const Detection& detection, const Symmetry& symmetry) {
  Eigen::Matrix3d turn = detection.covariance.bottomRightCorner<3, 3>();
  if (symmetry.kind == Symmetry::Kind::Revolution || symmetry.kind == Symmetry::Kind::RevolutionFlip) {
    const Eigen::Vector3d axis = detection.T_supply_object.iso.linear() * symmetry.axis;
    const Eigen::Matrix3d across = Eigen::Matrix3d::Identity() - axis * axis.transpose();
    turn = across * turn * across;
  }
  if (symmetry.kind == Symmetry::Kind::Sphere) turn.setZero();
  return detection.score * within(kHoldsMm, detection.covariance.topLeftCorner<3, 3>()) * within(kHoldsRad, turn);
}

GraspChoice choose_grasps(const DetectionReport& report, const Symmetry& symmetry, const std::vector<Grasp>& grasps,
                          const SupplyBox& supply, const ReachLimits& limits) {
  const std::vector<Eigen::Matrix3d> turns = equivalent_turns(symmetry);
  GraspChoice choice;
  for (std::size_t d = 0; d < report.detections.size(); ++d) {
    std::optional<Reachable> best;
    double best_tilt = 0;
    Obstacle least{std::numeric_limits<double>::infinity(), "the part has no grasp; add a [[grasp]] to its file"};
    for (std::size_t g = 0; g < grasps.size(); ++g)
      for (const Eigen::Matrix3d& R : turns) {
        const Eigen::Isometry3d T_supply_tcp =
            report.detections[d].T_supply_object.iso * about(symmetry.centre_mm, R) * grasps[g].T_object_tcp.iso;
        const Eigen::Vector3d approach = T_supply_tcp.linear().col(2);
        const double tilt = std::atan2(approach.head<2>().norm(), -approach.z());
        Obstacle found = obstacle(T_supply_tcp, tilt, supply, limits);
        if (found.badness > 0) {
          if (found.badness < least.badness) least = std::move(found);
          continue;
        }
        // The first of equally steep grasps: the integrator's order is a preference.
        if (best && tilt >= best_tilt - 1e-6) continue;
        best_tilt = tilt;
        best = Reachable{d, g, {T_supply_tcp}, {T_supply_tcp * Eigen::Translation3d(0, 0, -grasps[g].approach_mm)}};
      }
    if (best)
      choice.reachable.push_back(*best);
    else
      choice.unreachable.push_back({d, least.reason});
  }
  std::vector<long> holds;
  for (const Detection& d : report.detections)
    holds.push_back(std::lround(probability_of_holding(d, symmetry) / kProbabilityStep));
  std::stable_sort(choice.reachable.begin(), choice.reachable.end(), [&](const Reachable& a, const Reachable& b) {
    if (holds[a.detection] != holds[b.detection]) return holds[a.detection] > holds[b.detection];
    return a.T_supply_grasp.iso.translation().z() > b.T_supply_grasp.iso.translation().z();
  });
  return choice;
}
}  // namespace binpick::vision
