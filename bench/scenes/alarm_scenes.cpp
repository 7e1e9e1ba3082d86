#include "bench/scenes/alarm_scenes.hpp"

#include <algorithm>

#include "base/check.hpp"
#include "bench/scenes/classes.hpp"
#include "tests/emulators/world/shapes.hpp"
#include "tests/emulators/world/world.hpp"

namespace binpick::bench {
namespace {
constexpr std::string_view kTune = "alarms-tune", kReport = "alarms-report";
constexpr std::uint64_t kTunePile = 8'001, kReportPile = 9'001, kPiles = 6;
/// The fit needs many kinds of seams and shadows between bodies that are not ours.
constexpr std::uint64_t kTuneForeignPiles = 24;

/// Bricks or bolts of about the size of the class's parts. (The bolt's shank is no shaft of ours: one of the same
/// radius, its other end in the bolt's head, could not be told from a shaft.)
ScenePart foreign_part(const ClassSetting& setting, bool bolt) {
  const auto size = static_cast<float>(0.3 * std::min(setting.supply_mm.y(), 450.0));
  ScenePart part;
  part.scanner = setting.scanner;
  part.pile = 30;
  if (bolt) {
    part.body.name = "bolt";
    part.body.mesh = emulators::shapes::turn(0, {{0.2F * size, 0.25F * size, 0}, {size, 0.11F * size, 0}}, 24);
    part.body.pieces = {emulators::cylinder_piece(0.25F * size, 0, 0.2F * size, 24),
                        emulators::cylinder_piece(0.11F * size, 0.2F * size, size, 24)};
  } else {
    part.body.name = "brick";
    const Eigen::Vector3f half = size * Eigen::Vector3f{0.45F, 0.21F, 0.14F};
    part.body.mesh = emulators::box_mesh(2 * half.cast<double>());
    part.body.pieces = {emulators::box_piece(-half, half)};
  }
  return part;
}
}  // namespace

bool is_alarm_split(std::string_view split) { return split == kTune || split == kReport; }

AlarmScene alarm_scene(const ClassSetting& setting, const std::string& split, std::size_t number) {
  BINPICK_CHECK(is_alarm_split(split));
  const std::vector<std::string> names = part_names(setting.scanner);
  const std::vector<double> fills =
      split == kTune ? std::vector{1.0, 0.75, 0.5, 0.25} : std::vector{0.9, 0.65, 0.4, 0.2};
  const std::uint64_t first_pile = split == kTune ? kTunePile : kReportPile;
  const std::size_t k = number / kAlarmKinds.size();
  AlarmScene scene;
  scene.kind = number % kAlarmKinds.size();
  scene.wanted = names[k % names.size()];
  const std::size_t round = k / names.size();
  scene.there = scene.kind == 0
                    ? scene_part(setting.scanner, names[(k + 1 + round % (names.size() - 1)) % names.size()])
                    : foreign_part(setting, round % 2 != 0);
  scene.id = {first_pile + k % kPiles, fills[k / kPiles % fills.size()], first_pile * 1'000 + number};
  if (split == kTune && scene.kind == 2) {
    // In 4 × 24 rounds or more each part sees all piles of either body, at all fills.
    const std::size_t pair = round / 2;
    scene.id.pile = first_pile + pair % kTuneForeignPiles;
    scene.id.fill = fills[(pair + pair / kTuneForeignPiles) % fills.size()];
  }
  return scene;
}

void AlarmCount::add(const SceneLine& line) {
  int own = 0;
  for (const DetectionLine& d : line.detections) {
    own += d.score > 0.5;
    highest = std::max(highest, d.score);
  }
  ++scenes;
  scenes_with += own > 0;
  detections += own;
}

AlarmCounts alarm_counts(const RunFolder& run, std::string_view split) {
  AlarmCounts counts;
  for (const auto& [key, scene] : run.scenes)
    if (scene.split == split) counts[scene.scanner][scene.part][scene.number % kAlarmKinds.size()].add(scene);
  return counts;
}
}  // namespace binpick::bench
