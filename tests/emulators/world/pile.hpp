#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <vector>

#include "base/frames.hpp"
#include "tests/emulators/world/example_parts.hpp"
#include "tests/emulators/world/world.hpp"

/// Piles as they come to lie when parts are thrown into a supply: Bullet's rigid bodies of the part's convex pieces.
namespace binpick::emulators {
struct Pile {
  std::vector<Transform<frame::Supply, frame::Object>> T_supply_object;  ///< In the order of falling.
  double penetration_max_mm = 0;  ///< Deepest that two bodies reach into each other.
  double speed_max_mm_s = 0;      ///< What was left of movement at the end.
};

/// Drops `count` objects one after the other into a supply of this inner size (x, y, wall height; mm), each turned at
/// random, and waits until they lie still. The same arguments give the same pile. Objects may lie higher than the walls
/// when there are too many; none lies outside.
Pile settle(const ExamplePart& part, int count, const Eigen::Vector3d& supply_size_mm, std::uint64_t seed);

/// The world of such a pile. A throw that ends with bodies in each other (deeper than 0.5 mm) is thrown again with the
/// next seed.
World make_pile(const ExamplePart& part, int count, const Eigen::Vector3d& supply_size_mm, std::uint64_t seed);
}  // namespace binpick::emulators
