#include "vision/ways_out.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "vision/overlaps.hpp"

namespace binpick::vision {
namespace {
constexpr double kDegree = std::numbers::pi / 180;
/// From the vertical. Farther down a part would be dragged along the others rather than drawn out.
constexpr std::array kTilts{10 * kDegree, 22 * kDegree, 35 * kDegree, 47 * kDegree, 60 * kDegree};
constexpr std::size_t kAround = 16;
/// Ends of the way, in diameters of the part: the shortest from which it passes straight up is taken.
constexpr std::array kLengths{0.35, 0.7, 1.0};
/// Robot programs lift the part to some 300 mm above the approach pose (docs/robots): they are not led higher before.
constexpr double kHighest_mm = 250;

Eigen::Vector3d direction(std::size_t tilt, std::size_t around) {
  const double angle = 2 * std::numbers::pi * static_cast<double>(around) / kAround;
  return {std::sin(kTilts[tilt]) * std::cos(angle), std::sin(kTilts[tilt]) * std::sin(angle), std::cos(kTilts[tilt])};
}

/// How far others reach over one detection on each way.
struct Fan {
  std::array<std::array<double, kAround>, kTilts.size()> covered_mm{};

  /// Of a way and of those beside it: poses have errors.
  double about_mm(std::size_t tilt, std::size_t around) const {
    double sum = 0;
    int count = 0;
    for (const std::size_t a : {around + kAround - 1, around, around + 1})
      for (std::size_t t = tilt > 0 ? tilt - 1 : 0; t <= std::min(tilt + 1, kTilts.size() - 1); ++t, ++count)
        sum += covered_mm[t][a % kAround];
    return covered_mm[tilt][around] + sum / count;
  }
};
}  // namespace

std::vector<std::vector<WayOut>> ways_out(const Rasteriser& part, double diameter_mm,
                                          std::span<const Detection> detections, const std::vector<bool>& wanted,
                                          double pixel_mm, double covered_max_mm) {
  std::vector<Fan> fans(detections.size());
  for (std::size_t tilt = 0; tilt < kTilts.size(); ++tilt)
    for (std::size_t around = 0; around < kAround; ++around) {
      const std::vector<double> covered_mm = overlaps_mm(part, detections, pixel_mm, direction(tilt, around), wanted);
      for (std::size_t d = 0; d < fans.size(); ++d) fans[d].covered_mm[tilt][around] = covered_mm[d];
    }
  const OverlapElsewhere overlap_mm = overlap_elsewhere(part, detections, pixel_mm);
  std::vector<std::vector<WayOut>> ways(detections.size());
  for (std::size_t d = 0; d < ways.size(); ++d) {
    if (!wanted[d]) continue;
    struct Place {
      double about_mm;
      std::size_t tilt, around;
    };
    std::vector<Place> order;
    for (std::size_t tilt = 0; tilt < kTilts.size(); ++tilt)
      for (std::size_t around = 0; around < kAround; ++around)
        if (fans[d].covered_mm[tilt][around] <= covered_max_mm)
          order.push_back({fans[d].about_mm(tilt, around), tilt, around});
    std::ranges::stable_sort(order, {}, &Place::about_mm);
    for (const Place& place : order)
      for (const double length : kLengths) {
        const Eigen::Vector3d way_mm = length * diameter_mm * direction(place.tilt, place.around);
        if (way_mm.z() > kHighest_mm) break;
        const double at_end_mm = overlap_mm(d, Eigen::Translation3d{way_mm} * detections[d].T_supply_object.iso);
        if (at_end_mm > covered_max_mm) continue;
        ways[d].push_back({way_mm, std::max(fans[d].covered_mm[place.tilt][place.around], at_end_mm)});
        break;
      }
  }
  return ways;
}
}  // namespace binpick::vision
