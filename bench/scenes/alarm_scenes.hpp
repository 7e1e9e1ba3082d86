#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "bench/scenes/lines.hpp"
#include "bench/scenes/piles.hpp"

/// Scenes in which the wanted part is not.
namespace binpick::bench {
inline constexpr std::array<std::string_view, 3> kAlarmKinds{"another part", "empty supply", "foreign bodies"};

/// One scene: what is looked for, and what is there.
struct AlarmScene {
  std::size_t kind = 0;  ///< In kAlarmKinds.
  std::string wanted;
  ScenePart there;
  SceneId id;
  bool empty() const { return kind == 1; }
};

/// "alarms-tune" or "alarms-report": they differ in piles. Wanted parts in turn; of consecutive numbers each kind has
/// one. Any other split is a mistake of the caller.
AlarmScene alarm_scene(const ClassSetting& setting, const std::string& split, std::size_t number);
bool is_alarm_split(std::string_view split);

struct AlarmCount {
  int scenes = 0, scenes_with = 0, detections = 0;  ///< Detections with a score above one half.
  double highest = 0;
  void add(const SceneLine& line);
};
/// By class, wanted part and kind; of the scenes of one split.
using AlarmCounts = std::map<std::string, std::map<std::string, std::array<AlarmCount, kAlarmKinds.size()>>>;
AlarmCounts alarm_counts(const RunFolder& run, std::string_view split);
}  // namespace binpick::bench
