#include "vision/grasp.hpp"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <limits>
#include <numbers>

#include "vision/grasp_checks.hpp"
#include "vision/ways_out.hpp"

namespace binpick::vision {
namespace {
constexpr double kDegree = std::numbers::pi / 180.0;
constexpr double kRevolutionStep = 15 * kDegree;
/// Probabilities closer than this are equal; then the higher object goes first, as nothing lies on it.
constexpr double kProbabilityStep = 0.02;
constexpr double kHoldsMm = 3, kHoldsRad = 3 * kDegree;
/// Free grasps of one detection that are looked at for more room.
constexpr int kFreeMax = 12;
/// Grasps elsewhere on the object that are looked at for one that is free as well.
constexpr int kOthersMax = 24;
/// Grasps and ways that are looked at for an object that has to be drawn out aslant.
constexpr std::size_t kAslantMax = 12;
constexpr double kSameWayMm = 10, kSameWayRad = 10 * kDegree;
/// Tilts that differ by less than one over this are equal.
constexpr double kTiltSteps = 1e5;

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

/// As far up as the approach pose stands off.
Transform<frame::Supply, frame::Tcp> lifted(const Candidate& candidate, const std::vector<Grasp>& grasps,
                                            const Eigen::Vector3d& up) {
  return {Eigen::Translation3d{grasps[candidate.grasp].approach_mm * up} * candidate.T_supply_tcp};
}

/// Of a place in the base's frame.
bool is_too_far(const Eigen::Vector3d& at_mm, const ReachLimits& limits) {
  return limits.radius_max_mm > 0 && at_mm.norm() > limits.radius_max_mm;
}
bool is_too_near(const Eigen::Vector3d& at_mm, const ReachLimits& limits) {
  return at_mm.head<2>().norm() < limits.axis_min_mm;
}

RejectedGrasp beyond_limits(const Candidate& candidate, const Grasp& grasp, const SupplyBox& supply,
                            const ReachLimits& limits) {
  RejectedGrasp found;
  found.grasp = candidate.grasp;
  found.pose = candidate.pose;
  const auto rejected = [&](Obstacle why, double value, double limit, const char* place = "") {
    found.why = why, found.value = value, found.limit = limit, found.place = place;
    return found;
  };
  if (candidate.tilt_rad > limits.tilt_max_rad)
    return rejected(Obstacle::Tilt, candidate.tilt_rad, limits.tilt_max_rad);
  for (const double back_mm : {0.0, grasp.approach_mm}) {
    const Eigen::Vector3d at = limits.T_base_supply.iso * (candidate.T_supply_tcp * Eigen::Vector3d(0, 0, -back_mm));
    if (is_too_far(at, limits)) return rejected(Obstacle::Reach, at.norm(), limits.radius_max_mm, "the base");
    if (is_too_near(at, limits))
      return rejected(Obstacle::Reach, at.head<2>().norm(), limits.axis_min_mm, "the base's z axis");
  }
  if (supply.size_mm.x() <= 0 || supply.size_mm.y() <= 0) return found;
  constexpr std::array<const char*, 2> kMin{"wall x min", "wall y min"}, kMax{"wall x max", "wall y max"};
  for (std::size_t axis = 0; axis < 2; ++axis) {
    const auto at = static_cast<Eigen::Index>(axis);
    const double position = candidate.T_supply_tcp.translation()[at];
    const double outside = std::abs(position) - (0.5 * supply.size_mm[at] - limits.wall_clearance_mm);
    if (outside > 1e-9 && outside > found.value)
      rejected(Obstacle::Wall, outside, limits.wall_clearance_mm, position > 0 ? kMax[axis] : kMin[axis]);
  }
  return found;
}

/// Of two rejected ones, that which got farther in the tests. Of those that leave the limits the one that does so
/// least; the others come in the order of their rank.
bool got_farther(const RejectedGrasp& a, const RejectedGrasp& b) {
  const auto stage = [](const RejectedGrasp& r) {
    const bool gripper_at_wall = r.why == Obstacle::Wall && r.place.empty();
    return gripper_at_wall || r.why > Obstacle::Covered ? Obstacle::Floor : r.why;
  };
  if (stage(a) != stage(b)) return stage(a) > stage(b);
  return stage(a) < Obstacle::Itself && std::abs(a.value - a.limit) < std::abs(b.value - b.limit);
}

/// Objects that hang in others and so cannot be lifted straight up: by a grasp along a way on which they pass them.
void add_aslant(GraspChecks& checks, const std::vector<std::vector<Candidate>>& candidates,
                const std::vector<Grasp>& grasps, const ReachLimits& limits, GraspChoice& choice) {
  std::vector<bool> wanted(candidates.size(), false);
  for (const Unreachable& one : choice.unreachable)
    wanted[one.detection] = one.why == Obstacle::Covered && !candidates[one.detection].empty();
  const std::vector<std::vector<WayOut>> ways = checks.ways_past_others(wanted);
  const auto is_reached = [&](const Candidate& candidate, const WayOut& way) {
    const Eigen::Vector3d at = limits.T_base_supply.iso * (candidate.T_supply_tcp.translation() + way.way_mm);
    return !is_too_far(at, limits) && !is_too_near(at, limits);
  };
  /// Both from the same object, on ways that differ.
  const auto is_other = [](const Reachable& first, const Candidate& candidate, const WayOut& way) {
    const Eigen::Vector3d before = first.T_supply_retreat.iso.translation() - first.T_supply_grasp.iso.translation();
    return !is_same_way({candidate.T_supply_tcp}, first.T_supply_grasp) ||
           before.normalized().dot(way.way_mm.normalized()) < std::cos(kSameWayRad);
  };
  const auto taken_aslant = [&](std::size_t d) {
    if (ways[d].empty()) return false;
    checks.begin(d, candidates[d], ways[d]);
    std::vector<Candidate> free;
    for (const Candidate& candidate : candidates[d])
      if (free.size() < kAslantMax && checks.is_free_in(candidate)) free.push_back(candidate);
    std::optional<Reachable> found;
    std::size_t passed = 0;
    for (const WayOut& way : ways[d]) {
      if (free.empty() || passed >= kAslantMax || (found && found->other)) break;
      if (!checks.part_passes(way)) continue;
      ++passed;
      for (const Candidate& candidate : free) {
        if (found && !is_other(*found, candidate, way)) continue;
        if (!is_reached(candidate, way) || !checks.is_free_along(candidate, way)) continue;
        const Reachable::Other taken{candidate.grasp,
                                     {candidate.T_supply_tcp},
                                     {approach_of(candidate, grasps)},
                                     {Eigen::Translation3d{way.way_mm} * candidate.T_supply_tcp}};
        if (found) {
          found->other = taken;
          break;
        }
        found = Reachable{d, taken.grasp, taken.T_supply_grasp, taken.T_supply_approach, taken.T_supply_retreat};
        found->covered_mm = checks.told_mm(way.covered_mm);
        found->is_aslant = true;
      }
    }
    if (found) choice.reachable.push_back(*found);
    return found.has_value();
  };
  std::erase_if(choice.unreachable,
                [&](const Unreachable& one) { return one.why == Obstacle::Covered && taken_aslant(one.detection); });
}

/// Of a normal error, in the direction in which it is largest.
double within(double limit, const Eigen::Matrix3d& covariance) {
  const double variance =
      Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>{covariance, Eigen::EigenvaluesOnly}.eigenvalues().maxCoeff();
  if (!(variance >= 0)) return 0;  // not a number
  return variance > 0 ? std::erf(limit / std::sqrt(2 * variance)) : 1;
}
}  // namespace

bool is_same_way(const Transform<frame::Supply, frame::Tcp>& a, const Transform<frame::Supply, frame::Tcp>& b) {
  return (a.iso.translation() - b.iso.translation()).norm() < kSameWayMm &&
         a.iso.linear().col(2).dot(b.iso.linear().col(2)) > std::cos(kSameWayRad);
}

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

std::vector<Eigen::Isometry3d> poses_of(const Grasp& grasp, const Transform<frame::Supply, frame::Object>& object,
                                        const Symmetry& symmetry) {
  std::vector<Eigen::Isometry3d> poses;
  for (const Eigen::Matrix3d& R : equivalent_turns(symmetry))
    poses.push_back(object.iso * about(symmetry.centre_mm, R) * grasp.T_object_tcp.iso);
  return poses;
}

GraspChoice choose_grasps(const DetectionReport& report, const Symmetry& symmetry, const std::vector<Grasp>& grasps,
                          const SupplyBox& supply, const ReachLimits& limits, const GripperScene* scene) {
  if (limits.unmeasured == Unmeasured::Last) {
    ReachLimits narrower = limits;
    narrower.unmeasured = Unmeasured::Blocked;
    const GraspChoice choice = choose_grasps(report, symmetry, grasps, supply, narrower, scene);
    const auto in_holes = [](const RejectedGrasp& one) { return one.why == Obstacle::Unmeasured; };
    if (!choice.reachable.empty() || std::ranges::none_of(choice.rejected, in_holes)) return choice;
    narrower.unmeasured = Unmeasured::Free;
    return choose_grasps(report, symmetry, grasps, supply, narrower, scene);
  }
  const Eigen::Vector3d up = limits.T_base_supply.iso.linear().transpose() * Eigen::Vector3d::UnitZ();
  std::optional<GraspChecks> checks;
  if (scene != nullptr && !report.detections.empty()) checks.emplace(report, grasps, supply, limits, *scene);
  GraspChoice choice;
  std::vector<std::vector<Candidate>> candidates_of(report.detections.size());
  for (std::size_t d = 0; d < report.detections.size(); ++d) {
    RejectedGrasp farthest{d, 0, 0, Obstacle::NoGrasp};
    const auto reject = [&](RejectedGrasp rejected) {
      rejected.detection = d;
      if (got_farther(rejected, farthest)) farthest = rejected;
      choice.rejected.push_back(rejected);
    };
    std::vector<Candidate>& candidates = candidates_of[d];
    for (std::size_t g = 0; g < grasps.size(); ++g) {
      std::size_t pose = 0;
      for (const Eigen::Isometry3d& T : poses_of(grasps[g], report.detections[d].T_supply_object, symmetry)) {
        Candidate candidate{g, pose++, T};
        const Eigen::Vector3d approach = candidate.T_supply_tcp.linear().col(2);
        candidate.tilt_rad = std::atan2(approach.head<2>().norm(), -approach.z());
        const RejectedGrasp beyond = beyond_limits(candidate, grasps[g], supply, limits);
        if (beyond.why == Obstacle::None)
          candidates.push_back(candidate);
        else
          reject(beyond);
      }
    }
    // The first of equally steep grasps stays the first: the integrator's order is a preference, too.
    std::stable_sort(candidates.begin(), candidates.end(), [&](const Candidate& a, const Candidate& b) {
      if (grasps[a.grasp].preference != grasps[b.grasp].preference)
        return grasps[a.grasp].preference > grasps[b.grasp].preference;
      return std::lround(a.tilt_rad * kTiltSteps) < std::lround(b.tilt_rad * kTiltSteps);
    });
    if (checks && !candidates.empty()) checks->begin(d, candidates);
    std::optional<Reachable> best;
    int free = 0;
    for (const Candidate& candidate : candidates) {
      if (best && (free >= kFreeMax || grasps[candidate.grasp].preference < grasps[best->grasp].preference)) break;
      double clearance_mm = 0;
      if (checks)
        if (const RejectedGrasp hit = checks->check(candidate, clearance_mm); hit.why != Obstacle::None) {
          reject(hit);
          continue;
        }
      ++free;
      if (!best || clearance_mm > best->clearance_mm)
        best = Reachable{d,
                         candidate.grasp,
                         {candidate.T_supply_tcp},
                         {approach_of(candidate, grasps)},
                         lifted(candidate, grasps, up),
                         clearance_mm};
      if (!checks || checks->is_roomy(clearance_mm)) break;
    }
    if (best) {
      int looked = 0;
      for (const Candidate& candidate : candidates) {
        if (is_same_way({candidate.T_supply_tcp}, best->T_supply_grasp)) continue;
        if (++looked > kOthersMax) break;
        double clearance_mm = 0;
        if (checks && checks->check(candidate, clearance_mm).why != Obstacle::None) continue;
        best->other = Reachable::Other{
            candidate.grasp, {candidate.T_supply_tcp}, {approach_of(candidate, grasps)}, lifted(candidate, grasps, up)};
        break;
      }
    }
    if (best && checks) {
      best->covered_mm = checks->covered_mm();
      best->is_tight = checks->is_tight(best->clearance_mm);
    }
    if (best)
      choice.reachable.push_back(*best);
    else
      choice.unreachable.push_back({d, farthest.why, to_string(farthest)});
  }
  const bool is_sure =
      std::ranges::any_of(choice.reachable, [](const Reachable& one) { return one.covered_mm == 0 && !one.is_tight; });
  if (checks && !is_sure) add_aslant(*checks, candidates_of, grasps, limits, choice);
  std::vector<long> holds;
  for (const Detection& d : report.detections)
    holds.push_back(std::lround(probability_of_holding(d, symmetry) / kProbabilityStep));
  std::stable_sort(choice.reachable.begin(), choice.reachable.end(), [&](const Reachable& a, const Reachable& b) {
    if (a.is_aslant != b.is_aslant) return b.is_aslant;
    if (a.covered_mm != b.covered_mm) return a.covered_mm < b.covered_mm;
    if (a.is_tight != b.is_tight) return b.is_tight;
    if (holds[a.detection] != holds[b.detection]) return holds[a.detection] > holds[b.detection];
    if (grasps[a.grasp].preference != grasps[b.grasp].preference)
      return grasps[a.grasp].preference > grasps[b.grasp].preference;
    if (a.clearance_mm != b.clearance_mm) return a.clearance_mm > b.clearance_mm;
    return a.T_supply_grasp.iso.translation().z() > b.T_supply_grasp.iso.translation().z();
  });
  return choice;
}

std::string to_string(const RejectedGrasp& rejected) {
  std::array<char, 160> text{};
  const auto say = [&](const char* pattern, auto... values) {
    std::snprintf(text.data(), text.size(), pattern, values...);
    return std::string{text.data()};
  };
  switch (rejected.why) {
    case Obstacle::None:
      return "free";
    case Obstacle::NoGrasp:
      return "the part has no grasp; add a [[grasp]] to its file";
    case Obstacle::Tilt:
      return say("tilt %.0f deg is over %.0f deg", rejected.value / kDegree, rejected.limit / kDegree);
    case Obstacle::Reach:
      return say("tcp %.0f mm from %s, %s than %.0f mm", rejected.value, rejected.place.c_str(),
                 rejected.value > rejected.limit ? "more" : "less", rejected.limit);
    case Obstacle::Wall:
      if (rejected.place.empty()) return say("gripper or part %.0f mm within a wall or too near to it", rejected.value);
      if (rejected.limit > 0)
        return say("tcp %.0f mm too near to or outside the %s (clearance %.0f mm)", rejected.value,
                   rejected.place.c_str(), rejected.limit);
      return say("tcp %.0f mm outside the %s", rejected.value, rejected.place.c_str());
    case Obstacle::Itself:
      return "the gripper hits the part itself on its way in; correct opening_mm, T_object_tcp or the gripper";
    case Obstacle::Covered:
      return say("something lies on it, %.1f mm wide", rejected.value);
    case Obstacle::Floor:
      return say("gripper %.1f mm too near to the floor", rejected.value);
    case Obstacle::Neighbour:
      return say("gripper or part %.1f mm within what lies beside it", rejected.value);
    case Obstacle::Unmeasured:
      return say("gripper %.1f mm within what may stand where nothing was measured", rejected.value);
  }
  return "?";
}

Obstacle main_obstacle(const GraspChoice& choice) {
  std::array<int, 10> count{};
  for (const Unreachable& unreachable : choice.unreachable) ++count[static_cast<std::size_t>(unreachable.why)];
  const auto most = std::max_element(count.begin(), count.end());
  return *most > 0 ? static_cast<Obstacle>(most - count.begin()) : Obstacle::None;
}
}  // namespace binpick::vision
