#include "tests/emulators/world/belt.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <random>

#include "base/check.hpp"
#include "tests/emulators/world/physics.hpp"

namespace binpick::emulators {
namespace {
using Eigen::Vector2d;
using ObjectPose = Transform<frame::Supply, frame::Object>;

constexpr double kRoomDiameters = 20;    ///< For the fall: what rolls meets no wall.
constexpr double kOpenDiameters = 8;     ///< One that came so far from the middle still rolls, and falls again.
constexpr double kStillSpeed_mm_s = 10;  ///< A little above what the physics itself waits for.
/// A belt jolts when it starts and stops: what a tilt of so much tips over does not stay on its edge or its end.
constexpr double kJolt_rad = 20 * std::numbers::pi / 180;
constexpr int kJolts = 4;  ///< About as many horizontal axes.
constexpr int kFallsMax = 20, kPlacesTried = 500;

/// Seen from above: the circle about the middle of the object's box.
struct Footprint {
  Vector2d middle_mm;  ///< Supply frame.
  double radius_mm = 0;
};

Footprint footprint_of(const ExamplePart& part, const ObjectPose& T) {
  std::vector<Vector2d> points;
  Eigen::AlignedBox2d box;
  for (const auto& v : part.mesh.vertices_mm) {
    points.push_back((T * v.cast<double>()).head<2>());
    box.extend(points.back());
  }
  Footprint footprint{box.center()};
  for (const Vector2d& p : points) footprint.radius_mm = std::max(footprint.radius_mm, (p - box.center()).norm());
  return footprint;
}

/// Turned about a horizontal axis and set down on what is lowest then.
ObjectPose tilted(const ExamplePart& part, ObjectPose T, double heading_rad) {
  const Eigen::AngleAxisd tilt{kJolt_rad, Eigen::Vector3d{std::cos(heading_rad), std::sin(heading_rad), 0}};
  const Eigen::Vector3d centroid_mm = T * part.mesh.centroid_mm();
  T.iso = Eigen::Translation3d{centroid_mm} * tilt * Eigen::Translation3d{-centroid_mm} * T.iso;
  double lowest_mm = std::numeric_limits<double>::infinity();
  for (const auto& v : part.mesh.vertices_mm) lowest_mm = std::min(lowest_mm, (T * v.cast<double>()).z());
  T.iso.translation().z() -= lowest_mm;
  return T;
}

ObjectPose at_rest(const ExamplePart& part, std::mt19937_64& random) {
  const double diameter_mm = part.mesh.diameter_mm();
  for (int fall = 0; fall < kFallsMax; ++fall) {
    Physics physics{part, Eigen::Vector3d::Constant(kRoomDiameters * diameter_mm)};
    physics.throw_in(1, random());
    std::size_t body = 0;
    for (; body < kJolts; ++body) {
      const ObjectPose before = physics.pose(body);
      physics.remove(body);
      physics.place(tilted(part, before, static_cast<double>(body) * std::numbers::pi / kJolts));
      physics.throw_in(0, 0);  // waits until it lies still
    }
    const ObjectPose T = physics.pose(body);
    if (physics.speed_mm_s(body) <= kStillSpeed_mm_s &&
        T.iso.translation().head<2>().cwiseAbs().maxCoeff() < kOpenDiameters * diameter_mm)
      return T;
  }
  BINPICK_CHECK(false && "a part that never lies still");
}
}  // namespace

std::vector<ObjectPose> lay_apart(const ExamplePart& part, int count, const Vector2d& window_mm, std::uint64_t seed) {
  std::mt19937_64 random{seed};
  // Plain arithmetic on the generator's numbers: the library's distributions may differ between machines.
  const auto even = [&] { return 2 * static_cast<double>(random() >> 11) * 0x1p-53 - 1; };
  const double gap_mm = kApartDiameters * part.mesh.diameter_mm();
  std::vector<ObjectPose> poses;
  std::vector<Footprint> taken;
  for (int i = 0; i < count; ++i) {
    ObjectPose T = at_rest(part, random);
    Footprint own = footprint_of(part, T);
    const Vector2d room_mm = window_mm / 2 - Vector2d::Constant(own.radius_mm);
    if (room_mm.minCoeff() < 0) continue;
    const Vector2d fell_mm = own.middle_mm;
    for (int tries = 0; tries < kPlacesTried; ++tries) {
      own.middle_mm.x() = even() * room_mm.x();
      own.middle_mm.y() = even() * room_mm.y();
      const bool is_free = std::ranges::all_of(taken, [&](const Footprint& other) {
        return (own.middle_mm - other.middle_mm).norm() >= own.radius_mm + other.radius_mm + gap_mm;
      });
      if (!is_free) continue;
      T.iso.translation().head<2>() += own.middle_mm - fell_mm;
      poses.push_back(T);
      taken.push_back(own);
      break;
    }
  }
  return poses;
}
}  // namespace binpick::emulators
