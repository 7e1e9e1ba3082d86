#include "bench/scenes/comparison.hpp"

#include <algorithm>
#include <array>
#include <cstdio>

#include "base/check.hpp"
#include "bench/scenes/alarm_scenes.hpp"
#include "bench/scenes/classes.hpp"

namespace binpick::bench {
namespace {
/// The scene without who saw it.
std::string scene_key(SceneLine line) {
  line.detector.clear();
  return line.key();
}

std::string formatted(double value, const char* format) {
  std::array<char, 32> text{};
  std::snprintf(text.data(), text.size(), format, value);
  return text.data();
}
}  // namespace

Estimate ClassFigures::mean(Estimate PartFigures::*of) const {
  std::vector<const Estimate*> estimates;
  for (const PartFigures& part : parts) estimates.push_back(&(part.*of));
  return mean_of(estimates);
}

std::vector<double> ClassFigures::all(std::vector<double> PartFigures::*of) const {
  std::vector<double> all;
  for (const PartFigures& part : parts) all.insert(all.end(), (part.*of).begin(), (part.*of).end());
  return all;
}

std::vector<ClassFigures> collected(const RunFolder& run, const std::string& detector) {
  std::vector<ClassFigures> classes;
  std::uint64_t stream = 0;
  const auto add = [&](const std::string& class_name, const ClassSetting& setting,
                       const std::vector<std::string>& names) {
    ClassFigures figures{class_name, {}};
    for (const std::string& name : names) {
      std::vector<const SceneLine*> scenes;
      for (const auto& [key, scene] : run.scenes)
        if (scene.detector == detector && scene.scanner == setting.name && scene.part == name &&
            !is_alarm_split(scene.split))
          scenes.push_back(&scene);
      if (scenes.empty()) continue;
      figures.parts.push_back(figures_of_part(scene_part(setting.scanner, name), scenes, ++stream));
      figures.parts.back().name = name;
    }
    if (!figures.parts.empty()) classes.push_back(std::move(figures));
  };
  for (const ClassSetting& setting : class_settings())
    add(std::string{setting.name}, setting, part_names(setting.scanner));
  add("lms400, deep supply", setting_of(vision::ScannerClass::Lms400), {std::string{kDeepPart}});
  return classes;
}

RunFolder of_split(const RunFolder& run, const std::string& split) {
  RunFolder of{run.header, {}};
  for (const auto& [key, scene] : run.scenes)
    if (scene.split == split) of.scenes.emplace(key, scene);
  return of;
}

RunFolder seen_by_all(const RunFolder& run, const std::vector<std::string>& detectors) {
  const auto is_one = [&](const SceneLine& line) {
    return std::ranges::find(detectors, line.detector) != detectors.end();
  };
  std::map<std::string, std::size_t> seen;
  for (const auto& [key, scene] : run.scenes) seen[scene_key(scene)] += is_one(scene);
  RunFolder common{run.header, {}};
  for (const auto& [key, scene] : run.scenes)
    if (is_one(scene) && seen[scene_key(scene)] == detectors.size()) common.scenes.emplace(key, scene);
  return common;
}

Estimate difference(const Estimate& a, const Estimate& b) {
  BINPICK_CHECK(a.draws.size() == b.draws.size());
  Estimate d{a.value - b.value, a.draws};
  for (std::size_t k = 0; k < d.draws.size(); ++k) d.draws[k] -= b.draws[k];
  return d;
}

std::string with_interval(const Estimate& estimate, const char* format) {
  std::string text = formatted(estimate.value, format);
  if (estimate.draws.empty()) return text;
  const Interval interval = estimate.interval();
  return text + " [" + formatted(interval.low, format) + ", " + formatted(interval.high, format) + "]";
}
}  // namespace binpick::bench
