#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <string>
#include <vector>

#include "vision/detector.hpp"
#include "vision/scene.hpp"
#include "vision/verification.hpp"

/// Where no part can be: below the floor, outside the walls; and what lies between them.
namespace binpick::vision {
class Bounds {
 public:
  /// The floor is the supply's, or, where that is not known, the level below which there is nothing and on which much
  /// lies; or there is none.
  Bounds(const Scene& scene, const SupplyBox& supply, double diameter_mm);

  float floor_mm() const { return floor_mm_; }  ///< Minus infinity: none.
  /// 1 where something was measured that is neither floor, nor what lies about on it, nor wall; else 0. Without walls
  /// nobody can know what belongs to the supply: zeros.
  Grid<std::uint8_t> content(const Scene& scene) const;
  /// Why a part cannot be there, by every vertex (object frame); empty: it can.
  std::string against(const Pose& pose, const std::vector<Eigen::Vector3f>& vertices_mm) const;

 private:
  float floor_mm_;
  float content_from_mm_;    ///< Infinity: no content.
  float depth_mm_;           ///< So much through the floor is error of the pose.
  Eigen::Array2f walls_mm_;  ///< Half of the supply, and what is error of the pose; infinity: no walls.
  Eigen::Array2d inner_mm_;  ///< Half of the supply less what may be a wall.
};
}  // namespace binpick::vision
