#include "vision/grasp_checks.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "vision/overlaps.hpp"

namespace binpick::vision {
namespace {
/// More room than so many clearances is not asked for.
constexpr std::array kRoom{4.0, 2.0, 1.0};
/// The clearance where none is given, in standard deviations of a height. It is the least: where there is more room, a
/// grasp goes first.
constexpr double kClearanceNoises = 0.3;
/// Something that a shadow hides deeper than this is not met by jaws.
constexpr double kHiddenMm = 100;
constexpr double kSlackNoises = 1;
/// A supply whose z is nearer to the base's than this stands level as far as ways aslant go.
constexpr double kLevelRad = 0.0175;
/// Ways aslant are looked for with pixels so much coarser than what lies on an object.
constexpr double kAslantPixels = 2;

double diameter_mm(const Mesh& part) {
  Eigen::AlignedBox3f extents;
  for (const auto& vertex : part.vertices_mm) extents.extend(vertex);
  return static_cast<double>(extents.sizes().norm());
}

/// Fine enough to tell how wide one object covers another, and no more than some hundred pixels across.
double fine_pixel_mm(const GripperScene& scene) {
  constexpr double kAcrossMax = 360;
  return std::max(scene.image.pixel_mm / 3, diameter_mm(scene.part) / kAcrossMax);
}
}  // namespace

Eigen::Isometry3d approach_of(const Candidate& candidate, const std::vector<Grasp>& grasps) {
  return candidate.T_supply_tcp * Eigen::Translation3d(0, 0, -grasps[candidate.grasp].approach_mm);
}

GraspChecks::GraspChecks(const DetectionReport& report, const std::vector<Grasp>& grasps, const SupplyBox& supply,
                         const ReachLimits& limits, const GripperScene& scene)
    : report_{report},
      grasps_{grasps},
      supply_{supply},
      scene_{scene},
      clearance_mm_{limits.clearance_mm.value_or(kClearanceNoises * scene.noise_mm)},
      part_{scene.part},
      around_{scene.image, supply, part_, report.detections, scene.noise_mm},
      holes_{limits.unmeasured != Unmeasured::Free},
      highest_mm_{static_cast<double>(around_.highest_mm())},
      up_{limits.T_base_supply.iso.linear().transpose() * Eigen::Vector3d::UnitZ()},
      overlaps_mm_{vision::overlaps_mm(part_, report.detections, fine_pixel_mm(scene), up_)},
      slants_{up_.head<2>().norm() > 1e-3 || up_.z() < 0},
      hits_part_(grasps.size()) {
  for (const Grasp& grasp : grasps) sweepers_.push_back(sweepers_of(scene.gripper, grasp));
}

void GraspChecks::begin(std::size_t detection, const std::vector<Candidate>& candidates, std::span<const WayOut> ways) {
  detection_ = detection;
  Eigen::AlignedBox2d window;
  const auto extend = [&](const Eigen::AlignedBox3d& box) {
    window.extend(Eigen::Vector2d{box.min().head<2>()});
    window.extend(Eigen::Vector2d{box.max().head<2>()});
  };
  // As wide as anything of the gripper reaches that is not above all.
  for (const Candidate& candidate : candidates)
    for (const Gripper::Solid& solid : sweepers_[candidate.grasp]) {
      const Eigen::AlignedBox3d box = box_of(solid, candidate, kRoom.front());
      if (box.min().z() >= highest_mm_) continue;
      extend(box);
      for (const WayOut& way : ways) extend(box.translated(way.way_mm));
    }
  // And as the part on its way out.
  Eigen::AlignedBox3d part;
  const Eigen::Isometry3d& T = report_.detections[detection].T_supply_object.iso;
  for (const auto& vertex : scene_.part.vertices_mm) part.extend(T * vertex.cast<double>());
  if (slants_)
    for (const Candidate& candidate : candidates)
      extend(part.merged(part.translated(lift_mm(grasps_[candidate.grasp]) * up_)));
  for (const WayOut& way : ways) extend(part.merged(part.translated(way.way_mm)));
  if (window.isEmpty()) window.extend(Eigen::Vector2d{candidates.front().T_supply_tcp.translation().head<2>()});
  // What stands beside it may hide something within.
  const Eigen::Vector2d margin = Eigen::Vector2d::Constant(0.4 * std::min(highest_mm_, kHiddenMm));
  heights_ = around_.without(detection, {window.min() - margin, window.max() + margin});
  foreign_.reset();
  lower_side_.reset();
  covered_mm_ = std::max(overlaps_mm_[detection], around_.covered_mm(detection));
}

bool GraspChecks::is_roomy(double clearance_mm) const { return clearance_mm >= kRoom.front() * clearance_mm_; }

bool GraspChecks::hits_itself(const Candidate& candidate) {
  std::optional<bool>& itself = hits_part_[candidate.grasp];
  // Meshes are simplified by up to a third of the noise.
  if (!itself) itself = hits_part(scene_.gripper, grasps_[candidate.grasp], scene_.part, 0.2 + scene_.noise_mm / 3);
  return *itself;
}

RejectedGrasp GraspChecks::check(const Candidate& candidate, double& clearance_mm) {
  RejectedGrasp found{detection_, candidate.grasp, candidate.pose};
  const Grasp& grasp = grasps_[candidate.grasp];
  if (hits_itself(candidate)) {
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

std::vector<std::vector<WayOut>> GraspChecks::ways_past_others(std::vector<bool> wanted) const {
  const double most_mm = kCoveredMaxNoises * scene_.noise_mm, pixel_mm = kAslantPixels * fine_pixel_mm(scene_);
  // In a supply that stands slanted the end of a way is not free upwards because its beginning is.
  const bool is_level = up_.z() > std::cos(kLevelRad);
  for (std::size_t d = 0; d < wanted.size(); ++d)
    wanted[d] = wanted[d] && is_level && overlaps_mm_[d] > most_mm && around_.covered_mm(d) <= most_mm;
  if (std::ranges::find(wanted, true) == wanted.end()) return std::vector<std::vector<WayOut>>(wanted.size());
  return ways_out(part_, diameter_mm(scene_.part), report_.detections, wanted, pixel_mm, pixel_mm);
}

const Heights& GraspChecks::foreign() {
  if (!foreign_) foreign_ = around_.foreign(heights_, detection_);
  return *foreign_;
}

bool GraspChecks::part_passes(const WayOut& way) {
  if (!lower_side_) lower_side_ = around_.lower_side(detection_);
  return contact_of_part(*lower_side_, scene_.image.origin_mm, way.way_mm.normalized(), way.way_mm.norm(),
                         kSlackNoises * scene_.noise_mm, foreign(), supply_)
             .with == Obstacle::None;
}

bool GraspChecks::is_free_in(const Candidate& candidate) {
  return !hits_itself(candidate) && contact_of_gripper(candidate, 1, holes_).with == Obstacle::None;
}

bool GraspChecks::is_free_along(const Candidate& candidate, const WayOut& way) {
  const Eigen::Isometry3d T_supply_retreat = Eigen::Translation3d{way.way_mm} * candidate.T_supply_tcp;
  return std::ranges::all_of(sweepers_[candidate.grasp], [&](const Gripper::Solid& solid) {
    const Swept out{solid, candidate.T_supply_tcp, way.way_mm, clearance_mm_};
    return contact(out, foreign(), supply_, holes_).with == Obstacle::None &&
           passes_others(solid, candidate.T_supply_tcp, way.way_mm) &&
           passes_others(solid, T_supply_retreat, highest_mm_ * up_);
  });
}

/// Under the others' surfaces is room on a way aslant: they are met as they are.
bool GraspChecks::passes_others(const Gripper::Solid& solid, const Eigen::Isometry3d& T_supply_tcp,
                                const Eigen::Vector3d& way_mm) const {
  for (std::size_t other = 0; other < report_.detections.size(); ++other) {
    if (other == detection_) continue;
    const Eigen::Isometry3d T_object_supply = report_.detections[other].T_supply_object.iso.inverse();
    const Swept out{solid, T_object_supply * T_supply_tcp, T_object_supply.linear() * way_mm, clearance_mm_};
    if (meets(out, scene_.part)) return false;
  }
  return true;
}

Eigen::Vector3d GraspChecks::way_in(const Candidate& candidate) const {
  return -grasps_[candidate.grasp].approach_mm * candidate.T_supply_tcp.linear().col(2);
}

double GraspChecks::lift_mm(const Grasp& grasp) const {
  constexpr double kSteepest = 0.1;
  const double out_mm = std::max(highest_mm_, supply_.size_mm.z()) / std::max(up_.z(), kSteepest);
  return grasp.retreat_mm > 0 ? grasp.retreat_mm : out_mm;
}

Eigen::AlignedBox3d GraspChecks::box_of(const Gripper::Solid& solid, const Candidate& candidate, double times) const {
  const Eigen::Isometry3d T = candidate.T_supply_tcp * solid.T_tcp_solid;
  const Eigen::Vector3d half = T.linear().cwiseAbs() * (0.5 * solid.size_mm.array() + times * clearance_mm_).matrix();
  const Eigen::AlignedBox3d end{T.translation() - half, T.translation() + half};
  const Eigen::AlignedBox3d box = end.merged(end.translated(way_in(candidate)));
  return slants_ ? box.merged(box.translated(lift_mm(grasps_[candidate.grasp]) * up_)) : box;
}

/// The first that is found: jaws are asked before the body.
Contact GraspChecks::contact_of_gripper(const Candidate& candidate, double times, bool holes) const {
  for (const Gripper::Solid& solid : sweepers_[candidate.grasp]) {
    if (box_of(solid, candidate, times).min().z() >= std::max(highest_mm_, supply_.size_mm.z())) continue;
    const Swept in{solid, candidate.T_supply_tcp, way_in(candidate), times * clearance_mm_};
    if (const Contact found = contact(in, heights_, supply_, holes); found.with != Obstacle::None) return found;
    if (!slants_) continue;
    // Down to the approach pose, and up from the grasp.
    const Eigen::Vector3d lift = lift_mm(grasps_[candidate.grasp]) * up_;
    for (const Eigen::Isometry3d& T : {approach_of(candidate, grasps_), candidate.T_supply_tcp}) {
      const Swept upright{solid, T, lift, times * clearance_mm_};
      if (const Contact found = contact(upright, heights_, supply_, holes); found.with != Obstacle::None) return found;
    }
  }
  return {};
}
}  // namespace binpick::vision
