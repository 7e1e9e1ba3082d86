#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <exception>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "base/log.hpp"
#include "bench/production/bin_run.hpp"
#include "bench/production/fault_figures.hpp"
#include "bench/production/figures.hpp"
#include "bench/production/picture.hpp"
#include "bench/production/setup.hpp"
#include "bench/scenes/commit.hpp"

/// Empties bin after bin with the whole cell in virtual time, thousands of picks, and says what came of it.
namespace binpick::bench {
namespace {
constexpr double kDisplaced_mm = 80;

struct Arguments {
  int picks = 3000;
  std::uint64_t seed = 1;
  std::string part, out = "build/production", records;
  int threads = 2;
  bool talks = false;
  int known_poses = 0;
  std::uint64_t faults = 0;         ///< Every so many-th request; 0: none.
  std::optional<double> displaced;  ///< Up to so many mm; 0: in their places, under the same scan.
};

/// The two halves of a comparison stand beside each other.
std::string suffix(std::optional<double> displaced) {
  if (!displaced) return "";
  return *displaced > 0 ? ".displaced" : ".centred";
}

std::string header_of(const ProductionPart& part, const Arguments& arguments) {
  nlohmann::json header{{"commit", kCommit},
                        {"part", part.name},
                        {"seed", arguments.seed},
                        {"objects", part.objects},
                        {"threads", arguments.threads}};
  if (arguments.faults > 0) header["fault_every"] = arguments.faults;
  if (arguments.displaced) header["displaced_mm"] = *arguments.displaced;
  return header.dump();
}

std::string file_of(const ProductionPart& part, const Arguments& arguments) {
  return arguments.out + "/" + part.name + suffix(arguments.displaced) + ".jsonl";
}

std::vector<ProductionPart> parts_of(const Arguments& arguments) {
  std::vector<ProductionPart> parts = production_parts();
  if (arguments.displaced) std::ranges::transform(parts, parts.begin(), to_be_located);
  return parts;
}

/// Goes on where the file ends, bin by bin, until it has so many picks.
void produce(const ProductionPart& part, std::size_t number, const Arguments& arguments, int picks) {
  const std::string path = file_of(part, arguments);
  PartRun run = read_part_run(path, header_of(part, arguments));
  write_part_run(path, run);
  if (run.picks() >= picks) return;
  const auto data = load_production_cell(part, arguments.out, arguments.threads, arguments.records);
  for (std::uint64_t bin = run.bins.size() + 1; run.picks() < picks; ++bin) {
    BinTrials trials;
    trials.faults = FaultPlan{arguments.faults, arguments.seed, number};
    trials.requests_before = run.requests.size();
    trials.displacement = displacement_of(bin, arguments.seed, arguments.displaced.value_or(0));
    const BinOutcome outcome = run_bin(part, data, bin, arguments.seed, trials);
    append_bin(path, outcome.requests, outcome.bin);
    run.requests.insert(run.requests.end(), outcome.requests.begin(), outcome.requests.end());
    const auto taken = std::ranges::count(outcome.requests, "taken", &RequestRecord::grip);
    std::printf(
        "%s, bin %llu: %ld taken in %zu requests, %d left (%d with a free grasp), ends with %s, %.1f CPU s; %d of %d\n",
        part.name.c_str(), static_cast<unsigned long long>(bin), static_cast<long>(taken), outcome.requests.size(),
        outcome.bin.left, outcome.bin.takeable, outcome.bin.end.c_str(), outcome.bin.cpu_s, run.picks(), picks);
    for (const RequestRecord& r : outcome.requests)
      if (arguments.talks && r.fault)
        std::printf("  request %d, %s %s for %.2f s while %s%s: %s, alarms %s, ready %.2f s after it\n", r.request,
                    r.fault->device.c_str(), r.fault->name.c_str(), r.fault->lasted_s, r.fault->phase.c_str(),
                    r.fault->reached ? "" : " (never)", r.answer.c_str(), r.fault->alarms.c_str(),
                    r.fault->recovered_s);
    for (const RequestRecord& r : outcome.requests)
      if (arguments.talks && r.answer == "not_reachable")
        std::printf("  request %d: %s\n", r.request, r.why.c_str());
      else if (arguments.talks && r.answer == "pick" && r.grip != "taken")
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

/// What there is in the folder.
struct Runs {
  std::vector<std::string> names;
  std::vector<PartRun> runs;
  bool complete = true;
};
Runs read_runs(const Arguments& arguments, int each) {
  Runs all;
  for (const ProductionPart& part : parts_of(arguments)) {
    PartRun run = read_part_run(file_of(part, arguments), header_of(part, arguments));
    all.complete &= run.picks() >= each;
    if (run.bins.empty()) continue;
    all.names.push_back(part.name);
    all.runs.push_back(std::move(run));
  }
  return all;
}

/// Beside the run of the same bins in their places, or off them, where that is in the folder.
bool compare(const Arguments& arguments, const ProductionFigures& all, int each) {
  Arguments other = arguments;
  const bool is_displaced = *arguments.displaced > 0;
  other.displaced = is_displaced ? 0 : kDisplaced_mm;
  const Runs others = read_runs(other, each);
  if (others.runs.empty()) {
    std::printf("\nnothing to compare with: run %s into the same folder\n", is_displaced ? "--centred" : "--displaced");
    return true;
  }
  if (!others.complete) std::printf("\nthe run to compare with is not complete\n");
  const ProductionFigures other_all = figures_of("all", others.runs, robot_model());
  const LocatedComparison comparison =
      is_displaced ? LocatedComparison{all, other_all} : LocatedComparison{other_all, all};
  std::printf("\n%s", to_table(comparison).c_str());
  return comparison.meets_must();
}

Arguments parse(CLI::App& app, int argc, char** argv) {
  Arguments arguments;
  app.add_option("--picks", arguments.picks, "of all parts together")
      ->check(CLI::PositiveNumber)
      ->capture_default_str();
  app.add_option("--seed", arguments.seed, "of piles and noise")->capture_default_str();
  app.add_option("--part", arguments.part,
                 "only this one, for runs beside each other; the table is of all in the folder");
  app.add_option("--out", arguments.out, "folder of records; a run goes on where it was stopped")
      ->capture_default_str();
  app.add_option("--records", arguments.records,
                 "keep the daemon's records here, a folder for each bin (docs/records.md)");
  app.add_option("--threads", arguments.threads, "of detection")->capture_default_str();
  app.add_option("--known-poses", arguments.known_poses,
                 "so many bins by the gripper alone, poses known: what nobody could take");
  auto* faults =
      app.add_flag("--faults{50}", arguments.faults, "a device fails at every 50th request; =N: at every Nth")
          ->check(CLI::Range(1, 1'000'000));
  bool is_displaced = false, is_centred = false;
  auto* displaced =
      app.add_flag("--displaced", is_displaced, "each bin stands up to 80 mm and 10 degrees off and is located");
  app.add_flag("--centred", is_centred, "the same bins in their places, under the same scan")
      ->excludes(faults)
      ->excludes(displaced);
  displaced->excludes(faults);
  app.add_flag("--talks", arguments.talks, "tells of each pick that failed, each fault, and why nothing was reachable");
  app.parse(argc, argv);
  if (is_displaced) arguments.displaced = kDisplaced_mm;
  if (is_centred) arguments.displaced = 0;
  return arguments;
}

int run(const Arguments& arguments) {
  log::set_threshold(log::Level::Error);
  std::filesystem::create_directories(arguments.out);
  if (arguments.known_poses > 0) return by_known_poses(arguments), 0;
  const std::vector<ProductionPart> parts = parts_of(arguments);
  const int each = (arguments.picks + static_cast<int>(parts.size()) - 1) / static_cast<int>(parts.size());
  for (std::size_t number = 0; number < parts.size(); ++number)
    if (arguments.part.empty() || arguments.part == parts[number].name) produce(parts[number], number, arguments, each);
  const Runs all_runs = read_runs(arguments, each);
  if (all_runs.runs.empty()) return 2;
  std::vector<ProductionFigures> figures;
  for (std::size_t i = 0; i < all_runs.runs.size(); ++i)
    figures.push_back(figures_of(all_runs.names[i], {all_runs.runs[i]}, robot_model()));
  const ProductionFigures all = figures_of("all", all_runs.runs, robot_model());
  const RobotModel robot = robot_model();
  std::printf(
      "\nAll of it is simulation, seed %llu, %s. Robot: 1 m/s, 3 m/s², the last 120 mm at 0.25 m/s: %.1f s to the "
      "grasp, %.1f s out of the view, %.1f s to the place and back. Detection counts 0.15 s in the cycle's time, "
      "whatever it took.\n\n%s",
      static_cast<unsigned long long>(arguments.seed), kCommit, robot.approach_s, robot.retreat_s, robot.place_s,
      to_table(figures, all).c_str());
  draw_production(arguments.out + "/production" + suffix(arguments.displaced) + ".png", figures, all);
  if (!all_runs.complete) std::printf("\nnot complete: the must columns are of what there is\n");
  if (arguments.displaced) return compare(arguments, all, each) ? 0 : 1;
  if (arguments.faults > 0) {
    const FaultFigures faults = fault_figures_of(all_runs.names, all_runs.runs);
    std::printf("\n%s", to_table(faults).c_str());
    return faults.meets_must() ? 0 : 1;
  }
  return std::ranges::all_of(demands(all), &ProductionDemand::meets_must) ? 0 : 1;
}

int main(int argc, char** argv) {
  CLI::App app{"production: bins of the four example parts emptied by the emulated cell (docs/production.md)"};
  Arguments arguments;
  try {
    arguments = parse(app, argc, argv);
  } catch (const CLI::ParseError& refused) {
    return app.exit(refused);
  }
  return run(arguments);
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
