#include <array>
#include <cmath>

#include "bench/scenes/measuring.hpp"
#include "tests/emulators/scanner/phase_shift.hpp"

namespace binpick::bench {
namespace {
using Eigen::Vector3f;
using emulators::LightEcho;
using emulators::mixed;
using emulators::Random;

constexpr double kReflectance = 0.9;
constexpr double kSigmaMax_mm = 10;
constexpr float kJump_mm = 8;
/// While it is measured, the spot runs along the line by this share of the way to the next point.
constexpr double kSmear = 0.5;
constexpr std::size_t kRunPoints = 4, kRunLines = 3;
}  // namespace

std::vector<Vector3f> time_of_flight_points(const ClassSetting& setting, const std::vector<Profile>& lines,
                                            const std::vector<std::vector<Echo>>& ideal, const emulators::World& world,
                                            const ScanOptions& options) {
  const vision::ScannerFigures& figures = vision::figures_of(setting.scanner);
  const auto limit = static_cast<float>(2 * figures.stand_off_mm);
  std::vector<Vector3f> points, spot;
  std::vector<emulators::BundleHit> hits;
  for (std::size_t line = 0; line < lines.size(); ++line) {
    const Profile& profile = lines[line];
    Random random{mixed(mixed(options.seed, 2), line)};
    for (std::size_t i = 0; i < ideal[line].size(); ++i) {
      const double normal = random.normal();
      const Echo& echo = ideal[line][i];
      LightEcho light{echo.distance_mm, echo.seen() ? kReflectance * echo.cos_incidence : 0};
      int object = echo.object;
      if (beside_a_jump(ideal, line, i, kJump_mm)) {
        spot.clear();
        const float distance = echo.seen() ? echo.distance_mm : static_cast<float>(figures.stand_off_mm);
        add_spot(profile.rays[i], distance, setting.spot_along_mm + kSmear * figures.spacing_across_mm,
                 setting.spot_across_mm, spot);
        for (Vector3f& ray : spot) ray = profile.T_supply_carrier.linear() * ray;
        emulators::cast_bundle(world, profile.light_mm(), spot, limit, hits);
        std::array<LightEcho, kSpotRays> echoes{};
        std::size_t count = 0;
        float nearest = kNothing_mm;
        for (std::size_t k = 0; k < kSpotRays; ++k) {
          if (!hits[k].met()) continue;
          echoes[count++] = {hits[k].distance_mm, kReflectance * std::abs(hits[k].normal.dot(spot[k]))};
          if (hits[k].distance_mm < nearest) nearest = hits[k].distance_mm, object = hits[k].object;
        }
        light = emulators::mixed_echo({echoes.data(), count}, kSpotRays).value_or(LightEcho{});
      }
      Random run{mixed(mixed(options.seed, 3 + line / kRunLines), i / kRunPoints)};
      if (light.light <= 0 || run.uniform() >= emulators::echoes_kept(light.light)) continue;
      const double bias =
          emulators::material_bias_mm(object > 0 ? world.find(object)->part : "supply", options.bias_mm);
      const double range =
          light.distance_mm + bias + emulators::phase_noise_mm(light.light, figures.noise_mm, kSigmaMax_mm) * normal;
      points.push_back(profile.T_supply_believed * Vector3f{static_cast<float>(range) * profile.rays[i]});
    }
  }
  return points;
}
}  // namespace binpick::bench
