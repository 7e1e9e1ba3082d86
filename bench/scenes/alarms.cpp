#include "bench/scenes/alarms.hpp"

#include <algorithm>
#include <cstdio>
#include <map>

#include "bench/scenes/run_file.hpp"

namespace binpick::bench {
namespace {
/// What a class's wanted parts need; trained, or read, when first asked for.
class Wanted {
 public:
  Wanted(const RunOptions& options, const ClassSetting& setting, const std::string& name)
      : part_{scene_part(setting.scanner, name)},
        judge_{part_},
        base_{knowledge_base_of(part_, options.base_file(part_))} {}
  const Judge& judge() const { return judge_; }
  const vision::KnowledgeBase& base() const { return base_; }

 private:
  ScenePart part_;
  Judge judge_;
  vision::KnowledgeBase base_;
};
}  // namespace

void alarms(const RunOptions& options, const RunSelection& selection, std::size_t count) {
  const std::string split = "alarms-" + selection.split;
  if (!is_alarm_split(split))
    throw std::runtime_error{"no split \"" + selection.split + "\"; there are tune and report"};
  RunFile file{options.out, options.header(), shard_name(split, selection.shard, selection.shards)};
  for (const ClassSetting& setting : class_settings()) {
    if (!selection.classes.empty() && std::ranges::find(selection.classes, setting.name) == selection.classes.end())
      continue;
    std::map<std::string, Wanted> wanted;
    for (std::size_t number = 0; number < count * kAlarmKinds.size(); ++number) {
      // By kinds together: an empty supply takes less time, and each shard has its share.
      if (number / kAlarmKinds.size() % selection.shards != selection.shard) continue;
      const AlarmScene alarm = alarm_scene(setting, split, number);
      if (!selection.parts.empty() && std::ranges::find(selection.parts, alarm.wanted) == selection.parts.end())
        continue;
      SceneLine line;
      line.scanner = setting.name;
      line.part = alarm.wanted;
      line.split = split;
      line.number = number;
      line.pile = alarm.id.pile;
      line.fill = alarm.empty() ? 0 : alarm.id.fill;
      if (file.has(line)) continue;
      const Wanted& part = wanted.try_emplace(alarm.wanted, options, setting, alarm.wanted).first->second;
      std::vector<ObjectPose> poses;
      if (!alarm.empty()) poses = taken_down(settled_pile(alarm.there, alarm.id.pile, options.piles), alarm.id.fill);
      Scene scene = make_scene(alarm.there, poses, alarm.id, options.bias_mm);
      scene.truths.clear();  // they are other parts'
      detect_scene(scene, part.judge(), part.base(), options.detector(), line, options.picture_folder());
      AlarmCount own;
      own.add(line);
      std::printf("%s: %s; %d above .5, highest %.2f\n", line.key().c_str(), kAlarmKinds[alarm.kind].data(),
                  own.detections, own.highest);
      std::fflush(stdout);
      file.write(line);
    }
  }
  print_alarms(read_run(options.out), split);
}

void print_alarms(const RunFolder& run, const std::string& split) {
  const AlarmCounts counts = alarm_counts(run, split);
  if (counts.empty()) return;
  std::printf(
      "\nWhere nothing of the part is (%s): scenes with a detection above .5 / scenes, and the highest score.\n"
      "| wanted |",
      split.c_str());
  for (const std::string_view kind : kAlarmKinds) std::printf(" %s |", kind.data());
  std::printf("\n|---|");
  for (std::size_t k = 0; k < kAlarmKinds.size(); ++k) std::printf("---|");
  for (const auto& [scanner, parts] : counts)
    for (const auto& [part, kinds] : parts) {
      std::printf("\n| %s %s |", scanner.c_str(), part.c_str());
      for (const AlarmCount& count : kinds)
        std::printf(" %d / %d; %.2f |", count.scenes_with, count.scenes, count.highest);
    }
  std::printf("\n");
}
}  // namespace binpick::bench
