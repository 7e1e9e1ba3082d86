#include "tests/emulators/scanner/lps36_view.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "tests/emulators/scanner/phase_shift.hpp"

namespace binpick::emulators {
namespace {
using Eigen::Vector3d;
constexpr float kNothing = std::numeric_limits<float>::quiet_NaN();
/// The camera sees what lies within this of the place where it looks for it.
constexpr double kHidden_mm = 1;
/// Two lines of light closer than so many sd of the depth run into one peak.
constexpr double kPeakWidth_sd = 20;
/// Cosine of incidence below which the line is too weak, and above which it never is.
constexpr double kCosNone = 0.2, kCosEnough = 0.32;
/// Points are lost in runs of so many, for so long.
constexpr std::size_t kRunPoints = 5;
constexpr std::int64_t kRun_ns = 20'000'000;
}  // namespace

/// Of the line of light, at one place along it.
struct Lps36View::Peak {
  double depth_mm = 0;  ///< 0: none.
  double light = 0;     ///< Cosine of incidence.
};

Lps36View::Lps36View(const World& world, WhereScanner where, const LightSection& device)
    : world_{&world}, where_{std::move(where)}, device_{device} {}

double Lps36View::sigma_at(double depth_mm) const {
  const double ratio = depth_mm / device_.stand_off_mm;
  return device_.sigma_mm * ratio * ratio;
}

/// Where the ray x = slope · z meets something that the camera sees as well.
Lps36View::Peak Lps36View::peak(const Eigen::Isometry3d& T_supply_scanner, double slope) const {
  const Vector3d ray = Vector3d{slope, 0, 1}.normalized();
  const Vector3d light = T_supply_scanner.translation(), direction = T_supply_scanner.linear() * ray;
  const auto hit = world_->cast(light, direction, 2 * device_.range_max_mm);
  if (!hit) return {};
  const Vector3d camera = T_supply_scanner * Vector3d{0, -device_.baseline_mm, 0};
  const Vector3d seen = light + hit->distance_mm * direction - camera;
  const auto first = world_->cast(camera, seen.normalized(), 2 * device_.range_max_mm);
  if (!first || std::abs(first->distance_mm - seen.norm()) > kHidden_mm) return {};
  return {ray.z() * hit->distance_mm, hit->cos_incidence};
}

Lps36View::Peak Lps36View::peak_of_spot(const Eigen::Isometry3d& T_supply_scanner, double slope) const {
  std::array<Peak, 3> parts;
  const double apart = device_.spot_mm / 3 / device_.stand_off_mm;
  for (std::size_t k = 0; k < parts.size(); ++k)
    parts[k] = peak(T_supply_scanner, slope + (static_cast<double>(k) - 1) * apart);
  std::ranges::sort(parts, {}, &Peak::depth_mm);
  Peak best;
  double brightest = 0;
  for (std::size_t from = 0; from < parts.size(); ++from) {
    if (parts[from].depth_mm <= 0) continue;
    const double reach = parts[from].depth_mm + kPeakWidth_sd * sigma_at(parts[from].depth_mm);
    double light = 0, depth = 0;
    std::size_t n = 0;
    for (std::size_t k = from; k < parts.size() && parts[k].depth_mm <= reach; ++k, ++n) {
      light += parts[k].light;
      depth += parts[k].light * parts[k].depth_mm;
    }
    if (light <= brightest) continue;
    brightest = light;
    best = {depth / light, light / static_cast<double>(n)};
  }
  return best;
}

PointLine Lps36View::operator()(TimePoint at, std::size_t points) const {
  const Eigen::Isometry3d T_supply_scanner = where_(at).iso;
  const auto slope_of = [&](std::size_t i) {
    return device_.half_width_per_mm * (2 * (static_cast<double>(i) + 0.5) / static_cast<double>(points) - 1);
  };
  std::vector<Peak> peaks;
  for (std::size_t i = 0; i < points; ++i) peaks.push_back(peak(T_supply_scanner, slope_of(i)));
  const std::vector<Peak> thin = peaks;
  const auto jumps = [&](std::size_t i, std::size_t k) {
    return std::abs(thin[i].depth_mm - thin[k].depth_mm) > 2 * device_.spot_mm + 4 * device_.sigma_mm;
  };
  for (std::size_t i = 0; device_.spot_mm > 0 && i < points; ++i)
    if ((i > 0 && jumps(i, i - 1)) || (i + 1 < points && jumps(i, i + 1)))
      peaks[i] = peak_of_spot(T_supply_scanner, slope_of(i));

  const std::int64_t time_ns = std::chrono::duration_cast<std::chrono::nanoseconds>(at.time_since_epoch()).count();
  Random random{mixed(device_.seed, static_cast<std::uint64_t>(time_ns))};
  PointLine line{std::vector<float>(points, kNothing), std::vector<float>(points, kNothing)};
  for (std::size_t i = 0; i < points; ++i) {
    const double normal = random.normal();  // always drawn, so that a lost point does not shift the others' noise
    const Peak& peak = peaks[i];
    if (peak.depth_mm <= 0) continue;
    Random run{mixed(mixed(device_.seed, static_cast<std::uint64_t>(time_ns / kRun_ns)), i / kRunPoints)};
    if (device_.dropouts && run.uniform() < (kCosEnough - peak.light) / (kCosEnough - kCosNone)) continue;
    const double depth = peak.depth_mm + sigma_at(peak.depth_mm) * normal / std::sqrt(std::max(0.3, peak.light));
    if (depth < device_.range_min_mm || depth > device_.range_max_mm) continue;
    line.z_mm[i] = static_cast<float>(depth);
    line.x_mm[i] = static_cast<float>(depth * slope_of(i));
  }
  return line;
}
}  // namespace binpick::emulators
