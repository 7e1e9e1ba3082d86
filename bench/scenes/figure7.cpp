#include "bench/scenes/figure7.hpp"

#include <cstdio>

#include "bench/scenes/charts.hpp"
#include "bench/scenes/precision.hpp"

namespace binpick::bench {
namespace {
constexpr double kPublishedMs = 150, kPublishedHypotheses = 200;
}  // namespace

void figure7(const RunOptions& options, std::size_t count, std::size_t shard, std::size_t shards) {
  RunSelection selection;
  selection.classes = {"lps36"};
  selection.parts = {"contact_bridge"};
  selection.split = "figure7";
  selection.to = count;
  selection.shard = shard;
  selection.shards = shards;
  run(options, selection);

  std::vector<double> ms, hypotheses;
  std::size_t scenes = 0, wrong = 0, fast = 0, few = 0;
  const RunFolder folder = read_run(options.out);
  for (const auto& [key, scene] : folder.scenes) {
    if (scene.split != "figure7") continue;
    ++scenes;
    if (!scene.first) continue;
    wrong += !scene.first->right;
    ms.push_back(scene.first->time_ms);
    hypotheses.push_back(static_cast<double>(scene.first->hypotheses));
    fast += scene.first->right && ms.back() < kPublishedMs;
    few += scene.first->right && hypotheses.back() < kPublishedHypotheses;
  }
  const auto percent = [&](std::size_t n) { return 100.0 * static_cast<double>(n) / static_cast<double>(scenes); };
  if (scenes == 0) return;
  std::printf("%zu scenes of contact bridges, %s. All of it is simulation.\n", scenes, to_json(*folder.header).c_str());
  std::printf(
      "| | here | published |\n|---|---|---|\n| a valid object after less than 150 ms | %.1f %% | over 40 %% |\n"
      "| after fewer than 200 hypotheses | %.1f %% | over 40 %% |\n| ms p50 / p95 | %.0f / %.0f | |\n"
      "| hypotheses p50 / p95 | %.0f / %.0f | |\n| none found | %.1f %% | |\n| the first one wrong | %.1f %% | |\n",
      percent(fast), percent(few), quantile(ms, 0.5), quantile(ms, 0.95), quantile(hypotheses, 0.5),
      quantile(hypotheses, 0.95), percent(scenes - ms.size()), percent(wrong));
  const Axis time{"ms to the first valid pose (the last bar: and more)", 0, 600, 6};
  write_text(options.out + "/figure7-time.svg",
             histogram("Time to the first valid pose, " + std::to_string(scenes) + " scenes of contact bridges", time,
                       60, ms, kPublishedMs, "150 ms: over 40 % published"));
  const Axis tested{"hypotheses rendered and compared (the last bar: and more)", 0, 240, 6};
  write_text(options.out + "/figure7-hypotheses.svg",
             histogram("Hypotheses up to the first valid pose, " + std::to_string(scenes) + " scenes", tested, 60,
                       hypotheses, kPublishedHypotheses, "200: over 40 % published"));
}
}  // namespace binpick::bench
