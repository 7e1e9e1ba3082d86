#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string_view>

/// How a phase-shift range finder errs: what the emulated LMS 400 and the scene benchmark share.
namespace binpick::emulators {
/// SplitMix64 (Steele, Lea, Flood 2014): a small generator that may be started at any place.
class Random {
 public:
  explicit Random(std::uint64_t state) : state_{state} {}
  std::uint64_t next() {
    std::uint64_t z = (state_ += 0x9E3779B97F4A7C15ULL);
    z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9ULL;
    z = (z ^ (z >> 27)) * 0x94D049BB133111EBULL;
    return z ^ (z >> 31);
  }
  double uniform() { return (static_cast<double>(next() >> 11) + 0.5) * 0x1p-53; }
  double normal();

 private:
  std::uint64_t state_;
};
/// A place of its own in the generator for each pair.
std::uint64_t mixed(std::uint64_t a, std::uint64_t b);

/// One ray's echo: light is the reflectance times the cosine of incidence.
struct LightEcho {
  double distance_mm = 0;
  double light = 0;
};
/// What the device takes the echoes of `rays` rays across its spot for: the phase of their sum, which lies between the
/// surfaces or even beside them.
std::optional<LightEcho> mixed_echo(std::span<const LightEcho> echoes, std::size_t rays);

/// One standard deviation for so much light; `sigma_mm` is that of a white surface, head on.
double phase_noise_mm(double light, double sigma_mm, double sigma_max_mm);
/// Below some light every echo is lost, above some none is: the share that is kept, which may be below 0 or above 1.
double echoes_kept(double light);
/// Constant of a material, within ± `bias_mm`.
double material_bias_mm(std::string_view material, double bias_mm);
}  // namespace binpick::emulators
