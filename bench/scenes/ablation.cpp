#include "bench/scenes/ablation.hpp"

#include <cstdio>

#include "bench/scenes/comparison.hpp"

namespace binpick::bench {
namespace {
constexpr const char* kBase = "binpick";

std::vector<Contender> contenders_of(const RunOptions& options) {
  std::vector<Contender> contenders{{kBase, options.detector()}};
  for (const std::string_view addition : vision::detector_additions()) {
    Contender contender{"without " + std::string{addition}, options.detector()};
    if (contender.options.without.insert(std::string{addition}).second) contenders.push_back(std::move(contender));
  }
  return contenders;
}

double p50_ms(const ClassFigures& figures) { return quantile(figures.all(&PartFigures::time_ms), 0.5); }
}  // namespace

void ablation(const RunOptions& options, RunSelection selection, std::size_t scenes) {
  selection.to = scenes;
  const std::vector<Contender> contenders = contenders_of(options);
  run(options, selection, contenders);

  std::vector<std::string> names;
  for (const Contender& contender : contenders) names.push_back(contender.name);
  const RunFolder seen = seen_by_all(of_split(read_run(options.out), selection.split), names);
  const std::vector<ClassFigures> base = collected(seen, kBase);
  if (base.empty()) return;  // another shard is not that far yet
  std::printf(
      "\n%zu scenes to %s, %s. All of it is simulation. AP is the mean over parts; with one addition taken away, the "
      "difference that makes, with its 95 %% interval by 1000 draws of piles.\n| |",
      seen.scenes.size() / names.size(), selection.split == "tune" ? "tune on" : "report",
      to_json(options.header()).c_str());
  for (const ClassFigures& figures : base) std::printf(" %s, AP | ms p50 |", figures.name.c_str());
  std::printf("\n|---|");
  for (std::size_t c = 0; c < base.size(); ++c) std::printf("---|---|");
  std::printf("\n| with all |");
  for (const ClassFigures& figures : base)
    std::printf(" %s | %.0f |", with_interval(figures.mean(&PartFigures::ap), "%.3f").c_str(), p50_ms(figures));
  for (const std::string& name : names) {
    if (name == kBase) continue;
    std::printf("\n| %s |", name.c_str());
    const std::vector<ClassFigures> less = collected(seen, name);
    for (std::size_t c = 0; c < base.size(); ++c)
      std::printf(
          " %s | %.0f |",
          with_interval(difference(less[c].mean(&PartFigures::ap), base[c].mean(&PartFigures::ap)), "%+.3f").c_str(),
          p50_ms(less[c]));
  }
  std::printf("\n");
}
}  // namespace binpick::bench
