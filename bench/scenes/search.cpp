#include "bench/scenes/search.hpp"

#include <algorithm>
#include <cstdio>
#include <set>

#include "bench/scenes/classes.hpp"
#include "bench/scenes/comparison.hpp"
#include "vision/kernels.hpp"

namespace binpick::bench {
namespace {
std::string named(const char* search, const char* loops) { return std::string{search} + ", " + loops; }

std::vector<Contender> contenders_of(const RunOptions& options) {
  const char* loops = vision::kernels::table().name;
  vision::DetectorOptions votes = options.detector(), exhaustive = votes;
  votes.search = vision::Search::Votes;
  exhaustive.search = vision::Search::Exhaustive;
  return {{.name = named("exhaustive", loops), .options = exhaustive, .memory = true},
          {.name = named("votes", loops), .options = votes, .memory = true}};
}

/// Which scenes of the run belong to a class's figures.
bool belongs(const SceneLine& scene, const std::string& detector, const std::string& class_name) {
  const std::string of = scene.part == kDeepPart ? scene.scanner + ", deep supply" : scene.scanner;
  return scene.detector == detector && of == class_name;
}

void print_row(const RunFolder& run, const std::string& detector, const ClassFigures& figures) {
  std::vector<double> search_ms, whole_ms;
  double hypotheses = 0;
  std::map<std::string, double> memory;
  double measured = 0;
  for (const auto& [key, scene] : run.scenes) {
    if (!belongs(scene, detector, figures.name)) continue;
    const auto ms = [&](const char* stage) {
      const auto it = scene.stages_ms.find(stage);
      return it == scene.stages_ms.end() ? 0 : it->second;
    };
    search_ms.push_back(ms("votes") + ms("sparse test"));
    whole_ms.push_back(scene.time_ms);
    hypotheses += static_cast<double>(scene.hypotheses);
    if (scene.memory_mib.empty()) continue;
    ++measured;
    for (const auto& [what, mib] : scene.memory_mib) memory[what] += mib;
  }
  // Like AP, the mean over parts.
  double found = 0, alive = 0;
  const auto parts = static_cast<double>(figures.parts.size());
  for (const PartFigures& part : figures.parts) {
    const auto to_find = static_cast<double>(std::max(1, part.to_find));
    const auto sparse = std::ranges::find(part.stages, "sparse test", &StageCount::stage);
    found += part.right / to_find / parts;
    if (sparse != part.stages.end()) alive += sparse->alive / to_find / parts;
  }
  const bool votes = detector.starts_with("votes");
  const auto mib = [&](const char* what) { return memory[what] / measured; };
  std::printf("| %s | %s | %zu | %.3f | %.3f | %s | %.0f | %.0f | %.0f |", figures.name.c_str(), detector.c_str(),
              whole_ms.size(), alive, found, with_interval(figures.mean(&PartFigures::ap), "%.3f").c_str(),
              hypotheses / static_cast<double>(whole_ms.size()), quantile(search_ms, 0.5), quantile(whole_ms, 0.5));
  if (measured > 0)
    std::printf(" %.1f | %.1f | %.1f | %.1f |\n", mib("file"), mib("views") + (votes ? mib("votes") : 0),
                mib("working"), mib("peak"));
  else
    std::printf(" | | | |\n");
}
}  // namespace

void search(RunOptions options, RunSelection selection, std::size_t scenes) {
  options.loops_in_names = true;
  selection.to = scenes;
  if (selection.parts.empty()) {
    for (const ClassSetting& setting : class_settings())
      for (const std::string& name : part_names(setting.scanner)) selection.parts.push_back(name);
    selection.parts.emplace_back(kDeepPart);
  }
  run(options, selection, contenders_of(options));

  const RunFolder all = of_split(read_run(options.out), selection.split);
  std::set<std::string> loops;
  std::vector<std::string> names;
  for (const char* l : {"avx2", "portable"})
    for (const char* s : {"exhaustive", "votes"})
      if (std::ranges::any_of(all.scenes, [&](const auto& scene) { return scene.second.detector == named(s, l); })) {
        names.push_back(named(s, l));
        loops.insert(l);
      }
  const RunFolder seen = seen_by_all(all, names);
  if (seen.scenes.empty()) return;  // another shard is not that far yet
  std::printf(
      "\n%zu scenes to %s, %s. All of it is simulation. Recall of objects of which half or more is seen: alive after "
      "the "
      "sparse test, and in the list. The inner loops exist for AVX2 and for any x86-64, and nothing wider: a processor "
      "that has AVX-512 runs the avx2 rows too.%s\nMiB, mean over parts: the knowledge base's file; what of it the "
      "search "
      "reads; how much a process grows in its first detection; the most that it ever had, the whole file verified.\n"
      "| | search, loops | scenes | recall, sparse test | list | AP | hypotheses, mean | search ms p50 | whole ms p50 "
      "| "
      "file MiB | read | working | peak |\n|---|---|---|---|---|---|---|---|---|---|---|---|---|\n",
      seen.scenes.size() / names.size(), selection.split == "tune" ? "tune on" : "report",
      to_json(options.header()).c_str(),
      loops.size() > 1 ? "" : " Run again with BINPICK_LOOPS=portable and the same folder for the other rows.");
  std::vector<std::vector<ClassFigures>> figures;
  for (const std::string& name : names) figures.push_back(collected(seen, name));
  for (std::size_t c = 0; c < figures.front().size(); ++c)
    for (std::size_t n = 0; n < names.size(); ++n) print_row(seen, names[n], figures[n][c]);
}
}  // namespace binpick::bench
