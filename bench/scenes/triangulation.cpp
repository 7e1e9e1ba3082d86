#include <algorithm>
#include <cmath>
#include <vector>

#include "bench/scenes/measuring.hpp"
#include "tests/emulators/scanner/phase_shift.hpp"

namespace binpick::bench {
namespace {
using Eigen::Vector3f;
using emulators::mixed;
using emulators::Random;

/// The noise of a peak's place on the imager, in pixels: with the class's noise this gives the height of a pixel.
constexpr double kPeakNoise_px = 0.2;
/// Two lines of light closer than this run into one peak.
constexpr double kPeakWidth_px = 4;
/// Of the spot's rays, so many must come back.
constexpr std::size_t kSpotRaysMin = 3;
/// Cosine of incidence below which the line is too weak, and above which it never is.
constexpr double kCosNone = 0.2, kCosEnough = 0.32;
/// Lines are lost in runs of so many points, over so many profiles; this share of them for no visible reason.
constexpr std::size_t kRunPoints = 5, kRunLines = 2;
constexpr double kLostRuns = 0.006;
/// Within this of the mirror direction the imager is blinded, and the peak is wide.
constexpr double kBlinded_rad = 0.06;
constexpr double kBlindedNoise = 3;

class Triangulation {
 public:
  Triangulation(const ClassSetting& setting, const emulators::World& world, const ScanOptions& options)
      : setting_{setting}, world_{world}, options_{options}, figures_{vision::figures_of(setting.scanner)} {}

  void measure(const std::vector<Profile>& lines, const std::vector<std::vector<Echo>>& ideal, std::size_t line,
               std::vector<Vector3f>& points) const {
    const Profile& profile = lines[line];
    std::vector<Echo> echoes = ideal[line];
    mix_at_jumps(profile, ideal, line, echoes);
    Random random{mixed(mixed(options_.seed, 2), line)};
    for (std::size_t i = 0; i < echoes.size(); ++i) {
      const double normal = random.normal();  // always drawn, so that a lost point does not shift the others' noise
      const Echo& echo = echoes[i];
      if (!echo.seen()) continue;
      Random run{mixed(mixed(options_.seed, 3 + line / kRunLines), i / kRunPoints)};
      const double lost = std::max(kLostRuns, (kCosEnough - echo.cos_incidence) / (kCosEnough - kCosNone));
      if (run.uniform() < lost) continue;
      const Vector3f& ray = profile.rays[i];
      const double depth = -ray.z() * echo.distance_mm;
      double sigma = sigma_at(depth) / std::sqrt(std::max(0.3, static_cast<double>(echo.cos_incidence)));
      if (blinded(profile, i, echo)) sigma *= kBlindedNoise;
      const Vector3f p = static_cast<float>(echo.distance_mm + sigma * normal / -ray.z()) * ray;
      points.push_back(profile.T_supply_believed * Vector3f{quantised(p.x()), p.y(), quantised(p.z())});
    }
  }

 private:
  double sigma_at(double depth_mm) const {
    const double ratio = depth_mm / figures_.stand_off_mm;
    return figures_.noise_mm * ratio * ratio;
  }
  float quantised(float value) const {
    return static_cast<float>(setting_.quantum_mm * std::round(value / setting_.quantum_mm));
  }

  bool blinded(const Profile& line, std::size_t i, const Echo& echo) const {
    const Vector3f to_light = -(line.T_supply_carrier.linear() * line.rays[i]);
    const Vector3f p = line.light_mm() - echo.distance_mm * to_light;
    const Vector3f half = (to_light + (line.camera_mm - p).normalized()).normalized();
    return std::abs(half.dot(echo.normal)) > std::cos(kBlinded_rad);
  }

