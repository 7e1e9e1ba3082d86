#include "vision/grasp.hpp"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <limits>
#include <numbers>

#include "vision/clearance.hpp"
#include "vision/overlaps.hpp"

namespace binpick::vision {
namespace {
constexpr double kDegree = std::numbers::pi / 180.0;
constexpr double kRevolutionStep = 15 * kDegree;
/// Probabilities closer than this are equal; then the higher object goes first, as nothing lies on it.
constexpr double kProbabilityStep = 0.02;
constexpr double kHoldsMm = 3, kHoldsRad = 3 * kDegree;
/// More room than so many clearances is not asked for.
constexpr std::array kRoom{4.0, 2.0, 1.0};
/// The clearance where none is given, in standard deviations of a height. It is the least: where there is more room, a
/// grasp goes first.
constexpr double kClearanceNoises = 0.3;
/// Free grasps of one detection that are looked at for more room.
constexpr int kFreeMax = 12;
/// Grasps elsewhere on the object that are looked at for one that is free as well.
constexpr int kOthersMax = 24;
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

/// A grasp in one of its poses.
struct Candidate {
  std::size_t grasp = 0;
  std::size_t pose = 0;  ///< Of poses_of().
  Eigen::Isometry3d T_supply_tcp;
  double tilt_rad = 0;
};

Eigen::Isometry3d approach_of(const Candidate& candidate, const std::vector<Grasp>& grasps) {
  return candidate.T_supply_tcp * Eigen::Translation3d(0, 0, -grasps[candidate.grasp].approach_mm);
}

/// As far up as the approach pose stands off.
Transform<frame::Supply, frame::Tcp> lifted(const Candidate& candidate, const std::vector<Grasp>& grasps,
                                            const Eigen::Vector3d& up) {
  return {Eigen::Translation3d{grasps[candidate.grasp].approach_mm * up} * candidate.T_supply_tcp};
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
    if (limits.radius_max_mm > 0 && at.norm() > limits.radius_max_mm)
      return rejected(Obstacle::Reach, at.norm(), limits.radius_max_mm, "the base");
    if (at.head<2>().norm() < limits.axis_min_mm)
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

/// Fine enough to tell how wide one object covers another, and no more than some hundred pixels across.
double fine_pixel_mm(const GripperScene& scene) {
  constexpr double kAcrossMax = 360;
  Eigen::AlignedBox3f extents;
  for (const auto& vertex : scene.part.vertices_mm) extents.extend(vertex);
  return std::max(scene.image.pixel_mm / 3, static_cast<double>(extents.sizes().norm()) / kAcrossMax);
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

/// What one scan says of all its grasps.
class Checks {
 public:
  Checks(const DetectionReport& report, const std::vector<Grasp>& grasps, const SupplyBox& supply,
         const ReachLimits& limits, const GripperScene& scene)
      : report_{report},
        grasps_{grasps},
        supply_{supply},
        scene_{scene},
        clearance_mm_{limits.clearance_mm.value_or(kClearanceNoises * scene.noise_mm)},
        part_{scene.part},
        around_{scene.image, supply, part_, report.detections, scene.noise_mm},
        holes_{limits.unmeasured == Unmeasured::Blocked},
        highest_mm_{static_cast<double>(around_.highest_mm())},
        overlaps_mm_{vision::overlaps_mm(part_, report.detections, fine_pixel_mm(scene))},
        up_{limits.T_base_supply.iso.linear().transpose() * Eigen::Vector3d::UnitZ()},
        hits_part_(grasps.size()) {
    for (const Grasp& grasp : grasps) sweepers_.push_back(sweepers_of(scene.gripper, grasp));
  }

  /// Takes up the next detection.
  void begin(std::size_t detection, const std::vector<Candidate>& candidates) {
    detection_ = detection;
    // As wide as anything of the gripper reaches that is not above all.
    Eigen::AlignedBox2d window;
    for (const Candidate& candidate : candidates)
      for (const Gripper::Solid& solid : sweepers_[candidate.grasp]) {
        const Eigen::AlignedBox3d box = box_of(solid, candidate, kRoom.front());
        if (box.min().z() < highest_mm_) {
          window.extend(Eigen::Vector2d{box.min().head<2>()});
          window.extend(Eigen::Vector2d{box.max().head<2>()});
        }
      }
    if (slants_) {
      // And as the part on its way out.
      Eigen::AlignedBox3d part;
      const Eigen::Isometry3d& T = report_.detections[detection].T_supply_object.iso;
      for (const auto& vertex : scene_.part.vertices_mm) part.extend(T * vertex.cast<double>());
      for (const Candidate& candidate : candidates) {
        const Eigen::AlignedBox3d out = part.merged(part.translated(lift_mm(grasps_[candidate.grasp]) * up_));
        window.extend(Eigen::Vector2d{out.min().head<2>()});
        window.extend(Eigen::Vector2d{out.max().head<2>()});
      }
    }
    if (window.isEmpty()) window.extend(Eigen::Vector2d{candidates.front().T_supply_tcp.translation().head<2>()});
    // What stands beside it may hide something within.
    const Eigen::Vector2d margin = Eigen::Vector2d::Constant(0.4 * std::min(highest_mm_, kHiddenMm));
    heights_ = around_.without(detection, {window.min() - margin, window.max() + margin});
    lower_side_.reset();
    covered_mm_ = std::max(overlaps_mm_[detection], around_.covered_mm(detection));
  }

  /// None: it is free, with `clearance_mm` around it.
  RejectedGrasp check(const Candidate& candidate, double& clearance_mm) {
    RejectedGrasp found{detection_, candidate.grasp, candidate.pose};
    const Grasp& grasp = grasps_[candidate.grasp];
    std::optional<bool>& itself = hits_part_[candidate.grasp];
    // Meshes are simplified by up to a third of the noise.
    if (!itself) itself = hits_part(scene_.gripper, grasp, scene_.part, 0.2 + scene_.noise_mm / 3);
    if (*itself) {
      found.why = Obstacle::Itself;
      return found;
    }
    if (covered_mm_ > kCoveredMaxNoises * scene_.noise_mm) {
      found.why = Obstacle::Covered;
      found.value = covered_mm_;
      return found;
    }
    if (const Contact hit = contact_of_gripper(candidate, 1, holes_); hit.with != Obstacle::None) {
      found.why = hit.with, found.value = hit.depth_mm;
      return found;
    }
    if (slants_ && !lower_side_) lower_side_ = around_.lower_side(detection_);
    if (slants_)
      if (const Contact hit = contact_of_part(*lower_side_, scene_.image.origin_mm, up_, lift_mm(grasp),
                                              kSlackNoises * scene_.noise_mm, heights_, supply_);
          hit.with != Obstacle::None) {
        found.why = hit.with, found.value = hit.depth_mm;
        return found;
      }
    // Here what may stand in a hole counts in any case: if it is allowed, it is still the last choice.
    for (const double times : kRoom)
      if ((times == 1 && holes_) || contact_of_gripper(candidate, times, true).with == Obstacle::None) {
        clearance_mm = times * clearance_mm_;
        break;
      }
    return found;
  }
  /// How far others may reach over the detection; 0: hardly.
  double covered_mm() const { return covered_mm_ > kCoveredNoises * scene_.noise_mm ? covered_mm_ : 0; }
  bool is_tight(double clearance_mm) const { return clearance_mm <= clearance_mm_; }
  bool is_roomy(double clearance_mm) const { return clearance_mm >= kRoom.front() * clearance_mm_; }

 private:
  /// Something that a shadow hides deeper than this is not met by jaws.
  static constexpr double kHiddenMm = 100;
  static constexpr double kSlackNoises = 1;
  /// What reaches farther over an object lies on it, and would be lifted with it; from the lesser width on it may.
  static constexpr double kCoveredMaxNoises = 2, kCoveredNoises = 0.3;

  /// To the approach pose, from the grasp.
  Eigen::Vector3d way_in(const Candidate& candidate) const {
    return -grasps_[candidate.grasp].approach_mm * candidate.T_supply_tcp.linear().col(2);
  }
  /// As far along up_ as the part has to pass.
  double lift_mm(const Grasp& grasp) const {
    constexpr double kSteepest = 0.1;
    const double out_mm = std::max(highest_mm_, supply_.size_mm.z()) / std::max(up_.z(), kSteepest);
    return grasp.retreat_mm > 0 ? grasp.retreat_mm : out_mm;
  }
  Eigen::AlignedBox3d box_of(const Gripper::Solid& solid, const Candidate& candidate, double times) const {
    const Eigen::Isometry3d T = candidate.T_supply_tcp * solid.T_tcp_solid;
    const Eigen::Vector3d half = T.linear().cwiseAbs() * (0.5 * solid.size_mm.array() + times * clearance_mm_).matrix();
    const Eigen::AlignedBox3d end{T.translation() - half, T.translation() + half};
    Eigen::AlignedBox3d box = end.merged(end.translated(way_in(candidate)));
    if (!slants_) return box;
    const Eigen::AlignedBox3d above = box.translated(lift_mm(grasps_[candidate.grasp]) * up_);
    return box.merged(above);
  }
  /// The first that is found: jaws are asked before the body.
  Contact contact_of_gripper(const Candidate& candidate, double times, bool holes) const {
    for (const Gripper::Solid& solid : sweepers_[candidate.grasp]) {
      if (box_of(solid, candidate, times).min().z() >= std::max(highest_mm_, supply_.size_mm.z())) continue;
      const Swept in{solid, candidate.T_supply_tcp, way_in(candidate), times * clearance_mm_};
      if (const Contact found = contact(in, heights_, supply_, holes); found.with != Obstacle::None) return found;
      if (!slants_) continue;
      // Down to the approach pose, and up from the grasp.
      const Eigen::Vector3d lift = lift_mm(grasps_[candidate.grasp]) * up_;
      for (const Eigen::Isometry3d& T : {approach_of(candidate, grasps_), candidate.T_supply_tcp}) {
        const Swept upright{solid, T, lift, times * clearance_mm_};
        if (const Contact found = contact(upright, heights_, supply_, holes); found.with != Obstacle::None)
          return found;
      }
    }
    return {};
  }

  const DetectionReport& report_;
  const std::vector<Grasp>& grasps_;
  const SupplyBox& supply_;
  const GripperScene& scene_;
  double clearance_mm_;
  Rasteriser part_;
  Surroundings around_;
  bool holes_;  ///< Block the way.
  double highest_mm_;
  std::vector<double> overlaps_mm_;  ///< Of each detection: how far others reach over it.
  Eigen::Vector3d up_;               ///< The arm's way out.
  /// Where the supply stands level, a way straight up is as free as its beginning: all is solid from its surface down.
  bool slants_ = up_.head<2>().norm() > 1e-3 || up_.z() < 0;
  std::vector<std::vector<Gripper::Solid>> sweepers_;  ///< Of each grasp.
  std::vector<std::optional<bool>> hits_part_;
  std::size_t detection_ = 0;
  Heights heights_;
  std::optional<Template> lower_side_;
  double covered_mm_ = 0;
};

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
  const Eigen::Vector3d up = limits.T_base_supply.iso.linear().transpose() * Eigen::Vector3d::UnitZ();
  std::optional<Checks> checks;
  if (scene != nullptr && !report.detections.empty()) checks.emplace(report, grasps, supply, limits, *scene);
  GraspChoice choice;
  std::vector<Candidate> candidates;
  for (std::size_t d = 0; d < report.detections.size(); ++d) {
    RejectedGrasp farthest{d, 0, 0, Obstacle::NoGrasp};
    const auto reject = [&](RejectedGrasp rejected) {
      rejected.detection = d;
      if (got_farther(rejected, farthest)) farthest = rejected;
      choice.rejected.push_back(rejected);
    };
    candidates.clear();
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
  std::vector<long> holds;
  for (const Detection& d : report.detections)
    holds.push_back(std::lround(probability_of_holding(d, symmetry) / kProbabilityStep));
  std::stable_sort(choice.reachable.begin(), choice.reachable.end(), [&](const Reachable& a, const Reachable& b) {
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
