#include "bench/scenes/scanners.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "bench/scenes/measuring.hpp"
#include "tests/emulators/scanner/phase_shift.hpp"

namespace binpick::bench {
namespace {
using Eigen::Vector3d;
using Eigen::Vector3f;

/// The sweep begins and ends so far beyond the supply.
constexpr double kBeyond_mm = 20;
constexpr double kLms400Step_rad = 0.25 * std::numbers::pi / 180;
/// The camera meets the point that the laser lit, or something this much in front of it.
constexpr float kSame_mm = 0.5F;

Eigen::Isometry3d jitter(const ClassSetting& setting, emulators::Random& random) {
  const auto vector = [&] { return Vector3d{random.normal(), random.normal(), random.normal()}; };
  const Vector3d turn = setting.jitter_rad * vector();
  Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  T.translation() = setting.jitter_mm * vector();
  T.linear() = Eigen::AngleAxisd{turn.norm(), turn.normalized()}.toRotationMatrix();
  return T;
}
}  // namespace

std::vector<Vector3f> Profile::directions() const {
  std::vector<Vector3f> turned;
  turned.reserve(rays.size());
  for (const Vector3f& ray : rays) turned.push_back(T_supply_carrier.linear() * ray);
  return turned;
}

std::vector<Profile> sweep_lines(const ClassSetting& setting, std::uint64_t seed, double sparse) {
  const vision::ScannerFigures& figures = vision::figures_of(setting.scanner);
  const double half_x = setting.supply_mm.x() / 2 + kBeyond_mm, half_y = setting.supply_mm.y() / 2 + kBeyond_mm;
  const double fan = std::atan(half_x / figures.stand_off_mm);
  const double step =
      sparse * (setting.triangulation ? figures.spacing_across_mm / figures.stand_off_mm : kLms400Step_rad);
  std::vector<Vector3f> rays;
  for (double a = -fan; a <= fan; a += step) rays.push_back(Vector3d{std::sin(a), 0, -std::cos(a)}.cast<float>());
  emulators::Random random{emulators::mixed(seed, 1)};
  std::vector<Profile> lines;
  for (double y = -half_y; y <= half_y; y += sparse * figures.spacing_along_mm) {
    Eigen::Isometry3d believed = Eigen::Isometry3d::Identity();
    believed.translation() = Vector3d{0, setting.triangulation ? y : 0, figures.stand_off_mm};
    if (!setting.triangulation)
      believed.linear() = Eigen::AngleAxisd{std::atan(y / figures.stand_off_mm), Vector3d::UnitX()}.toRotationMatrix();
    const Eigen::Isometry3d real = believed * jitter(setting, random);
    Profile line;
    line.T_supply_believed = believed.cast<float>();
    line.T_supply_carrier = real.cast<float>();
    line.camera_mm = (real * Vector3d{0, setting.baseline_mm, 0}).cast<float>();
    line.rays = rays;
    lines.push_back(std::move(line));
  }
  return lines;
}

void hide_from_camera(const Profile& line, const std::vector<Vector3f>& directions, const Caster& cast, float limit_mm,
                      std::vector<emulators::BundleHit>& hits) {
  std::vector<Vector3f> towards;
  std::vector<std::size_t> of;
  std::vector<float> distance_mm;
  for (std::size_t i = 0; i < hits.size(); ++i) {
    if (!hits[i].met()) continue;
    const Vector3f to = line.light_mm() + hits[i].distance_mm * directions[i] - line.camera_mm;
    distance_mm.push_back(to.norm());
    towards.push_back(to / distance_mm.back());
    of.push_back(i);
  }
  std::vector<emulators::BundleHit> seen;
  cast(line.camera_mm, towards, 2 * limit_mm, seen);
  for (std::size_t k = 0; k < of.size(); ++k)
    if (seen[k].met() && seen[k].distance_mm < distance_mm[k] - kSame_mm)
      hits[of[k]] = {kNothing_mm, 0, Vector3f::Zero()};
}

std::vector<std::vector<Echo>> ideal_sweep(const ClassSetting& setting, const std::vector<Profile>& lines,
                                           const emulators::World& world) {
  const auto limit = static_cast<float>(2 * vision::figures_of(setting.scanner).stand_off_mm);
  const Caster cast = [&](const Vector3f& from, const std::vector<Vector3f>& directions, float limit_mm,
                          std::vector<emulators::BundleHit>& hits) {
    emulators::cast_bundle(world, from, directions, limit_mm, hits);
  };
  std::vector<std::vector<Echo>> sweep;
  std::vector<emulators::BundleHit> hits;
  for (const Profile& line : lines) {
    const std::vector<Vector3f> directions = line.directions();
    cast(line.light_mm(), directions, limit, hits);
    if (setting.triangulation) hide_from_camera(line, directions, cast, limit, hits);
    auto& row = sweep.emplace_back(hits.size());
    for (std::size_t i = 0; i < hits.size(); ++i)
      if (hits[i].met())
        row[i] = {hits[i].distance_mm, hits[i].object, std::abs(hits[i].normal.dot(directions[i])), hits[i].normal};
  }
  return sweep;
}

bool beside_a_jump(const std::vector<std::vector<Echo>>& sweep, std::size_t line, std::size_t point, float jump_mm) {
  const Echo& own = sweep[line][point];
  const auto differs = [&](const Echo& other) {
    return own.seen() != other.seen() || (own.seen() && std::abs(own.distance_mm - other.distance_mm) > jump_mm);
  };
  return (point > 0 && differs(sweep[line][point - 1])) ||
         (point + 1 < sweep[line].size() && differs(sweep[line][point + 1])) ||
         (line > 0 && differs(sweep[line - 1][point])) || (line + 1 < sweep.size() && differs(sweep[line + 1][point]));
}

std::vector<Vector3f> measured_points(const ClassSetting& setting, const std::vector<Profile>& lines,
                                      const std::vector<std::vector<Echo>>& ideal, const emulators::World& world,
                                      const ScanOptions& options) {
  return setting.triangulation ? triangulated_points(setting, lines, ideal, world, options)
                               : time_of_flight_points(setting, lines, ideal, world, options);
}
}  // namespace binpick::bench
