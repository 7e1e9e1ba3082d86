#include "tests/emulators/scanner/scanner_view.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <vector>

#include "tests/emulators/scanner/phase_shift.hpp"

namespace binpick::emulators {
namespace {
using Eigen::Vector3d;
constexpr float kNoEcho = std::numeric_limits<float>::quiet_NaN();

/// Neighbours farther apart than this may have an edge between them.
constexpr double kEdge_mm = 8;
/// Echoes are lost for so many neighbours and for so long together.
constexpr std::size_t kRunPoints = 4;
constexpr std::int64_t kRun_ns = 8'000'000;

struct Echo {
  double distance_mm = 0;
  double light = 0;  ///< Reflectance times cosine of incidence.
  int object = 0;
};
}  // namespace

ScannerView::ScannerView(const World& world, WhereScanner where, const RangeNoise& noise)
    : world_{&world}, where_{std::move(where)}, noise_{noise} {}

ScanLine ScannerView::operator()(TimePoint middle, Angle first, Angle step, std::size_t points) const {
  const Eigen::Isometry3d T_supply_scanner = where_(middle).iso;
  const Vector3d origin = T_supply_scanner.translation();
  const auto cast = [&](double along_rad, double across_rad) -> std::optional<Echo> {
    const Vector3d direction{std::cos(along_rad) * std::cos(across_rad), std::sin(across_rad),
                             std::sin(along_rad) * std::cos(across_rad)};
    const auto hit = world_->cast(origin, T_supply_scanner.linear() * direction, 2 * noise_.range_max_mm);
    if (!hit) return std::nullopt;
    return Echo{hit->distance_mm, hit->reflectance * hit->cos_incidence, hit->object};
  };

  std::vector<std::optional<Echo>> echoes;
  for (std::size_t i = 0; i < points; ++i)
    echoes.push_back(cast(first.in_rad() + static_cast<double>(i) * step.in_rad(), 0));
  const std::vector<std::optional<Echo>> rays = echoes;

  const auto differs = [&](std::size_t i, std::size_t k) {
    return rays[i].has_value() != rays[k].has_value() ||
           (rays[i] && std::abs(rays[i]->distance_mm - rays[k]->distance_mm) > kEdge_mm);
  };
  for (std::size_t i = 0; noise_.beam_mm > 0 && i < points; ++i) {
    const bool at_edge = (i > 0 && differs(i, i - 1)) || (i + 1 < points && differs(i, i + 1));
    if (!at_edge) continue;
    // Nine rays over the spot, which the turning mirror draws out along the line.
    const double distance = rays[i] ? rays[i]->distance_mm : noise_.range_max_mm;
    const double half_spot = noise_.beam_mm / 2 / distance, half_along = half_spot + 0.25 * step.in_rad();
    const double along = first.in_rad() + static_cast<double>(i) * step.in_rad();
    std::vector<LightEcho> spot;
    int nearest = 0;
    double nearest_mm = std::numeric_limits<double>::infinity();
    for (int a = -1; a <= 1; ++a) {
      for (int b = -1; b <= 1; ++b) {
        const auto echo = cast(along + a * 2.0 / 3 * half_along, b * 2.0 / 3 * half_spot);
        if (!echo) continue;
        spot.push_back({echo->distance_mm, echo->light});
        if (echo->distance_mm < nearest_mm) nearest_mm = echo->distance_mm, nearest = echo->object;
      }
    }
    echoes[i].reset();
    if (const auto mix = mixed_echo(spot, 9)) echoes[i] = Echo{mix->distance_mm, mix->light, nearest};
  }

  const std::int64_t time_ns = std::chrono::duration_cast<std::chrono::nanoseconds>(middle.time_since_epoch()).count();
  Random random{mixed(noise_.seed, static_cast<std::uint64_t>(time_ns))};
  ScanLine line;
  line.range_mm.reserve(points);
  line.remission.reserve(points);
  for (std::size_t i = 0; i < points; ++i) {
    const double normal = random.normal();  // always drawn, so that a lost echo does not shift the others' noise
    float range = kNoEcho;
    double light = 0;
    if (const auto& echo = echoes[i]) {
      light = echo->light;
      Random run{mixed(mixed(noise_.seed, static_cast<std::uint64_t>(time_ns / kRun_ns)), i / kRunPoints)};
      if (!noise_.dropouts || run.uniform() < echoes_kept(light)) {
        const double sigma = phase_noise_mm(light, noise_.sigma_mm, noise_.sigma_max_mm);
        const World::Object* object = noise_.bias_mm > 0 ? world_->find(echo->object) : nullptr;
        const double bias = material_bias_mm(object != nullptr ? object->part : "supply", noise_.bias_mm);
        const double measured = echo->distance_mm + bias + sigma * normal;
        if (measured >= noise_.range_min_mm && measured <= noise_.range_max_mm) range = static_cast<float>(measured);
      }
    }
    line.range_mm.push_back(range);
    line.remission.push_back(static_cast<std::uint8_t>(std::clamp(std::lround(255 * light / 1.0), 0L, 255L)));
  }
  return line;
}
}  // namespace binpick::emulators
