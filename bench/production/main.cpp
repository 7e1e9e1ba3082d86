#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <exception>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "base/log.hpp"
#include "bench/production/bin_run.hpp"
#include "bench/production/figures.hpp"
#include "bench/production/picture.hpp"
#include "bench/production/setup.hpp"
#include "bench/scenes/commit.hpp"

/// Empties bin after bin with the whole cell in virtual time, thousands of picks, and says what came of it.
namespace binpick::bench {
namespace {
struct Arguments {
  int picks = 3000;
  std::uint64_t seed = 1;
  std::string part, out = "build/production";
  int threads = 2;
  bool talks = false;
  int known_poses = 0;
};

std::string header_of(const ProductionPart& part, const Arguments& arguments) {
  return nlohmann::json{{"commit", kCommit},
                        {"part", part.name},
                        {"seed", arguments.seed},
                        {"objects", part.objects},
                        {"threads", arguments.threads}}
      .dump();
}

std::string file_of(const ProductionPart& part, const Arguments& arguments) {
  return arguments.out + "/" + part.name + ".jsonl";
}

/// Goes on where the file ends, bin by bin, until it has so many picks.
void produce(const ProductionPart& part, const Arguments& arguments, int picks) {
  const std::string path = file_of(part, arguments);
  PartRun run = read_part_run(path, header_of(part, arguments));
  write_part_run(path, run);
  if (run.picks() >= picks) return;
  const auto data = load_production_cell(part, arguments.out, arguments.threads);
  for (std::uint64_t bin = run.bins.size() + 1; run.picks() < picks; ++bin) {
    const BinOutcome outcome = run_bin(part, data, bin, arguments.seed);
    append_bin(path, outcome.requests, outcome.bin);
    run.requests.insert(run.requests.end(), outcome.requests.begin(), outcome.requests.end());
    const auto taken = std::ranges::count(outcome.requests, "taken", &RequestRecord::grip);
    std::printf(
        "%s, bin %llu: %ld taken in %zu requests, %d left (%d with a free grasp), ends with %s, %.1f CPU s; %d of %d\n",
        part.name.c_str(), static_cast<unsigned long long>(bin), static_cast<long>(taken), outcome.requests.size(),
        outcome.bin.left, outcome.bin.takeable, outcome.bin.end.c_str(), outcome.bin.cpu_s, run.picks(), picks);
    for (const RequestRecord& r : outcome.requests)
      if (arguments.talks && r.answer == "pick" && r.grip != "taken")
        std::printf("  request %d, %s, error %.1f mm %.1f deg: %s\n", r.request, r.grasp.c_str(), r.error_mm,
                    r.error_deg, r.why.c_str());
    std::fflush(stdout);
  }
}

/// The ceiling: no scanner, no detection, the gripper alone.
void by_known_poses(const Arguments& arguments) {
  for (const ProductionPart& part : production_parts()) {
    if (!arguments.part.empty() && arguments.part != part.name) continue;
    const auto data = load_production_cell(part, arguments.out, arguments.threads);
    int left = 0;
    std::vector<std::string> reasons;
    for (int bin = 1; bin <= arguments.known_poses; ++bin)
      left += left_by_known_poses(part, *data, static_cast<std::uint64_t>(bin), arguments.seed, &reasons);
    for (const std::string& reason : reasons)
      if (arguments.talks) std::printf("%s\n", reason.c_str());
    std::printf("%s: %d of %d objects in %d bins cannot be taken, whoever knows their poses (%.1f %%)\n",
                part.name.c_str(), left, arguments.known_poses * part.objects, arguments.known_poses,
                100.0 * left / (arguments.known_poses * part.objects));
    std::fflush(stdout);
  }
}

int main(int argc, char** argv) {
  CLI::App app{"production: bins of the four example parts emptied by the emulated cell (docs/production.md)"};
  Arguments arguments;
  app.add_option("--picks", arguments.picks, "of all parts together")
      ->check(CLI::PositiveNumber)
      ->capture_default_str();
  app.add_option("--seed", arguments.seed, "of piles and noise")->capture_default_str();
  app.add_option("--part", arguments.part,
                 "only this one, for runs beside each other; the table is of all in the folder");
  app.add_option("--out", arguments.out, "folder of records; a run goes on where it was stopped")
      ->capture_default_str();
  app.add_option("--threads", arguments.threads, "of detection")->capture_default_str();
  app.add_option("--known-poses", arguments.known_poses,
                 "so many bins by the gripper alone, poses known: what nobody could take");
  app.add_flag("--talks", arguments.talks, "tells of each pick that failed");
  CLI11_PARSE(app, argc, argv);
  log::set_threshold(log::Level::Error);
  std::filesystem::create_directories(arguments.out);

  if (arguments.known_poses > 0) return by_known_poses(arguments), 0;
  const auto& parts = production_parts();
  const int each = (arguments.picks + static_cast<int>(parts.size()) - 1) / static_cast<int>(parts.size());
  std::vector<ProductionFigures> figures;
  std::vector<PartRun> runs;
  bool complete = true;
  for (const ProductionPart& part : parts) {
    if (arguments.part.empty() || arguments.part == part.name) produce(part, arguments, each);
    PartRun run = read_part_run(file_of(part, arguments), header_of(part, arguments));
    complete &= run.picks() >= each;
    if (run.bins.empty()) continue;
    figures.push_back(figures_of(part.name, {run}, robot_model()));
    runs.push_back(std::move(run));
  }
  if (runs.empty()) return 2;
  const ProductionFigures all = figures_of("all", runs, robot_model());
  const RobotModel robot = robot_model();
  std::printf(
      "\nAll of it is simulation, seed %llu, %s. Robot: 1 m/s, 3 m/s², the last 120 mm at 0.25 m/s: %.1f s to the "
      "grasp, "
      "%.1f s out of the view, %.1f s to the place and back. Detection counts 0.15 s in the cycle's time, whatever it "
      "took.\n\n%s",
      static_cast<unsigned long long>(arguments.seed), kCommit, robot.approach_s, robot.retreat_s, robot.place_s,
      to_table(figures, all).c_str());
  draw_production(arguments.out + "/production.png", figures, all);
  if (!complete) std::printf("\nnot complete: the must columns are of what there is\n");
  const auto asked = demands(all);
  return std::ranges::all_of(asked, &ProductionDemand::meets_must) ? 0 : 1;
}
}  // namespace
}  // namespace binpick::bench

int main(int argc, char** argv) {
  try {
    return binpick::bench::main(argc, argv);
  } catch (const std::exception& failure) {
    std::fprintf(stderr, "production: %s\n", failure.what());
    return 2;
  }
}
