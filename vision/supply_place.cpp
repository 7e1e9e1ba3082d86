#include "vision/supply_place.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <numbers>
#include <optional>
#include <utility>
#include <vector>

namespace binpick::vision {
namespace {
using Eigen::Vector2f;

constexpr double kDegree = std::numbers::pi / 180;
constexpr double kLevelBand_mm = 40;  ///< The rim stands so near to where the walls' height says.
constexpr double kWallMax_mm = 60;    ///< Thickness that is looked at.
constexpr double kAlong_mm = 10;      ///< Cells along a wall that have a point or have not.
constexpr double kOut_mm = 1;         ///< Bins across it.
constexpr double kCoveredMin = 0.6;   ///< Share of a wall's cells that make it a wall.
constexpr std::size_t kStep_bins = 6;
constexpr double kNear_mm = 25;
constexpr std::size_t kPointsMin = 60, kPointsMax = 20'000;
constexpr double kWallsApartTolerance = 0.02;  ///< Of the size, and no less than the next one.
constexpr double kWallsApartMin_mm = 8;

/// One wall as the rim's points show it: at each distance outwards, which cells along it have a point.
struct Wall {
  std::vector<std::uint8_t> hit;  ///< bins × cells
  std::vector<std::uint16_t> covered;
  double from_mm = 0;  ///< Of the first bin, from the middle of the supply.
  std::size_t cells = 0;

  double sharpness() const {
    double sum = 0;
    for (const auto c : covered) sum += static_cast<double>(c) * c;
    const auto n = static_cast<double>(cells);
    return sum / n / n;
  }
  double sum_of(std::size_t from, std::size_t to) const {
    double sum = 0;
    for (std::size_t i = from; i < to; ++i) sum += covered[i];
    return sum;
  }
  double share_with_points(std::size_t from, std::size_t to) const {
    std::size_t count = 0;
    for (std::size_t cell = 0; cell < cells; ++cell)
      for (std::size_t bin = from; bin < to; ++bin)
        if (hit[bin * cells + cell] != 0) {
          ++count;
          break;
        }
    return static_cast<double>(count) / static_cast<double>(cells);
  }
  /// Where the points set in along the wall: the highest step.
  std::optional<double> inner_face_mm() const {
    double best = 0;
    std::size_t at = 0;
    for (std::size_t i = kStep_bins; i + kStep_bins <= covered.size(); ++i)
      if (const double step = sum_of(i, i + kStep_bins) - sum_of(i - kStep_bins, i); step > best) best = step, at = i;
    if (best <= 0 || share_with_points(at, at + kStep_bins) < kCoveredMin) return std::nullopt;
    return from_mm + kOut_mm * static_cast<double>(at);
  }
};

class Rim {
 public:
  Rim(std::vector<Vector2f> points, const Eigen::Vector3d& size_mm)
      : points_{std::move(points)}, half_mm_{size_mm.head<2>() / 2} {}

