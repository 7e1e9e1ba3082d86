/// The scene benchmark: how right, how sure, how accurate and how fast detection is on simulated piles.
#include <CLI/CLI.hpp>
#include <cstdio>
#include <exception>
#include <set>

#include "bench/scenes/ablation.hpp"
#include "bench/scenes/alarms.hpp"
#include "bench/scenes/calibrate.hpp"
#include "bench/scenes/conveyor.hpp"
#include "bench/scenes/figure7.hpp"
#include "bench/scenes/grasps.hpp"
#include "bench/scenes/memory.hpp"
#include "bench/scenes/noise_truth.hpp"
#include "bench/scenes/run.hpp"
#include "bench/scenes/search.hpp"
#include "bench/scenes/settle.hpp"
#include "bench/scenes/table.hpp"

namespace {
using namespace binpick;
using namespace binpick::bench;

/// "a:b" → [a, b).
void set_range(RunSelection& selection, const std::string& text) {
  const auto colon = text.find(':');
  if (colon == std::string::npos) throw CLI::ValidationError{"--scenes", "wants FROM:TO"};
  selection.from = std::stoul(text.substr(0, colon));
  selection.to = std::stoul(text.substr(colon + 1));
}

void set_shard(RunSelection& selection, const std::string& text) {
  const auto slash = text.find('/');
  if (slash == std::string::npos) throw CLI::ValidationError{"--shard", "wants I/N"};
  selection.shard = std::stoul(text.substr(0, slash));
  selection.shards = std::stoul(text.substr(slash + 1));
  if (selection.shard >= selection.shards) throw CLI::ValidationError{"--shard", "wants I/N with I from 0 to N - 1"};
}

std::vector<std::string> additions() {
  const auto names = vision::detector_additions();
  return {names.begin(), names.end()};
}

void add_shard(CLI::App& command, RunSelection& selection) {
  command.add_option_function<std::string>(
      "--shard", [&selection](const std::string& text) { set_shard(selection, text); },
      "I/N: every N-th scene, from the I-th");
}

void add_classes(CLI::App& command, RunSelection& selection) {
  std::vector<std::string> names;
  for (const ClassSetting& setting : class_settings()) names.emplace_back(setting.name);
  command.add_option("--class", selection.classes, "only these (default: all)")->check(CLI::IsMember(names));
}

void add_parts(CLI::App& command, RunSelection& selection) {
  std::set<std::string> names{std::string{kDeepPart}};
  for (const ClassSetting& setting : class_settings())
    for (const std::string& name : part_names(setting.scanner)) names.insert(name);
  command.add_option("--part", selection.parts, "only these (default: all of the class)")->check(CLI::IsMember(names));
}

void add_run_options(CLI::App& command, RunOptions& options) {
  command.add_option("--out", options.out, "folder of the run; what it has already is not run again")->required();
  command.add_option("--piles", options.piles, "folder of settled piles");
  command.add_option("--bases", options.bases, "folder of knowledge bases (default: OUT/bases)");
  command.add_option("--threads", options.threads, "threads of detection");
  command.add_option("--hypotheses", options.hypotheses_max, "bound of the hypotheses");
  command.add_option("--bias-mm", options.bias_mm, "LMS 400: bias of each material, within plus and minus this");
  command.add_option("--sparse", options.sparse, "points farther apart than the class's, by this factor (run)")
      ->check(CLI::Range(1.0, 4.0));
  command.add_flag("--pictures", options.pictures, "draw what was found in each scene into OUT/pictures");
  command.add_option("--ablate", options.without, "leave this addition out; may be given several times")
      ->check(CLI::IsMember(additions()));
}
}  // namespace

