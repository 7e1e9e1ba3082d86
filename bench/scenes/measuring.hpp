#pragma once

#include <functional>
#include <limits>
#include <vector>

#include "bench/scenes/scanners.hpp"

/// What the two kinds of scanner share; for scanners.cpp, truth.cpp and the two themselves.
namespace binpick::bench {
inline constexpr float kNothing_mm = std::numeric_limits<float>::infinity();

using Caster = std::function<void(const Eigen::Vector3f& from_mm, const std::vector<Eigen::Vector3f>& directions,
                                  float limit_mm, std::vector<emulators::BundleHit>& hits)>;
/// Makes nothing of the hits that the line's camera does not see.
void hide_from_camera(const Profile& line, const std::vector<Eigen::Vector3f>& directions, const Caster& cast,
                      float limit_mm, std::vector<emulators::BundleHit>& hits);

/// Whether a neighbour in the same line or the next ones lies on another surface.
bool beside_a_jump(const std::vector<std::vector<Echo>>& sweep, std::size_t line, std::size_t point, float jump_mm);

/// A spot is looked at with 3 × 3 rays.
inline constexpr std::size_t kSpotRays = 9;
/// Directions (carrier frame) of the spot's rays about `ray`, which meets something at `distance_mm`.
void add_spot(const Eigen::Vector3f& ray, float distance_mm, double along_mm, double across_mm,
              std::vector<Eigen::Vector3f>& rays);

std::vector<Eigen::Vector3f> triangulated_points(const ClassSetting& setting, const std::vector<Profile>& lines,
                                                 const std::vector<std::vector<Echo>>& ideal,
                                                 const emulators::World& world, const ScanOptions& options);
std::vector<Eigen::Vector3f> time_of_flight_points(const ClassSetting& setting, const std::vector<Profile>& lines,
                                                   const std::vector<std::vector<Echo>>& ideal,
                                                   const emulators::World& world, const ScanOptions& options);
}  // namespace binpick::bench
