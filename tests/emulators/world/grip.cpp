#include "tests/emulators/world/grip.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <limits>

#include "tests/emulators/world/solid_contact.hpp"

namespace binpick::emulators {
namespace {
using Eigen::Isometry3d;
using Eigen::Vector3d;
using vision::Grasp;
using vision::Gripper;
using Kind = GripResult::Kind;
using Phase = GripResult::Phase;
using TcpPose = Transform<frame::Supply, frame::Tcp>;

/// The tool comes from so far above all that stands in the supply.
constexpr double kAbove_mm = 10;
/// Rays start so far behind a jaw's face: a face that touches already is found too.
constexpr double kBehind_mm = 1;

Eigen::AlignedBox3d box_of(const Gripper::Solid& solid, const Isometry3d& T_supply_tcp) {
  const Isometry3d T = T_supply_tcp * solid.T_tcp_solid;
  const Vector3d reach = T.linear().cwiseAbs() * solid.size_mm / 2;
  return {T.translation() - reach, T.translation() + reach};
}

/// Everything that a solid may hit: objects and, with id 0, the supply.
std::vector<const World::Object*> all_of(const World& world) {
  std::vector<const World::Object*> all{&world.surroundings()};
  for (const World::Object& object : world.objects()) all.push_back(&object);
  return all;
}

double top_of(const World& world) {
  double top = world.supply_size_mm().z();
  for (const World::Object& object : world.objects()) top = std::max(top, double{object.box.max().z()});
  return top;
}

/// From one pose to the other in equal steps, both included.
std::vector<TcpPose> line(const TcpPose& from, const TcpPose& to, double step_mm) {
  const Vector3d way = to.iso.translation() - from.iso.translation();
  const int steps = std::max(1, static_cast<int>(std::ceil(way.norm() / step_mm)));
  std::vector<TcpPose> poses;
  for (int k = 0; k <= steps; ++k) {
    poses.push_back(from);
    poses.back().iso.translation() += static_cast<double>(k) / steps * way;
  }
  return poses;
}

struct Hit {
  std::string what;
  int with = 0;
  double depth_mm = 0;
  std::size_t pose = 0;
};
std::optional<Hit> first_hit(const World& world, const std::vector<Gripper::Solid>& solids, std::size_t bodies,
                             const std::vector<TcpPose>& way, int spared, double hit_mm) {
  const auto things = all_of(world);
  for (std::size_t k = 0; k < way.size(); ++k)
    for (std::size_t s = 0; s < solids.size(); ++s) {
      const Eigen::AlignedBox3d box = box_of(solids[s], way[k].iso);
      for (const World::Object* thing : things) {
        if (thing->id == spared && spared != 0) continue;
        if (!box.intersects(thing->box.cast<double>())) continue;
        const Isometry3d T_object_solid = thing->T_supply_object.iso.inverse() * way[k].iso * solids[s].T_tcp_solid;
        if (const double depth = depth_mm(solids[s], T_object_solid, hit_mm, *thing->mesh); depth > 0)
          return Hit{s < bodies ? "body" : "jaw", thing->id, depth, k};
      }
    }
  return std::nullopt;
}

/// Places on a jaw's face, tcp frame, y and z.
std::vector<Eigen::Vector2d> face_of(const Gripper::Jaws& jaws) {
  const double y = jaws.size_mm.y(), z = jaws.size_mm.z();
  const double spacing = std::clamp(std::min(y, z) / 12, 0.25, 2.0);
  const int rows = static_cast<int>(std::ceil(z / spacing)), columns = static_cast<int>(std::ceil(y / spacing));
  std::vector<Eigen::Vector2d> places;
  for (int r = 0; r < rows; ++r)
    for (int c = 0; c < columns; ++c)
      places.emplace_back(-y / 2 + (c + 0.5) * y / columns, jaws.beyond_mm - (r + 0.5) * z / rows);
  return places;
}

/// One jaw on its way, at each place of its face: how far to the target, and to the nearest of all else.
struct Travel {
  std::vector<float> target_mm;
  float touch_mm = std::numeric_limits<float>::infinity();  ///< Least of them.
  float other_mm = std::numeric_limits<float>::infinity();
  int other = 0;
};
struct Thing {
  int id = 0;
  const RayMesh* mesh = nullptr;
  Isometry3d T_thing_tcp;
};
Travel travel_of(int side, const Gripper::Jaws& jaws, double opening_mm, bool inside, const std::vector<Thing>& things,
                 int target) {
  const double thick = jaws.size_mm.x();
  const double face = side * (opening_mm / 2 + (inside ? thick : 0));
  const Vector3d way = (inside ? side : -side) * Vector3d::UnitX();
  const double limit = kBehind_mm + (inside ? (jaws.opening_max_mm - opening_mm) / 2 : opening_mm);
  Travel travel;
  for (const Eigen::Vector2d& place : face_of(jaws)) {
    const Vector3d from = Vector3d{face, place.x(), place.y()} - kBehind_mm * way;
    float to_target = std::numeric_limits<float>::infinity();
    for (const Thing& thing : things) {
      const Vector3d origin = thing.T_thing_tcp * from, direction = thing.T_thing_tcp.linear() * way;
      const auto hit = thing.mesh->cast(origin.cast<float>(), direction.cast<float>(), static_cast<float>(limit));
      if (!hit) continue;
      const float at = hit->distance_mm - static_cast<float>(kBehind_mm);
      if (thing.id == target)
        to_target = at;
      else if (at < travel.other_mm)
        travel.other_mm = at, travel.other = thing.id;
    }
    travel.target_mm.push_back(to_target);
    travel.touch_mm = std::min(travel.touch_mm, to_target);
  }
  return travel;
}

bool from_within(const Grasp& grasp, double opening_mm) { return grasp.holding_mm && *grasp.holding_mm > opening_mm; }

struct Closing {
  std::optional<Closed> closed;  ///< Nothing: one of the jaws met nothing.
  std::optional<int> between;    ///< Something else that the jaws would close on.
};
Closing close_jaws(const Gripper& gripper, const Grasp& grasp, const std::vector<Thing>& things, int target,
                   const GripRules& rules) {
  const double opening = grasp.opening_mm.value_or(gripper.jaws->opening_max_mm);
  const bool inside = from_within(grasp, opening);
  const std::array<Travel, 2> jaws{travel_of(-1, *gripper.jaws, opening, inside, things, target),
                                   travel_of(1, *gripper.jaws, opening, inside, things, target)};
  Closing closing;
  if (!std::isfinite(jaws[0].touch_mm) || !std::isfinite(jaws[1].touch_mm)) return closing;
  Closed closed;
  const double sum = double{jaws[0].touch_mm} + double{jaws[1].touch_mm};
  closed.jaws_mm = inside ? opening + sum : opening - sum;
  closed.off_middle_mm = (jaws[1].touch_mm - jaws[0].touch_mm) / 2 * (inside ? -1 : 1);
  for (std::size_t side = 0; side < 2; ++side) {
    for (const float travel : jaws[side].target_mm)
      closed.touching[side] += travel <= jaws[side].touch_mm + static_cast<float>(rules.touch_mm);
    if (jaws[side].other_mm < jaws[side].touch_mm - static_cast<float>(rules.hit_mm))
      closing.between = jaws[side].other;
  }
  closing.closed = closed;
  return closing;
}

/// The same; jaws that hold from within slide to where the bore is widest.
Closing close_and_centre(const Gripper& gripper, const Grasp& grasp, const std::vector<Thing>& things, int target,
                         const GripRules& rules) {
  constexpr double kStep_mm = 0.5;
  Closing best = close_jaws(gripper, grasp, things, target, rules);
  if (!from_within(grasp, grasp.opening_mm.value_or(gripper.jaws->opening_max_mm))) return best;
  const int steps = static_cast<int>(rules.centres_mm / kStep_mm);
  for (int k = -steps; k <= steps; ++k) {
    std::vector<Thing> moved = things;
    for (Thing& thing : moved)
      if (thing.id == target) thing.T_thing_tcp = thing.T_thing_tcp * Eigen::Translation3d(0, -k * kStep_mm, 0);
    Closing other = close_jaws(gripper, grasp, moved, target, rules);
    if (!other.closed || (best.closed && other.closed->jaws_mm <= best.closed->jaws_mm + 1e-6)) continue;
    other.closed->across_mm = k * kStep_mm;
    best = other;
  }
  return best;
}

/// Without jaws: the share of the foremost face that lies on the target.
double share_that_lies(const Gripper& gripper, const RayMesh& mesh, const Isometry3d& T_object_tcp,
                       const GripRules& rules) {
  constexpr int kRings = 6, kSpokes = 12;
  const Gripper::Solid* foremost = nullptr;
  double front = -std::numeric_limits<double>::infinity();
  for (const Gripper::Solid& solid : gripper.body) {
    const double z = box_of(solid, Isometry3d::Identity()).max().z();
    if (z > front) front = z, foremost = &solid;
  }
  if (foremost == nullptr) return 0;
  const double radius = std::min(foremost->size_mm.x(), foremost->size_mm.y()) / 2;
  const Vector3d middle = foremost->T_tcp_solid.translation(), z = Vector3d::UnitZ();
  int lies = 0;
  for (int ring = 0; ring < kRings; ++ring)
    for (int spoke = 0; spoke < kSpokes; ++spoke) {
      const double r = radius * std::sqrt((ring + 0.5) / kRings), angle = 2 * M_PI * spoke / kSpokes;
      const Vector3d from{middle.x() + r * std::cos(angle), middle.y() + r * std::sin(angle), front - rules.width_mm};
      const auto hit = mesh.cast((T_object_tcp * from).cast<float>(), (T_object_tcp.linear() * z).cast<float>(),
                                 static_cast<float>(2 * rules.width_mm));
      lies += hit.has_value();
    }
  return static_cast<double>(lies) / (kRings * kSpokes);
}

/// The object that the grasp pose stands for, by the grasp that fits it best.
void aim(const World& world, const std::vector<Grasp>& grasps, const vision::Symmetry& symmetry,
         const TcpPose& T_supply_grasp, GripResult& result) {
  double least = std::numeric_limits<double>::max();
  for (const World::Object& object : world.objects())
    for (std::size_t g = 0; g < grasps.size(); ++g) {
      const double radius = object.mesh->box().sizes().cast<double>().norm() / 2;
      const Isometry3d T_supply_object = (T_supply_grasp * grasps[g].T_object_tcp.inverse()).iso;
      const auto error = vision::pose_distance(T_supply_object, object.T_supply_object.iso, symmetry, radius);
      const double apart = error.centroid_mm + radius * error.angle_rad;
      if (apart < least) least = apart, result.object = object.id, result.grasp = g;
    }
}

std::vector<Thing> things_near(const World& world, const Gripper& gripper, const Grasp& grasp,
                               const TcpPose& T_supply_tcp) {
  const double opening =
      std::max(grasp.opening_mm.value_or(gripper.jaws->opening_max_mm), grasp.holding_mm.value_or(0));
  Eigen::AlignedBox3d reach;
  for (const Gripper::Solid& solid : vision::solids_of({gripper.jaws, {}}, opening))
    reach.extend(box_of(solid, T_supply_tcp.iso));
  std::vector<Thing> things;
  for (const World::Object* thing : all_of(world))
    if (reach.intersects(thing->box.cast<double>()))
      things.push_back({thing->id, thing->mesh.get(), thing->T_supply_object.iso.inverse() * T_supply_tcp.iso});
  return things;
}

GripResult missed(GripResult result, std::string why) {
  result.kind = Kind::Missed;
  result.phase = Phase::Close;
  result.what = std::move(why);
  return result;
}

GripResult collided(GripResult result, Phase phase, const Hit& hit, const std::vector<TcpPose>& way,
                    const TcpPose& T_supply_grasp) {
  result.kind = Kind::Collision;
  result.phase = phase;
  result.what = hit.what;
  result.with = hit.with;
  result.depth_mm = hit.depth_mm;
  result.from_grasp_mm = (way[hit.pose].iso.translation() - T_supply_grasp.iso.translation()).norm();
  return result;
}
}  // namespace

GripRules GripRules::of(const ExamplePart& part) {
  GripRules rules;
  if (part.scanner == "lms400") return rules;
  rules.width_mm = 0.8;
  rules.touch_mm = 0.4;
  rules.push_mm = 1;
  rules.centres_mm = 1;
  rules.step_mm = 1;
  return rules;
}

std::optional<Closed> closed_on(const RayMesh& part, const Gripper& gripper, const Grasp& grasp,
                                const GripRules& rules) {
  return close_and_centre(gripper, grasp, {{1, &part, grasp.T_object_tcp.iso}}, 1, rules).closed;
}

bool stands_free(const World& world, const Gripper& gripper, const Grasp& grasp, const TcpPose& T_supply_grasp,
                 const GripRules& rules) {
  const double opening = grasp.opening_mm.value_or(gripper.jaws ? gripper.jaws->opening_max_mm : 0);
  return !first_hit(world, vision::solids_of(gripper, opening), gripper.body.size(), {T_supply_grasp}, 0, rules.hit_mm);
}

GripResult grip(const LivingPile& pile, const Gripper& gripper, const std::vector<Grasp>& grasps,
                const vision::Symmetry& symmetry, const GripMotion& motion, const GripRules& rules) {
  const World& world = pile.world();
  GripResult result;
  aim(world, grasps, symmetry, motion.T_supply_grasp, result);
  if (result.object == 0) return missed(result, "nothing is there");
  const Grasp& grasp = grasps[result.grasp];
  const World::Object& target = *world.find(result.object);

  // 1. In.
  const double opening = grasp.opening_mm.value_or(gripper.jaws ? gripper.jaws->opening_max_mm : 0);
  const std::vector<Gripper::Solid> open = vision::solids_of(gripper, opening);
  double lowest = std::numeric_limits<double>::infinity();
  for (const Gripper::Solid& solid : open)
    lowest = std::min(lowest, box_of(solid, motion.T_supply_approach.iso).min().z());
  TcpPose above = motion.T_supply_approach;
  above.iso.translation().z() += std::max(0.0, top_of(world) - lowest) + kAbove_mm;
  const auto down = line(above, motion.T_supply_approach, rules.step_mm);
  const auto approach = line(motion.T_supply_approach, motion.T_supply_grasp, rules.step_mm);
  if (const auto hit = first_hit(world, open, gripper.body.size(), down, 0, rules.hit_mm))
    return collided(result, Phase::Down, *hit, down, motion.T_supply_grasp);
  if (const auto hit = first_hit(world, open, gripper.body.size(), approach, 0, rules.hit_mm))
    return collided(result, Phase::Approach, *hit, approach, motion.T_supply_grasp);

  // 2. Closed.
  Closed closed;
  if (gripper.jaws) {
    const auto nominal = closed_on(*target.mesh, gripper, grasp, rules);
    if (!nominal) return missed(result, "grasp \"" + grasp.name + "\" touches nothing of the part");
    const auto closing = close_and_centre(gripper, grasp, things_near(world, gripper, grasp, motion.T_supply_grasp),
                                          result.object, rules);
    if (!closing.closed) return missed(result, "the object is not between the jaws");
    if (closing.between)
      return missed(result, *closing.between == 0
                                ? "walls or floor are between the jaws"
                                : "object " + std::to_string(*closing.between) + " is between the jaws");
    closed = *closing.closed;
    if (std::abs(closed.jaws_mm - nominal->jaws_mm) > rules.width_mm) {
      std::array<char, 80> text{};
      std::snprintf(text.data(), text.size(), "the jaws close to %.1f mm instead of %.1f mm", closed.jaws_mm,
                    nominal->jaws_mm);
      return missed(result, text.data());
    }
    for (std::size_t side = 0; side < 2; ++side)
      if (static_cast<double>(closed.touching[side]) <
          rules.contact_share * static_cast<double>(nominal->touching[side]))
        return missed(result, "a jaw hardly touches the object");
  } else {
    constexpr double kLies = 0.7;
    const Isometry3d T_object_tcp = target.T_supply_object.iso.inverse() * motion.T_supply_grasp.iso;
    if (share_that_lies(gripper, *target.mesh, T_object_tcp, rules) < kLies)
      return missed(result, "the gripper's face does not lie on the object");
  }

  // 3. Out.
  const std::vector<Gripper::Solid> holding = vision::solids_of(gripper, closed.jaws_mm);
  const TcpPose aside = motion.T_supply_retreat.value_or(motion.T_supply_grasp);
  TcpPose out = aside;
  const double gripper_above = above.iso.translation().z() - motion.T_supply_grasp.iso.translation().z();
  const double raised = aside.iso.translation().z() - motion.T_supply_grasp.iso.translation().z();
  out.iso.translation().z() +=
      std::max(0.0, std::max(gripper_above, top_of(world) - double{target.box.min().z()}) - raised);
  std::vector<TcpPose> up = line(aside, out, rules.step_mm);
  if (motion.T_supply_retreat) {
    const auto first = line(motion.T_supply_grasp, aside, rules.step_mm);
    up.insert(up.begin(), first.begin(), first.end());
  }
  if (const auto hit = first_hit(world, holding, gripper.body.size(), up, result.object, rules.hit_mm))
    return collided(result, Phase::Up, *hit, up, motion.T_supply_grasp);

  std::vector<LivingPile::Pose> carried{target.T_supply_object};
  const Isometry3d T_tcp_object = Eigen::Translation3d(closed.off_middle_mm, closed.across_mm, 0) *
                                  (motion.T_supply_grasp.iso.inverse() * target.T_supply_object.iso);
  for (const TcpPose& T_supply_tcp : up) carried.push_back({T_supply_tcp.iso * T_tcp_object});
  if (const auto push = pile.first_push(result.object, carried, rules.push_mm))
    return collided(result, Phase::Up, {"held object", push->object, push->depth_mm, push->pose - 1}, up,
                    motion.T_supply_grasp);
  result.kind = Kind::Taken;
  result.phase = Phase::Up;
  result.what.clear();
  return result;
}

std::string to_string(Kind kind) {
  switch (kind) {
    case Kind::Taken:
      return "taken";
    case Kind::Missed:
      return "missed";
    case Kind::Collision:
      return "collision";
  }
  return "";
}

std::string to_string(Phase phase) {
  switch (phase) {
    case Phase::Down:
      return "on the way down";
    case Phase::Approach:
      return "on the approach";
    case Phase::Close:
      return "while closing";
    case Phase::Up:
      return "on the way up";
  }
  return "";
}

std::string to_string(const GripResult& result) {
  if (result.kind == Kind::Taken) return "taken";
  if (result.kind == Kind::Missed) return "missed: " + result.what;
  std::array<char, 200> text{};
  std::snprintf(text.data(), text.size(), "collision %s: the %s reaches %.1f mm into %s, %.0f mm from the grasp",
                to_string(result.phase).c_str(), result.what.c_str(), result.depth_mm,
                result.with == 0               ? "walls or floor"
                : result.with == result.object ? "the object that is to be taken"
                                               : ("object " + std::to_string(result.with)).c_str(),
                result.from_grasp_mm);
  return text.data();
}
}  // namespace binpick::emulators
