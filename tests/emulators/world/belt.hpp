#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "base/frames.hpp"
#include "tests/emulators/world/example_parts.hpp"

/// A still belt as a feeder leaves it: objects that lie by themselves, each as it comes to rest.
namespace binpick::emulators {
/// Between the circles around two objects, seen from above, in diameters of the part: no object is in a gripper's way
/// to another.
inline constexpr double kApartDiameters = 0.25;

/// Each object falls onto the belt, turned at random, lies still, also after some jolts, and is put somewhere into the
/// window: wholly in it, `kApartDiameters` from all others. As many as asked for, or as were found room for. The same
/// arguments give the same poses. For LivingPile, in a supply of height 0.
std::vector<Transform<frame::Supply, frame::Object>> lay_apart(const ExamplePart& part, int count,
                                                               const Eigen::Vector2d& window_mm, std::uint64_t seed);
}  // namespace binpick::emulators
