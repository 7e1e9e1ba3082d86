#include "bench/scenes/settle.hpp"

#include <algorithm>
#include <cstdio>
#include <set>
#include <utility>
#include <vector>

#include "bench/scenes/alarm_scenes.hpp"
#include "bench/scenes/classes.hpp"

namespace binpick::bench {
void settle(const std::string& piles, const RunSelection& selection, std::size_t alarm_count) {
  const Split& split = split_named(selection.split);
  std::vector<std::pair<ScenePart, std::uint64_t>> missing;
  std::set<std::string> known;
  const auto add = [&](const ScenePart& part, std::uint64_t pile) {
    const std::string name = std::string{setting_of(part).name} + ' ' + part.body.name + ' ' + std::to_string(pile);
    if (known.insert(name).second) missing.emplace_back(part, pile);
  };
  for (const ClassSetting& setting : class_settings()) {
    const std::vector<std::string> names = selected_parts(setting, selection);
    for (const std::string& name : names) {
      const ScenePart part = scene_part(setting.scanner, name);
      for (std::size_t k = selection.from; k < std::min(selection.to, split.scenes()); ++k)
        add(part, split.scene(k).pile);
    }
    const std::string alarms = "alarms-" + selection.split;
    if (!is_alarm_split(alarms) || names.empty()) continue;
    for (std::size_t k = 0; k < alarm_count * kAlarmKinds.size(); ++k)
      if (const AlarmScene alarm = alarm_scene(setting, alarms, k);
          !alarm.empty() && std::ranges::find(names, alarm.wanted) != names.end())
        add(alarm.there, alarm.id.pile);
  }
  for (std::size_t k = selection.shard; k < missing.size(); k += selection.shards) {
    const auto& [part, pile] = missing[k];
    settled_pile(part, pile, piles);
    std::printf("%zu of %zu: %s %s, pile %llu\n", k + 1, missing.size(), setting_of(part).name.data(),
                part.body.name.c_str(), static_cast<unsigned long long>(pile));
    std::fflush(stdout);
  }
}
}  // namespace binpick::bench