  /// -x, +x, -y, +y of a supply that stands here; their inner faces are looked for within `search_mm`.
  std::array<Wall, 4> walls(double turn_rad, const Eigen::Vector2d& middle_mm, double search_mm) const {
    const double c = std::cos(turn_rad), s = std::sin(turn_rad);
    std::array<Wall, 4> walls;
    std::array<double, 2> inset{}, reach{};
    for (std::size_t axis = 0; axis < 2; ++axis) {
      const double half = half_mm_[static_cast<Eigen::Index>(axis)];
      inset[axis] = std::min(search_mm, 0.6 * half);
      reach[axis] = half - inset[axis];
    }
    for (std::size_t w = 0; w < 4; ++w) {
      const std::size_t axis = w / 2, other = 1 - axis;
      walls[w].from_mm = reach[axis];
      walls[w].cells = std::max<std::size_t>(1, static_cast<std::size_t>(2 * reach[other] / kAlong_mm));
      walls[w].covered.assign(static_cast<std::size_t>((2 * inset[axis] + kWallMax_mm) / kOut_mm), 0);
      walls[w].hit.assign(walls[w].covered.size() * walls[w].cells, 0);
    }
    for (const Vector2f& p : points_) {
      const double x = static_cast<double>(p.x()), y = static_cast<double>(p.y());
      const std::array<double, 2> at{c * x + s * y - middle_mm.x(), c * y - s * x - middle_mm.y()};
      for (std::size_t axis = 0; axis < 2; ++axis) {
        Wall& wall = walls[2 * axis + (at[axis] > 0 ? 1 : 0)];
        const double out = (std::abs(at[axis]) - wall.from_mm) / kOut_mm;
        const double along = at[1 - axis] / kAlong_mm + 0.5 * static_cast<double>(wall.cells);
        if (out < 0 || out >= static_cast<double>(wall.covered.size()) || along < 0 ||
            along >= static_cast<double>(wall.cells))
          continue;
        auto& hit = wall.hit[static_cast<std::size_t>(out) * wall.cells + static_cast<std::size_t>(along)];
        wall.covered[static_cast<std::size_t>(out)] += static_cast<std::uint16_t>(1 - hit);
        hit = 1;
      }
    }
    return walls;
  }

  /// The turn near `turn_rad` at which the walls are sharpest.
  double sharpest(double turn_rad, double reach_rad, double step_rad, const Eigen::Vector2d& middle_mm,
                  double search_mm) const {
    double best = -1, at = turn_rad;
    const int steps = static_cast<int>(std::lround(reach_rad / step_rad));
    for (int k = -steps; k <= steps; ++k) {
      const double angle = turn_rad + k * step_rad;
      double sharp = 0;
      for (const Wall& wall : walls(angle, middle_mm, search_mm)) sharp += wall.sharpness();
      if (sharp > best) best = sharp, at = angle;
    }
    return at;
  }

