#pragma once

#include <Eigen/Geometry>
#include <cstddef>
#include <span>
#include <vector>

#include "tests/emulators/world/ray_mesh.hpp"
#include "tests/emulators/world/world.hpp"

/// Many rays from one place, eight at a time: what a line scanner sends out. Several times faster than ray by ray where
/// neighbours go nearly the same way.
namespace binpick::emulators {
struct BundleHit {
  float distance_mm = 0;                             ///< Infinity: nothing met.
  int object = 0;                                    ///< World's ids; 0: supply or floor.
  Eigen::Vector3f normal = Eigen::Vector3f::Zero();  ///< Of the surface, supply frame, length 1, outwards.
  bool met() const;
};

/// First thing that each ray meets within `limit_mm`, in the order of `directions` (length 1). Supply frame.
void cast_bundle(const World& world, const Eigen::Vector3f& origin_mm, std::span<const Eigen::Vector3f> directions,
                 float limit_mm, std::vector<BundleHit>& hits);
/// The same for one object that stands alone, without supply and floor.
void cast_bundle(const World::Object& object, const Eigen::Vector3f& origin_mm,
                 std::span<const Eigen::Vector3f> directions, float limit_mm, std::vector<BundleHit>& hits);
}  // namespace binpick::emulators
