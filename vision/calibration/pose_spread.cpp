#include "vision/calibration/pose_spread.hpp"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <numbers>

namespace binpick::vision::calibration {
namespace {
using Eigen::Matrix3d;
using Eigen::Vector3d;

/// Ends of the range that the scans have to cover, as a share of the mean distance.
constexpr double kSideways = 0.15, kDepth = 0.1;
constexpr double kPivotAngles_rad = 8 * std::numbers::pi / 180;
/// By which a holder or flange should be turned about its least turned axis, root mean square between two scans.
constexpr double kTurned_rad = 12 * std::numbers::pi / 180;

double range_of(const std::vector<double>& values) {
  const auto [least, most] = std::ranges::minmax(values);
  return most - least;
}

/// How far rotations differ about the axis that they differ least about: a vector fixed in the turned frame that
/// turning moves least shows it.
double least_turned_rad(const std::vector<Matrix3d>& rotations) {
  Matrix3d sum = Matrix3d::Zero();
  double pairs = 0;
  for (std::size_t i = 0; i < rotations.size(); ++i)
    for (std::size_t k = i + 1; k < rotations.size(); ++k, ++pairs)
      sum += (rotations[i] - rotations[k]).transpose() * (rotations[i] - rotations[k]);
  const double least = Eigen::SelfAdjointEigenSolver<Matrix3d>{sum / std::max(pairs, 1.0)}.eigenvalues()[0];
  return 2 * std::asin(std::min(std::sqrt(std::max(least, 0.0)) / 2, 1.0));
}

double degrees(double rad) { return rad * 180 / std::numbers::pi; }

template <class... Numbers>
void add(std::string& text, const char* format, Numbers... numbers) {
  char words[300];
  std::snprintf(words, sizeof words, format, numbers...);
  text += (text.empty() ? "" : "; ") + std::string{words};
}
}  // namespace

std::string missing_poses(std::span<const SphereSight> sights, const Adjusted& adjusted) {
  const Mount& mount = adjusted.arrangement.mount;
  std::vector<double> sideways, depth, angles;
  std::vector<Matrix3d> flanges, holders;
  double distance = 0;
  for (std::size_t k = 0; k < sights.size(); ++k) {
    // As the line sees it that passes nearest to the centre.
    const auto centre_at = [&](const SphereSight::Line& line) -> Vector3d {
      return mount.T_base_scanner(line.T_root_carrier).inverse() * adjusted.centres_mm[k];
    };
    const auto line = std::ranges::min_element(sights[k].lines, {},
                                               [&](const SphereSight::Line& l) { return std::abs(centre_at(l).y()); });
    const Vector3d seen = centre_at(*line);
    sideways.push_back(seen.x());
    depth.push_back(seen.z());
    distance += seen.norm() / static_cast<double>(sights.size());
    const Matrix3d& R = line->T_root_carrier.linear();
    angles.push_back(std::atan2(R(1, 0), R(0, 0)));
    flanges.push_back(R);
    holders.push_back(sights[k].T_base_holder.linear());
  }
  std::string text;
  if (mount.on_pivot && range_of(angles) < kPivotAngles_rad)
    add(text, "the sphere was met at pivot angles within %.1f deg: add scans with it near both ends of the sweep",
        degrees(range_of(angles)));
  if (range_of(sideways) < kSideways * distance)
    add(text, "along the scan line the sphere was met within %.0f mm: add scans with it near both ends of the line",
        range_of(sideways));
  if (range_of(depth) < kDepth * distance)
    add(text, "the sphere's distance from the scanner differed by %.0f mm only: add scans with it nearer and farther",
        range_of(depth));
  const bool turns_matter = mount.on_pivot ? !adjusted.arrangement.sphere_known : true;
  const double turned = turns_matter ? least_turned_rad(mount.on_pivot ? holders : flanges) : kTurned_rad;
  if (turned < kTurned_rad)
    add(text,
        mount.on_pivot
            ? "the flange that holds the sphere was turned by %.1f deg only about one of its axes: add scans "
              "with it turned by 30 deg about two axes, or say where the sphere's centre is in the robot's "
              "tool or base"
            : "between the scan paths the flange was turned by %.1f deg only about one of its axes: add "
              "paths with it turned by 30 deg about two axes, the scan line too",
        degrees(turned));
  return text;
}
}  // namespace binpick::vision::calibration
