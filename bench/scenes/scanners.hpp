#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <optional>
#include <vector>

#include "bench/scenes/classes.hpp"
#include "tests/emulators/world/ray_bundle.hpp"
#include "tests/emulators/world/world.hpp"

/// Simulated scanners: what a sweep over the supply measures, and what it would measure if it did not err.
namespace binpick::bench {
/// One line of a sweep: where the light comes from, its rays, and where it is looked at from (the same place for time
/// of flight).
struct Profile {
  Eigen::Isometry3f T_supply_carrier;  ///< As it really stood; the points are put where it was believed to stand.
  Eigen::Isometry3f T_supply_believed;
  Eigen::Vector3f camera_mm;                        ///< Supply frame.
  std::vector<Eigen::Vector3f> rays;                ///< Carrier frame, length 1.
  std::vector<Eigen::Vector3f> directions() const;  ///< Supply frame.
  Eigen::Vector3f light_mm() const { return T_supply_carrier.translation(); }
};

/// The lines of one sweep over the whole supply. `seed`: of the carrier's jitter.
std::vector<Profile> sweep_lines(const ClassSetting& setting, std::uint64_t seed, double sparse = 1);

/// What lies where a ray meets something, as far as the device can see it at all.
struct Echo {
  float distance_mm = 0;
  int object = -1;  ///< -1: nothing, or hidden from the camera. 0: supply or floor.
  float cos_incidence = 1;
  Eigen::Vector3f normal = Eigen::Vector3f::Zero();
  bool seen() const { return object >= 0; }
};
/// The ideal scanner: first thing that the light meets, if the camera sees it. One row for each profile.
std::vector<std::vector<Echo>> ideal_sweep(const ClassSetting& setting, const std::vector<Profile>& lines,
                                           const emulators::World& world);

struct ScanOptions {
  std::uint64_t seed = 1;
  double bias_mm = 0;  ///< Time of flight: constant of each material, within ± this.
};
/// What the device tells: points in the supply frame, with the class's noise, mixed echoes at jumps and dropouts.
std::vector<Eigen::Vector3f> measured_points(const ClassSetting& setting, const std::vector<Profile>& lines,
                                             const std::vector<std::vector<Echo>>& ideal, const emulators::World& world,
                                             const ScanOptions& options);
}  // namespace binpick::bench
