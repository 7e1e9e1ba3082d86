#include <cmath>
#include <numbers>

#include "config/rules.hpp"
#include "config/wording.hpp"

namespace binpick::config {
namespace {
/// Jaws that move less than this do not let go of a part, nor hold it.
constexpr double kStrokeMinMm = 0.1;

std::string rounded(double v) { return number_text(std::round(v * 1000) / 1000); }

void check_openings(const vision::Grasp& grasp, const vision::Gripper::Jaws& jaws, const Places& at,
                    const Places& gripper, Findings& findings) {
  const double widest_mm = jaws.opening_max_mm;
  bool within = gripper.given("opening_max_mm");
  const auto beyond = [&](const char* key, const std::optional<double>& value_mm) {
    if (!within || !value_mm || *value_mm <= widest_mm) return false;
    findings.add(at.of(key), std::string{"grasp."} + key + " = " + rounded(*value_mm) +
                                 " is more than gripper.opening_max_mm = " + rounded(widest_mm) +
                                 "; use less, or correct the gripper");
    return true;
  };
  const bool opening_beyond = beyond("opening_mm", grasp.opening_mm);
  const bool holding_beyond = beyond("holding_mm", grasp.holding_mm);
  within = within && !opening_beyond && !holding_beyond;
  if (!grasp.holding_mm) {
    if (!at.bad.contains("holding_mm"))
      findings.add(at.header,
                   "grasp.holding_mm is missing in [[grasp]], but the gripper has jaws; add how far they stand apart "
                   "when they hold the part, for example: holding_mm = 120");
    return;
  }
  if (!within || at.bad.contains("opening_mm")) return;
  const double opening_mm = grasp.opening_mm.value_or(widest_mm);
  if (std::abs(opening_mm - *grasp.holding_mm) < kStrokeMinMm)
    findings.add(at.of("holding_mm"), "grasp.holding_mm = " + rounded(*grasp.holding_mm) +
                                          " is as wide as the jaws stand on the way in, so they never close; use less "
                                          "(or more, for a grip from within), or another opening_mm");
}
}  // namespace

void check_grips(const Part& part, const GripPlaces& places, Findings& findings) {
  for (std::size_t i = 0; i < places.bodies.size(); ++i) {
    const vision::Gripper::Solid& solid = part.gripper->body[i];
    if (solid.shape == vision::Gripper::Solid::Shape::Cylinder && places.bodies[i].given("size_mm") &&
        solid.size_mm.x() != solid.size_mm.y())
      findings.add(places.bodies[i].of("size_mm"),
                   "gripper_body.size_mm of a cylinder has two diameters, " + rounded(solid.size_mm.x()) + " and " +
                       rounded(solid.size_mm.y()) + "; write [diameter, diameter, length]");
  }
  for (std::size_t i = 0; i < places.grasps.size(); ++i) {
    const Places& at = places.grasps[i];
    if (places.gripper) {
      check_openings(part.grasps[i], *part.gripper->jaws, at, *places.gripper, findings);
      continue;
    }
    for (const char* key : {"opening_mm", "holding_mm"})
      if (at.given(key))
        findings.add(at.of(key), std::string{"grasp."} + key +
                                     " is for a gripper with jaws, but there is no section [gripper]; add it, with "
                                     "opening_max_mm and jaw_size_mm, or remove this");
  }
}

bool make_symmetry(const SymmetryEntry& entry, const Places& places, Findings& findings, vision::Symmetry& symmetry) {
  enum Kind : std::size_t { kNone, kCyclic, kDihedral, kRevolution, kRevolutionFlip, kSphere };  // order of the choices
  if (entry.axis.norm() < 1e-6) {
    findings.add(places.of("axis"), "symmetry.axis is zero; use, for example, [0, 0, 1]");
    return false;
  }
  const Eigen::Vector3d axis = entry.axis.normalized();
  symmetry = {};
  symmetry.axis = axis;
  switch (entry.kind) {
    case kNone:
      break;
    case kRevolution:
      symmetry.kind = vision::Symmetry::Kind::Revolution;
      break;
    case kRevolutionFlip:
      symmetry.kind = vision::Symmetry::Kind::RevolutionFlip;
      break;
    case kSphere:
      symmetry.kind = vision::Symmetry::Kind::Sphere;
      break;
    default: {
      const bool flips = entry.kind == kDihedral;
      const double tilt = flips && entry.flip_axis.norm() > 1e-6 ? std::abs(axis.dot(entry.flip_axis.normalized()))
                          : flips                                ? 1.0
                                                                 : 0.0;
      if (tilt > 0.01) {
        findings.add(places.of(places.given("flip_axis") ? "flip_axis" : "kind"),
                     "symmetry.flip_axis is not at right angles to symmetry.axis; use one that is");
        return false;
      }
      symmetry.kind = vision::Symmetry::Kind::Finite;
      symmetry.rotations.clear();
      for (int flip = 0; flip <= (flips ? 1 : 0); ++flip)
        for (int turn = 0; turn < entry.fold; ++turn) {
          Eigen::Matrix3d rotation =
              Eigen::AngleAxisd(2 * std::numbers::pi * turn / entry.fold, axis).toRotationMatrix();
          if (flip == 1) rotation = rotation * Eigen::AngleAxisd(std::numbers::pi, entry.flip_axis.normalized());
          symmetry.rotations.push_back(turn == 0 && flip == 0 ? Eigen::Matrix3d::Identity() : rotation);
        }
      if (symmetry.rotations.size() == 1) symmetry.kind = vision::Symmetry::Kind::None;
    }
  }
  return true;
}
}  // namespace binpick::config
