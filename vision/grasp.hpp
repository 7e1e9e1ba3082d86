#pragma once

#include <optional>
#include <string>
#include <vector>

#include "base/frames.hpp"
#include "vision/detector.hpp"
#include "vision/gripper.hpp"
#include "vision/reach.hpp"

namespace binpick::vision {
/// How a gripper takes a part. The tcp's z axis is the direction of approach.
struct Grasp {
  std::string name;
  Transform<frame::Object, frame::Tcp> T_object_tcp;
  double approach_mm = 100;  ///< The approach pose stands this far back along tcp z.
  /// Between the jaws on the way in; the gripper's widest where it is not said.
  std::optional<double> opening_mm;
  /// Between the jaws when they hold the part. Wider than on the way in: they hold it from within, in a bore.
  std::optional<double> holding_mm;
  /// The part is lifted straight up (z of the base) from the grasp, and has to pass so far. 0: out of the supply.
  double retreat_mm = 0;
  double preference = 0;  ///< Of an object's grasps that are free, one with the highest value is taken.
};

/// Probability that a detection is right and lies so near to the truth that a grasp holds: its score, times what its
/// covariance leaves within 3 mm and 3 degrees in the worst direction. A turn that the symmetry makes nothing of does
/// not count. A wheel whose spokes are hidden is surely a wheel, and yet not the one to pick first.
double probability_of_holding(const Detection& detection, const Symmetry& symmetry);

/// The tcp at the grasp in each pose that the symmetry allows (a revolution in steps of 15 degrees).
std::vector<Eigen::Isometry3d> poses_of(const Grasp& grasp, const Transform<frame::Supply, frame::Object>& object,
                                        const Symmetry& symmetry);

/// Whether both take an object at the same place (10 mm) and come the same way (10 degrees), however the jaws stand.
bool is_same_way(const Transform<frame::Supply, frame::Tcp>& a, const Transform<frame::Supply, frame::Tcp>& b);

struct Reachable {
  std::size_t detection = 0;  ///< Index in the report.
  std::size_t grasp = 0;
  Transform<frame::Supply, frame::Tcp> T_supply_grasp;
  Transform<frame::Supply, frame::Tcp> T_supply_approach;
  /// Turned as at the grasp. The part goes there in a straight line, and from there straight up (z of the base).
  Transform<frame::Supply, frame::Tcp> T_supply_retreat;
  double clearance_mm = 0;  ///< So much room is all around; 0: nobody asked, or only where holes are free.
  double covered_mm = 0;    ///< So far another one may reach over it: it would be lifted with it.
  bool is_tight = false;    ///< Hardly more room than the clearance.
  bool is_aslant = false;   ///< The retreat pose does not stand above the grasp.
  /// For a second try: free too, and somewhere else on the object or from elsewhere.
  struct Other {
    std::size_t grasp = 0;
    Transform<frame::Supply, frame::Tcp> T_supply_grasp;
    Transform<frame::Supply, frame::Tcp> T_supply_approach;
    Transform<frame::Supply, frame::Tcp> T_supply_retreat;
  };
  std::optional<Other> other = std::nullopt;
};
/// A grasp in one of the poses that the symmetry allows, and why it is not offered.
struct RejectedGrasp {
  std::size_t detection = 0;
  std::size_t grasp = 0;
  std::size_t pose = 0;  ///< Index in poses_of().
  Obstacle why = Obstacle::None;
  double value = 0, limit = 0;  ///< Radians for a tilt, else millimetres.
  std::string place = {};       ///< "wall x max".
};
std::string to_string(const RejectedGrasp& rejected);

struct Unreachable {
  std::size_t detection = 0;
  Obstacle why = Obstacle::None;
  std::string reason;  ///< "tilt 51 deg is over 40 deg", "tcp 12 mm outside the wall x max".
};
struct GraspChoice {
  /// At most one per detection, best first. Objects that have to be drawn out aslant come last, before them those that
  /// another one may lie on, before them those with hardly more room than the clearance. Else the surest to hold (in
  /// steps of 0.02), then the preferred grasp, then the one with more room around it (up to four times the clearance),
  /// then the highest.
  std::vector<Reachable> reachable;
  /// Detections without any reachable grasp, with the reason of the best one of those that got farthest in the tests.
  std::vector<Unreachable> unreachable;
  std::vector<RejectedGrasp> rejected;  ///< All that were tried in vain, also those of detections that are reachable.
};
/// The reason that most of the unreachable have.
Obstacle main_obstacle(const GraspChoice& choice);

/// What has to be free around a grasp.
struct GripperScene {
  const DepthImage& image;
  const Mesh& part;
  double noise_mm;  ///< Of one measured height, 1 sd.
  const Gripper& gripper;
};

/// Grasps are tried in every pose that the part's symmetry allows: preferred ones first, steep ones before tilted ones.
/// Of those that are free the first with plenty of room is taken, or else the roomiest. Without a scene only the tcp is
/// kept from the walls, and the steepest of the preferred is taken. Where nothing has plenty of room straight up,
/// objects that hang in others are offered with a retreat pose to which they can be drawn past them (ways_out.hpp);
/// only in supplies that stand level within a degree.
GraspChoice choose_grasps(const DetectionReport& report, const Symmetry& symmetry, const std::vector<Grasp>& grasps,
                          const SupplyBox& supply, const ReachLimits& limits, const GripperScene* scene = nullptr);
}  // namespace binpick::vision
