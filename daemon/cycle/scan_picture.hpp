#pragma once

#include <memory>
#include <vector>

#include "daemon/cycle/detection.hpp"
#include "drivers/sweep/sweep.hpp"
#include "vision/depth_image.hpp"

namespace binpick::daemon {
/// A sweep's profiles as what is to be looked through: by the cell while they come, by a replay from its record.
class ScanPicture {
 public:
  /// Of the configuration's supply for its recipe, both by index.
  ScanPicture(std::shared_ptr<const CellData> cell, std::size_t supply, std::size_t recipe);

  void add(const drivers::sweep::RegisteredProfile& registered);
  /// With the depth image; with the points where the supply has to be located first.
  DetectRequest take_request(std::uint64_t cycle_id);
  std::size_t points() const { return builder_.points(); }  ///< In the supply.

 private:
  std::shared_ptr<const CellData> cell_;
  std::size_t supply_, recipe_;
  vision::DepthImageBuilder builder_;
  std::vector<Eigen::Vector3f> points_supply_mm_;  // reused from profile to profile
  std::vector<Eigen::Vector3f> points_said_mm_;    // all of a supply that has to be located
};
}  // namespace binpick::daemon
