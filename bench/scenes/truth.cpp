#include "bench/scenes/truth.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>

#include "bench/scenes/measuring.hpp"

namespace binpick::bench {
namespace {
using Eigen::Vector3f;

/// So many points on the telling surface, and such a share of all on the object, are hard to overlook.
constexpr int kTellingPoints = 12;
constexpr double kTellingShare = 0.03;

/// The rays of a line that could meet the object's box: none, or a piece of the line.
std::pair<std::size_t, std::size_t> rays_towards(const Profile& line, const Eigen::AlignedBox3f& box) {
  const Eigen::Isometry3f T_carrier_supply = line.T_supply_carrier.inverse();
  float low = std::numeric_limits<float>::infinity(), high = -low, front = low, back = -low;
  for (int corner = 0; corner < 8; ++corner) {
    const Vector3f p = T_carrier_supply * box.corner(static_cast<Eigen::AlignedBox3f::CornerType>(corner));
    low = std::min(low, p.x() / -p.z());
    high = std::max(high, p.x() / -p.z());
    front = std::min(front, p.y());
    back = std::max(back, p.y());
  }
  if (front > 0 || back < 0) return {0, 0};
  const auto slope = [](const Vector3f& ray) { return ray.x() / -ray.z(); };
  const auto from = std::ranges::lower_bound(line.rays, low, {}, slope);
  const auto to = std::ranges::upper_bound(line.rays, high, {}, slope);
  return {static_cast<std::size_t>(from - line.rays.begin()), static_cast<std::size_t>(to - line.rays.begin())};
}

int measured_alone(const ClassSetting& setting, const std::vector<Profile>& lines,
                   const emulators::World::Object& object) {
  const auto limit = static_cast<float>(2 * vision::figures_of(setting.scanner).stand_off_mm);
  const Caster cast = [&](const Vector3f& from, const std::vector<Vector3f>& directions, float limit_mm,
                          std::vector<emulators::BundleHit>& hits) {
    emulators::cast_bundle(object, from, directions, limit_mm, hits);
  };
  int count = 0;
  std::vector<Vector3f> directions;
  std::vector<emulators::BundleHit> hits;
  for (const Profile& line : lines) {
    const auto [from, to] = rays_towards(line, object.box);
    if (from >= to) continue;
    directions.clear();
    for (std::size_t i = from; i < to; ++i) directions.push_back(line.T_supply_carrier.linear() * line.rays[i]);
    cast(line.light_mm(), directions, limit, hits);
    if (setting.triangulation) hide_from_camera(line, directions, cast, limit, hits);
    count += static_cast<int>(std::ranges::count_if(hits, [](const auto& hit) { return hit.met(); }));
  }
  return count;
}
}  // namespace

std::vector<Truth> truths_of(const ScenePart& part, const ClassSetting& setting, const std::vector<Profile>& lines,
                             const std::vector<std::vector<Echo>>& ideal, const emulators::World& world) {
  struct Seen {
    int points = 0, telling = 0;
  };
  std::map<int, Seen> seen;
  std::map<int, Eigen::Isometry3f> T_object_supply;
  for (const auto& object : world.objects())
    T_object_supply[object.id] = object.T_supply_object.iso.inverse().cast<float>();
  for (std::size_t line = 0; line < lines.size(); ++line) {
    const std::vector<Vector3f> directions = lines[line].directions();
    for (std::size_t i = 0; i < directions.size(); ++i) {
      const Echo& echo = ideal[line][i];
      if (echo.object <= 0) continue;
      Seen& own = seen[echo.object];
      ++own.points;
      if (!part.tells) continue;
      const Vector3f p = lines[line].light_mm() + echo.distance_mm * directions[i];
      own.telling += part.tells((T_object_supply[echo.object] * p).cast<double>());
    }
  }
  std::vector<Truth> truths;
  for (const auto& object : world.objects()) {
    const Seen& own = seen[object.id];
    Truth truth;
    truth.T_supply_object = object.T_supply_object;
    truth.visible = static_cast<double>(own.points) / std::max(1, measured_alone(setting, lines, object));
    truth.told = !part.tells || (own.telling >= kTellingPoints && own.telling >= kTellingShare * own.points);
    truths.push_back(truth);
  }
  return truths;
}
}  // namespace binpick::bench
