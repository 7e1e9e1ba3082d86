#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "base/frames.hpp"
#include "tests/emulators/world/living_pile.hpp"
#include "vision/grasp.hpp"
#include "vision/gripper.hpp"
#include "vision/symmetry.hpp"

/// What an arm with a gripper does to a pile when it is sent to a grasp. Independent of the daemon's own checks: exact
/// triangles, true poses, nothing measured.
///
/// 1. Down, straight along the supply's z, to the approach pose, the jaws at the grasp's opening; then along a line to
///    the grasp pose. Every box and cylinder of the gripper is tested against every triangle of objects, walls and
///    floor. A surface deeper than `hit_mm` inside one of them is a collision, the target's own surface too.
/// 2. The jaws close along x (a grip from within opens them) until both touch the target. The object slides along x
///    until it is in the middle; jaws that open in a bore also slide along its flanks, `centres_mm` at most, to where
///    they stand widest. It is held when both faces touch it over a fair area (`contact_share` of what the
///    grasp in its own place would touch, within `touch_mm`), when the jaws then stand as far apart as there, within
///    `width_mm`, and when nothing else is between them. Without jaws it is held when the foremost face lies on it
///    flatly.
/// 3. Along a line to the retreat pose, where there is one, and straight up from there. The gripper must not hit. The
///    object may brush what it touched already; deeper than `push_mm` into another one, or into the supply, than when
///    it was gripped is a collision: what lies on it is lifted or thrown off. Here the convex pieces of the physics
///    stand for the objects.
///
/// After a miss or a collision the object stays where it is, and so does all else.
namespace binpick::emulators {
struct GripRules {
  double hit_mm = 0.5;
  double width_mm = 2;
  double touch_mm = 1;
  double contact_share = 0.3;
  double push_mm = 3;
  double centres_mm = 3;  ///< Jaws that open in a bore slide along its flanks so far, to where they stand widest.
  double step_mm = 2;     ///< Between two looks along the way.

  /// Parts that a light-section scanner sees are small: 1 mm, and the rest in proportion.
  static GripRules of(const ExamplePart& part);
};

struct GripResult {
  enum class Kind { Taken, Missed, Collision };
  enum class Phase { Down, Approach, Close, Up };
  Kind kind = Kind::Missed;
  int object = 0;         ///< The target: the one that the grasp pose fits best. 0: there is none.
  std::size_t grasp = 0;  ///< The grasp that fits best there.
  Phase phase = Phase::Down;
  std::string what;          ///< "jaw", "body", "held object", or why it was missed.
  int with = 0;              ///< Of a collision: the object that was hit. 0: walls or floor.
  double depth_mm = 0;       ///< Of a collision.
  double from_grasp_mm = 0;  ///< Of a collision: how far the tcp was from the grasp pose.
};
std::string to_string(GripResult::Kind kind);
std::string to_string(GripResult::Phase phase);
std::string to_string(const GripResult& result);

struct GripMotion {
  Transform<frame::Supply, frame::Tcp> T_supply_approach, T_supply_grasp;
  std::optional<Transform<frame::Supply, frame::Tcp>> T_supply_retreat{};  ///< Nothing: straight up from the grasp.
};

/// What would happen; take() of the pile is the caller's.
GripResult grip(const LivingPile& pile, const vision::Gripper& gripper, const std::vector<vision::Grasp>& grasps,
                const vision::Symmetry& symmetry, const GripMotion& motion, const GripRules& rules);

/// Whether the open gripper hits nothing at the grasp pose itself: quickly asked before grip().
bool stands_free(const World& world, const vision::Gripper& gripper, const vision::Grasp& grasp,
                 const Transform<frame::Supply, frame::Tcp>& T_supply_grasp, const GripRules& rules);

/// Where the jaws stand when they hold the part as the grasp says, by its mesh; nothing: they do not touch it.
struct Closed {
  double jaws_mm = 0;                ///< Between the inner faces.
  double off_middle_mm = 0;          ///< The object slides so far along the tcp's x.
  double across_mm = 0;              ///< And along its y, where jaws that open in a bore centre it.
  std::size_t touching[2] = {0, 0};  ///< Sampled places of each face (-x, +x) that touch.
};
std::optional<Closed> closed_on(const RayMesh& part, const vision::Gripper& gripper, const vision::Grasp& grasp,
                                const GripRules& rules);
}  // namespace binpick::emulators
