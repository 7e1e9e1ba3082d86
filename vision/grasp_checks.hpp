#pragma once

#include <optional>
#include <span>
#include <vector>

#include "vision/clearance.hpp"
#include "vision/grasp.hpp"
#include "vision/rasteriser.hpp"
#include "vision/surroundings.hpp"
#include "vision/ways_out.hpp"

/// Whether a grasp, and the way there and back, is free in what one scan shows.
namespace binpick::vision {
/// A grasp in one of its poses.
struct Candidate {
  std::size_t grasp = 0;
  std::size_t pose = 0;  ///< Of poses_of().
  Eigen::Isometry3d T_supply_tcp;
  double tilt_rad = 0;
};
Eigen::Isometry3d approach_of(const Candidate& candidate, const std::vector<Grasp>& grasps);

/// Of one scan. Keeps references to all that it is given.
class GraspChecks {
 public:
  GraspChecks(const DetectionReport& report, const std::vector<Grasp>& grasps, const SupplyBox& supply,
              const ReachLimits& limits, const GripperScene& scene);

  /// Takes up a detection. `ways`: those on which it may be drawn out aslant.
  void begin(std::size_t detection, const std::vector<Candidate>& candidates, std::span<const WayOut> ways = {});

  /// In, and straight up. None: it is free, with `clearance_mm` around it.
  RejectedGrasp check(const Candidate& candidate, double& clearance_mm);

  /// Ways past the others for those `wanted` detections which only others of them lie on; none for the rest, and none
  /// in a supply that is slanted by more than a degree.
  std::vector<std::vector<WayOut>> ways_past_others(std::vector<bool> wanted) const;
  /// Whether the part that was taken up passes along it all that is no detection, and the walls.
  bool part_passes(const WayOut& way);
  /// Whether the gripper is free on the way in, whatever lies on the object.
  bool is_free_in(const Candidate& candidate);
  /// Whether it is along `way`, from the grasp, and straight up from its end.
  bool is_free_along(const Candidate& candidate, const WayOut& way);

  /// How far others may reach over the detection that was taken up; 0: hardly.
  double covered_mm() const { return told_mm(covered_mm_); }
  double told_mm(double covered_mm) const { return covered_mm > kCoveredNoises * scene_.noise_mm ? covered_mm : 0; }
  bool is_tight(double clearance_mm) const { return clearance_mm <= clearance_mm_; }
  bool is_roomy(double clearance_mm) const;

 private:
  /// What reaches farther over an object lies on it, and would be lifted with it; from the lesser width on it may.
  static constexpr double kCoveredMaxNoises = 2, kCoveredNoises = 0.3;

  bool hits_itself(const Candidate& candidate);
  const Heights& foreign();  ///< Around the detection that was taken up, without what the others explain.
  Eigen::Vector3d way_in(const Candidate& candidate) const;  ///< To the approach pose, from the grasp.
  double lift_mm(const Grasp& grasp) const;                  ///< As far along up_ as the part has to pass.
  Eigen::AlignedBox3d box_of(const Gripper::Solid& solid, const Candidate& candidate, double times) const;
  bool passes_others(const Gripper::Solid& solid, const Eigen::Isometry3d& T_supply_tcp,
                     const Eigen::Vector3d& way_mm) const;
  Contact contact_of_gripper(const Candidate& candidate, double times, bool holes) const;

  const DetectionReport& report_;
  const std::vector<Grasp>& grasps_;
  const SupplyBox& supply_;
  const GripperScene& scene_;
  double clearance_mm_;
  Rasteriser part_;
  Surroundings around_;
  bool holes_;  ///< Block the way.
  double highest_mm_;
  Eigen::Vector3d up_;               ///< The arm's way out.
  std::vector<double> overlaps_mm_;  ///< Of each detection: how far others reach over it, seen along that.
  /// Where the supply stands level, a way straight up is as free as its beginning: all is solid from its surface down.
  bool slants_;
  std::vector<std::vector<Gripper::Solid>> sweepers_;  ///< Of each grasp.
  std::vector<std::optional<bool>> hits_part_;
  std::size_t detection_ = 0;
  Heights heights_;
  std::optional<Heights> foreign_;
  std::optional<Template> lower_side_;
  double covered_mm_ = 0;
};
}  // namespace binpick::vision
