#include "tests/emulators/scanner/phase_shift.hpp"

#include <algorithm>
#include <cmath>
#include <complex>
#include <limits>
#include <numbers>

namespace binpick::emulators {
namespace {
constexpr double kPi = std::numbers::pi;
/// Distance after which the modulated light is in phase again. Only its ratio to an edge's height shapes mixed points.
constexpr double kAmbiguity_mm = 4000;
constexpr double kWhite = 0.9;
constexpr double kLightNone = 0.02, kLightEnough = 0.08;
}  // namespace

double Random::normal() { return std::sqrt(-2 * std::log(uniform())) * std::cos(2 * kPi * uniform()); }

std::uint64_t mixed(std::uint64_t a, std::uint64_t b) { return Random{a ^ (b * 0xD1342543DE82EF95ULL)}.next(); }

std::optional<LightEcho> mixed_echo(std::span<const LightEcho> echoes, std::size_t rays) {
  std::complex<double> sum;
  double nearest_mm = std::numeric_limits<double>::infinity();
  for (const LightEcho& echo : echoes) {
    sum += std::polar(echo.light, 2 * kPi * echo.distance_mm / kAmbiguity_mm);
    nearest_mm = std::min(nearest_mm, echo.distance_mm);
  }
  if (std::abs(sum) == 0) return std::nullopt;
  // The phase is known up to whole turns; the nearest echo tells which.
  double distance_mm = std::arg(sum) / (2 * kPi) * kAmbiguity_mm;
  distance_mm += kAmbiguity_mm * std::round((nearest_mm - distance_mm) / kAmbiguity_mm);
  return LightEcho{distance_mm, std::abs(sum) / static_cast<double>(rays)};
}

double phase_noise_mm(double light, double sigma_mm, double sigma_max_mm) {
  return std::min(sigma_mm * std::sqrt(kWhite / std::max(light, 1e-3)), std::max(sigma_max_mm, sigma_mm));
}

double echoes_kept(double light) { return (light - kLightNone) / (kLightEnough - kLightNone); }

double material_bias_mm(std::string_view material, double bias_mm) {
  if (bias_mm == 0) return 0;
  std::uint64_t hash = 0xCBF29CE484222325ULL;  // FNV-1a: the same on every machine
  for (const char c : material) hash = (hash ^ static_cast<unsigned char>(c)) * 0x100000001B3ULL;
  return bias_mm * (2 * Random{hash}.uniform() - 1);
}
}  // namespace binpick::emulators
