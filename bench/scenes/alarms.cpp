#include "bench/scenes/alarms.hpp"

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <map>

#include "bench/scenes/classes.hpp"
#include "tests/emulators/world/shapes.hpp"
#include "tests/emulators/world/world.hpp"

namespace binpick::bench {
namespace {
constexpr std::uint64_t kFirstPile = 9'001, kPiles = 6;

/// Bricks or bolts of about the size of the class's parts.
ScenePart foreign_part(const ClassSetting& setting, bool bolt) {
  const auto size = static_cast<float>(0.3 * std::min(setting.supply_mm.y(), 450.0));
  ScenePart part;
  part.scanner = setting.scanner;
  part.pile = 30;
  if (bolt) {
    part.body.name = "bolt";
    part.body.mesh = emulators::shapes::turn(0, {{0.2F * size, 0.25F * size, 0}, {size, 0.13F * size, 0}}, 24);
    part.body.pieces = {emulators::cylinder_piece(0.25F * size, 0, 0.2F * size, 24),
                        emulators::cylinder_piece(0.13F * size, 0.2F * size, size, 24)};
  } else {
    part.body.name = "brick";
    const Eigen::Vector3f half = size * Eigen::Vector3f{0.45F, 0.21F, 0.14F};
    part.body.mesh = emulators::box_mesh(2 * half.cast<double>());
    part.body.pieces = {emulators::box_piece(-half, half)};
  }
  return part;
}

struct Alarms {
  int scenes = 0, scenes_with = 0, detections = 0;
  double highest = 0;
  void add(const SceneLine& line) {
    int own = 0;
    for (const DetectionLine& d : line.detections) {
      own += d.score > 0.5;
      highest = std::max(highest, d.score);
    }
    ++scenes;
    scenes_with += own > 0;
    detections += own;
  }
};
}  // namespace

void print_false_alarms(const RunOptions& options, const std::vector<std::string>& classes, std::size_t count) {
  std::printf("| | scenes | with a detection above .5 | such detections | highest score |\n|---|---|---|---|---|\n");
  for (const ClassSetting& setting : class_settings()) {
    if (!classes.empty() && std::ranges::find(classes, setting.name) == classes.end()) continue;
    const std::vector<std::string> names = part_names(setting.scanner);
    std::map<std::string, vision::KnowledgeBase> bases;
    std::map<std::string, Judge> judges;
    std::vector<ScenePart> piled;
    for (const std::string& name : names) {
      piled.push_back(scene_part(setting.scanner, name));
      const std::string folder = options.bases.empty() ? options.out + "/bases" : options.bases;
      bases.emplace(name,
                    knowledge_base_of(piled.back(), folder + "/" + std::string{setting.name} + "-" + name + ".kb"));
      judges.emplace(name, Judge{piled.back()});
    }
    const std::vector<ScenePart> foreign{foreign_part(setting, false), foreign_part(setting, true)};
    const std::vector<double> fills{1, 0.7, 0.4, 0.2};
    for (const char* kind : {"another part", "empty supply", "foreign bodies"}) {
      Alarms alarms;
      for (std::size_t k = 0; k < count; ++k) {
        const std::string& wanted = names[k % names.size()];
        const ScenePart& there = kind[0] == 'a' ? piled[(k + 1 + k / names.size() % (names.size() - 1)) % names.size()]
                                                : foreign[k / names.size() % 2];
        const SceneId id{kFirstPile + k % kPiles, fills[k / kPiles % fills.size()], kFirstPile * 1'000 + k};
        std::vector<ObjectPose> poses;
        if (kind[0] != 'e') poses = taken_down(settled_pile(there, id.pile, options.piles), id.fill);
        SceneLine line;
        detect_scene(make_scene(there, poses, id, options.bias_mm), judges.at(wanted), bases.at(wanted),
                     options.detector(), line);
        alarms.add(line);
      }
      std::printf("| %s, %s | %d | %d | %d | %.2f |\n", setting.name.data(), kind, alarms.scenes, alarms.scenes_with,
                  alarms.detections, alarms.highest);
      std::fflush(stdout);
    }
  }
}
}  // namespace binpick::bench