int main(int argc, char** argv) {
  CLI::App app{"Detection on simulated piles"};
  app.require_subcommand(1);
  RunOptions options;
  RunSelection selection;
  std::string folder, cloud;

  CLI::App* run_command = app.add_subcommand("run", "detect in scenes, write one line for each");
  add_run_options(*run_command, options);
  add_classes(*run_command, selection);
  add_parts(*run_command, selection);
  run_command->add_option("--split", selection.split, "tune, last, report or figure7");
  run_command->add_option_function<std::string>(
      "--scenes", [&](const std::string& text) { set_range(selection, text); }, "FROM:TO, numbers in the split");
  add_shard(*run_command, selection);
  run_command->add_option("--peer", options.peer_scenes,
                          "the first N scenes of a part by OpenCV's surface_matching too");
  run_command->add_option("--thorough", options.thorough_scenes, "the first N scenes by our slowest search too");

  std::size_t count = 3000;
  CLI::App* figure7_command = app.add_subcommand("figure7", "hypotheses and time to the first valid pose");
  add_run_options(*figure7_command, options);
  figure7_command->add_option("--count", count, "scenes, at most 3000");
  add_shard(*figure7_command, selection);

  std::size_t alarm_count = 100;
  CLI::App* alarms_command = app.add_subcommand("alarms", "detections where nothing of the part is");
  add_run_options(*alarms_command, options);
  add_classes(*alarms_command, selection);
  add_parts(*alarms_command, selection);
  alarms_command->add_option("--count", alarm_count, "scenes of each kind and class");
  alarms_command->add_option("--split", selection.split, "tune or report");
  add_shard(*alarms_command, selection);

  CLI::App* settle_command = app.add_subcommand("settle", "settle the piles that runs over a split will need");
  settle_command->add_option("--piles", options.piles, "folder of settled piles");
  settle_command->add_option("--split", selection.split, "tune, last, report or figure7");
  settle_command->add_option("--alarms", alarm_count, "for so many alarms of each kind and class");
  add_classes(*settle_command, selection);
  add_parts(*settle_command, selection);
  add_shard(*settle_command, selection);

  std::size_t scenes = 20;
  const auto comparing = [&](const char* name, const char* what) {
    CLI::App* command = app.add_subcommand(name, what);
    add_run_options(*command, options);
    add_classes(*command, selection);
    add_parts(*command, selection);
    command->add_option("--split", selection.split, "tune or report");
    command->add_option("--scenes", scenes, "of each part");
    add_shard(*command, selection);
    return command;
  };
  CLI::App* search_command = comparing("search", "votes beside the exhaustive search");
  CLI::App* ablation_command = comparing("ablation", "what each addition to the method brings");

  CLI::App* grasps_command = comparing("grasps", "which objects of a pile are offered, and what the gripper hits");
  vision::ReachLimits limits;
  bool free = false;
  grasps_command->add_option("--clearance-mm", limits.clearance_mm, "as in a cell file");
  grasps_command->add_flag("--free", free, "nothing stands where nothing was measured");

  CLI::App* conveyor_command = app.add_subcommand("conveyor", "objects that lie by themselves on a belt");
  std::size_t belt_scenes = 100;
  add_run_options(*conveyor_command, options);
  add_classes(*conveyor_command, selection);
  add_parts(*conveyor_command, selection);
  conveyor_command->add_option("--scenes", belt_scenes, "of each part");
  add_shard(*conveyor_command, selection);

  CLI::App* table_command = app.add_subcommand("table", "print the figures of a run");
  table_command->add_option("folder", folder, "of the run")->required();
  std::vector<std::string> folders;
  CLI::App* calibrate_command = app.add_subcommand("calibrate", "fit the score's weights to what runs found");
  calibrate_command->add_option("folders", folders, "of runs over the tune split")->required();
  CLI::App* noise_command = app.add_subcommand("noise", "the emulated LMS 400 looking at a table, beside a real one");
  noise_command->add_option("--cloud", cloud, "PLY file in mm to be looked at in the same way");
  CLI::App* memory_command = app.add_subcommand("memory", "used by this program itself")->group("");
  memory_command->add_option("request", folder)->required();
  CLI11_PARSE(app, argc, argv);
  try {
    if (*run_command) run(options, selection);
    if (*figure7_command) figure7(options, count, selection.shard, selection.shards);
    if (*alarms_command) alarms(options, selection, alarm_count);
    if (*settle_command) settle(options.piles, selection, alarm_count);
    limits.unmeasured = free ? vision::Unmeasured::Free : vision::Unmeasured::Blocked;
    if (*grasps_command) grasps(options, selection, scenes, limits);
    if (*conveyor_command) conveyor(options, selection, belt_scenes);
    if (*search_command) search(options, selection, scenes);
    if (*ablation_command) ablation(options, selection, scenes);
    if (*noise_command) print_noise_truth(cloud);
    if (*calibrate_command) calibrate(folders);
    if (*table_command) print_table(folder);
    if (*memory_command) measure_memory(folder);
  } catch (const std::exception& e) {
    std::fprintf(stderr, "bench_scenes: %s\n", e.what());
    return 1;
  }
  return 0;
}
