#pragma once

#include <Eigen/Geometry>
#include <span>
#include <string>

#include "base/expected.hpp"
#include "base/frames.hpp"
#include "vision/depth_image.hpp"

/// Where the forklift has put the supply: its rim, found in the scan.
namespace binpick::vision {
struct SupplyPlaceLimits {
  double offset_mm = 80;  ///< Along each of the supply's axes.
  double turn_rad = 0.1745;
};

struct SupplyPlace {
  /// Maps the supply's frame as it stands to the one that the configuration says; moved in x and y, turned about z.
  Eigen::Isometry3d T_said_found = Eigen::Isometry3d::Identity();
  double turn_rad = 0;
  int walls = 0;  ///< Of four that were seen.
};

/// `points_said_mm`: all points of a scan, in the supply frame as the configuration says; `supply`: its inner size, all
/// three known. The rim is what stands at the walls' height (within 40 mm) along a whole wall, with the inner faces as
/// far apart as the size says. The error says what was not found, or is not plausible, with numbers.
///
/// One wall of each pair is enough as long as the other pair is complete. The turn is where the rim's points, projected
/// along the walls, are drawn together most (as one finds the skew of a printed page: projection profiles).
Expected<SupplyPlace, std::string> find_supply(std::span<const Eigen::Vector3f> points_said_mm, const SupplyBox& supply,
                                               const SupplyPlaceLimits& limits, double noise_mm);
}  // namespace binpick::vision