  /// At a jump the spot lights two surfaces. Each of its rays gives a peak on the imager; peaks close together run into
  /// one whose middle lies between or beside them, of peaks far apart the brightest is taken.
  void mix_at_jumps(const Profile& profile, const std::vector<std::vector<Echo>>& ideal, std::size_t line,
                    std::vector<Echo>& echoes) const {
    const auto jump = static_cast<float>(
        std::max(3 * std::max(figures_.spacing_along_mm, figures_.spacing_across_mm), 4 * figures_.noise_mm));
    std::vector<std::size_t> mixed_points;
    std::vector<Vector3f> rays;
    for (std::size_t i = 0; i < echoes.size(); ++i) {
      if (!beside_a_jump(ideal, line, i, jump)) continue;
      mixed_points.push_back(i);
      const float distance = echoes[i].seen() ? echoes[i].distance_mm : static_cast<float>(figures_.stand_off_mm);
      add_spot(profile.rays[i], distance, setting_.spot_along_mm, setting_.spot_across_mm, rays);
    }
    std::vector<Vector3f> directions;
    for (const Vector3f& ray : rays) directions.push_back(profile.T_supply_carrier.linear() * ray);
    const Caster cast = [&](const Vector3f& from, const std::vector<Vector3f>& to, float limit_mm,
                            std::vector<emulators::BundleHit>& hits) {
      emulators::cast_bundle(world_, from, to, limit_mm, hits);
    };
    const auto limit = static_cast<float>(2 * figures_.stand_off_mm);
    std::vector<emulators::BundleHit> hits;
    cast(profile.light_mm(), directions, limit, hits);
    hide_from_camera(profile, directions, cast, limit, hits);
    for (std::size_t k = 0; k < mixed_points.size(); ++k) {
      const std::size_t i = mixed_points[k];
      echoes[i] = peak(profile.rays[i], &rays[k * kSpotRays], &directions[k * kSpotRays], &hits[k * kSpotRays]);
    }
  }

  Echo peak(const Vector3f& nominal, const Vector3f* rays, const Vector3f* directions,
            const emulators::BundleHit* hits) const {
    struct Light {
      double depth, light;
      std::size_t ray;
    };
    std::vector<Light> lights;
    for (std::size_t k = 0; k < kSpotRays; ++k) {
      if (!hits[k].met()) continue;
      // A line of light beside the nominal sheet is taken for one on it, at another depth.
      const Vector3f p = hits[k].distance_mm * rays[k];
      const double depth = setting_.baseline_mm * -p.z() / (setting_.baseline_mm - p.y());
      lights.push_back({depth, std::max(1e-3F, std::abs(hits[k].normal.dot(directions[k]))), k});
    }
    if (lights.size() < kSpotRaysMin) return {};
    std::ranges::sort(lights, {}, &Light::depth);
    const double width = kPeakWidth_px * sigma_at(lights[0].depth) / kPeakNoise_px;
    double best = 0;
    Echo echo;
    for (std::size_t from = 0; from < lights.size(); ++from) {
      double sum = 0, depth = 0, strongest = 0;
      std::size_t ray = 0;
      for (std::size_t k = from; k < lights.size() && lights[k].depth - lights[from].depth < width; ++k) {
        sum += lights[k].light;
        depth += lights[k].light * lights[k].depth;
        if (lights[k].light > strongest) strongest = lights[k].light, ray = lights[k].ray;
      }
      if (sum <= best) continue;
      best = sum;
      const emulators::BundleHit& hit = hits[ray];
      echo = {static_cast<float>(depth / sum / -nominal.z()), hit.object, static_cast<float>(strongest), hit.normal};
    }
    return echo;
  }

  const ClassSetting& setting_;
  const emulators::World& world_;
  const ScanOptions& options_;
  const vision::ScannerFigures& figures_;
};
}  // namespace

void add_spot(const Vector3f& ray, float distance_mm, double along_mm, double across_mm, std::vector<Vector3f>& rays) {
  // The line lies in the carrier's x, z plane.
  const Vector3f along{-ray.z(), 0, ray.x()}, across{0, 1, 0};
  for (int a = -1; a <= 1; ++a)
    for (int b = -1; b <= 1; ++b)
      rays.push_back((ray + static_cast<float>(a * along_mm / 3 / distance_mm) * along +
                      static_cast<float>(b * across_mm / 3 / distance_mm) * across)
                         .normalized());
}

std::vector<Vector3f> triangulated_points(const ClassSetting& setting, const std::vector<Profile>& lines,
                                          const std::vector<std::vector<Echo>>& ideal, const emulators::World& world,
                                          const ScanOptions& options) {
  const Triangulation device{setting, world, options};
  std::vector<Vector3f> points;
  for (std::size_t line = 0; line < lines.size(); ++line) device.measure(lines, ideal, line, points);
  return points;
}
}  // namespace binpick::bench