 private:
  std::vector<Vector2f> points_;
  Eigen::Vector2d half_mm_;
};

/// Points at the level at which most of those near the walls' height lie.
std::vector<Vector2f> rim_points(std::span<const Eigen::Vector3f> points, const Eigen::Vector3d& size_mm,
                                 const SupplyPlaceLimits& limits, double noise_mm) {
  const Eigen::Vector2d half = size_mm.head<2>() / 2;
  const double turned = half.norm() * std::sin(limits.turn_rad);
  const Eigen::Vector2d outer = half.array() + limits.offset_mm + turned + kWallMax_mm;
  const Eigen::Vector2d inner = (half.array() - limits.offset_mm - turned).max(0.2 * half.array());
  std::vector<Eigen::Vector3f> near;
  for (const auto& p : points) {
    if (!p.allFinite() || std::abs(static_cast<double>(p.z()) - size_mm.z()) > kLevelBand_mm) continue;
    const double x = std::abs(static_cast<double>(p.x())), y = std::abs(static_cast<double>(p.y()));
    if (x > outer.x() || y > outer.y() || (x < inner.x() && y < inner.y())) continue;
    near.push_back(p);
  }
  // The level: the middle of the window with most points in it.
  const double window_mm = std::max(2.0, 4 * noise_mm);
  std::ranges::sort(near, {}, [](const auto& p) { return p.z(); });
  std::size_t best = 0, best_count = 0;
  for (std::size_t low = 0, high = 0; low < near.size(); ++low) {
    while (high < near.size() && static_cast<double>(near[high].z() - near[low].z()) <= window_mm) ++high;
    if (high - low > best_count) best_count = high - low, best = low;
  }
  std::vector<Vector2f> rim;
  const std::size_t every = 1 + best_count / kPointsMax;
  for (std::size_t i = best; i < best + best_count; i += every) rim.emplace_back(near[i].head<2>());
  return rim;
}

template <class... Numbers>
std::string words(const char* format, Numbers... numbers) {
  std::array<char, 240> text{};
  std::snprintf(text.data(), text.size(), format, numbers...);
  return text.data();
}
/// How far the middle between the walls lies from where they were looked for, in the walls' own axes; and how many.
Expected<std::pair<Eigen::Vector2d, int>, std::string> middle_of(const std::array<Wall, 4>& walls,
                                                                 const Eigen::Vector3d& size_mm) {
  constexpr std::array<const char*, 2> kAxis{"x", "y"};
  Eigen::Vector2d offset = Eigen::Vector2d::Zero();
  int seen = 0;
  bool any_pair = false;
  for (std::size_t axis = 0; axis < 2; ++axis) {
    const auto at = static_cast<Eigen::Index>(axis);
    const auto low = walls[2 * axis].inner_face_mm(), high = walls[2 * axis + 1].inner_face_mm();
    seen += static_cast<int>(low.has_value()) + static_cast<int>(high.has_value());
    if (!low && !high) return unexpected(words("neither wall of the supply that ends its %s is seen", kAxis[axis]));
    if (low && high) {
      any_pair = true;
      const double apart = *low + *high;
      if (std::abs(apart - size_mm[at]) > std::max(kWallsApartMin_mm, kWallsApartTolerance * size_mm[at]))
        return unexpected(
            words("the walls in %s stand %.0f mm apart, supply.size_mm says %.0f", kAxis[axis], apart, size_mm[at]));
      offset[at] = (*high - *low) / 2;
    } else {
      offset[at] = high ? *high - size_mm[at] / 2 : size_mm[at] / 2 - *low;
    }
  }
  if (!any_pair)
    return unexpected(words("only %d walls of the supply are seen, and no two that face each other", seen));
  return std::pair{offset, seen};
}
}  // namespace

Expected<SupplyPlace, std::string> find_supply(std::span<const Eigen::Vector3f> points_said_mm, const SupplyBox& supply,
                                               const SupplyPlaceLimits& limits, double noise_mm) {
  const Eigen::Vector3d& size = supply.size_mm;
  const std::vector<Vector2f> points = rim_points(points_said_mm, size, limits, noise_mm);
  if (points.size() < kPointsMin)
    return unexpected(
        words("no rim of the supply at %.0f mm over its floor: %zu points there, at least %zu are wanted; "
              "does the sweep reach beyond the walls?",
              size.z(), points.size(), kPointsMin));
  const Rim rim{points, size};

  // A little beyond the limit, so that what stands beyond is told from what is not found. Then once more with a nearer
  // look, along the whole walls.
  const double far_mm = 1.3 * limits.offset_mm;
  SupplyPlace place;
  double turn = rim.sharpest(0, 1.25 * limits.turn_rad, 0.5 * kDegree, Eigen::Vector2d::Zero(), far_mm);
  turn = rim.sharpest(turn, 0.6 * kDegree, 0.1 * kDegree, Eigen::Vector2d::Zero(), far_mm);
  Eigen::Vector2d middle = Eigen::Vector2d::Zero();
  for (const double search_mm : {far_mm, kNear_mm}) {
    if (search_mm == kNear_mm) turn = rim.sharpest(turn, 1.5 * kDegree, 0.05 * kDegree, middle, search_mm);
    const auto offset = middle_of(rim.walls(turn, middle, search_mm), size);
    if (!offset) return unexpected(offset.error());
    middle += offset->first;
    place.walls = offset->second;
  }
  const Eigen::Vector2d said = Eigen::Rotation2Dd{turn} * middle;
  if (std::abs(turn) > limits.turn_rad || said.cwiseAbs().maxCoeff() > limits.offset_mm)
    return unexpected(
        words("the supply stands %.0f mm in x and %.0f mm in y beside its place and is turned by %.1f deg; "
              "%.0f mm and %.0f deg are allowed",
              said.x(), said.y(), turn / kDegree, limits.offset_mm, limits.turn_rad / kDegree));
  place.turn_rad = turn;
  place.T_said_found.translation().head<2>() = said;
  place.T_said_found.linear() = Eigen::AngleAxisd{turn, Eigen::Vector3d::UnitZ()}.toRotationMatrix();
  return place;
}
}  // namespace binpick::vision
