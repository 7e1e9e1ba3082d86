#include <CLI/CLI.hpp>
#include <cstdio>
#include <exception>
#include <filesystem>
#include <iostream>
#include <string>
#include <vector>

#include "config/config.hpp"
#include "tests/emulators/program/run.hpp"
#include "tests/emulators/world/example_parts.hpp"

/// binpick-emulator: plays PLC, pivot, scanner and robot on real sockets, any of them, in one scene.
namespace binpick::emulators {
namespace {
constexpr int kExitFailed = 1;
constexpr int kExitUsage = 2;

struct Arguments {
  std::string config;
  std::string part, supply, pivot;
  std::string parts_folder;
  std::vector<std::string> without;
  double pick_time_s = 8, pause_s = 0, timeout_s = 0;
  bool serve = false;
  bool conveyor = false;
  RunOptions run;
};

int complain(const std::string& text) {
  std::fprintf(stderr, "binpick-emulator: %s\n", text.c_str());
  return kExitUsage;
}

int write_parts(const std::string& folder, bool conveyor) {
  const auto picking = conveyor ? vision::Picking::Conveyor : vision::Picking::Bin;
  for (const auto& name : example_part_names()) std::printf("%s\n", write_example_part(name, folder, picking).c_str());
  return 0;
}

/// By name of its part file, name of the part, or id.
std::optional<std::size_t> find_recipe(const config::Config& config, const std::string& wanted) {
  if (wanted.empty()) return config.recipes.empty() ? std::nullopt : std::optional<std::size_t>{0};
  for (std::size_t i = 0; i < config.recipes.size(); ++i) {
    const auto& recipe = config.recipes[i];
    if (std::filesystem::path(recipe.part.path).stem() == wanted || recipe.part.options.name == wanted ||
        std::to_string(recipe.id) == wanted)
      return i;
  }
  return std::nullopt;
}

std::optional<std::size_t> find_supply(const config::Config& config, const std::string& wanted) {
  if (wanted.empty()) return config.supplies.empty() ? std::nullopt : std::optional<std::size_t>{0};
  for (std::size_t i = 0; i < config.supplies.size(); ++i)
    if (config.supplies[i].name == wanted || std::to_string(config.supplies[i].id) == wanted) return i;
  return std::nullopt;
}

int play(Arguments arguments) {
  const auto config = config::load(arguments.config);
  if (!config) {
    for (const auto& finding : config.error()) std::fprintf(stderr, "%s\n", to_string(finding).c_str());
    return complain(arguments.config + " is not a good cell file; see binpick check");
  }
  const auto recipe = find_recipe(*config, arguments.part);
  if (!recipe) return complain("no [[part]] \"" + arguments.part + "\" in " + arguments.config);
  const auto supply = find_supply(*config, arguments.supply);
  if (!supply) return complain("no [[supply]] \"" + arguments.supply + "\" in " + arguments.config);
  RunOptions& run = arguments.run;
  run.bin.recipe = *recipe;
  run.bin.supply = *supply;
  run.pick_time = from_s(arguments.pick_time_s);
  run.pause = from_s(arguments.pause_s);
  using drivers::pivot::Protocol;
  if (!arguments.pivot.empty()) run.pivot = arguments.pivot == "motion" ? Protocol::Motion : Protocol::PowerCube;
  if (arguments.serve) run.cycles = 0;
  if (arguments.timeout_s > 0)
    run.timeout = from_s(arguments.timeout_s);
  else if (run.cycles > 0)
    run.timeout = std::chrono::seconds(60 + 20 * run.cycles);
  for (const auto& command : run.commands)
    if (const auto parsed = parse_command(command); !parsed) return complain("--fault: " + parsed.error());
  Run all{*config, run};
  return all.run();
}

int main(int argc, char** argv) {
  CLI::App app{"binpick-emulator: plays the devices of a binpick cell on real sockets (docs/emulators.md)"};
  app.require_subcommand(1, -1);
  Arguments arguments;
  RunOptions& run = arguments.run;
  const auto device = [&](Device which, const char* help) {
    auto* sub = app.add_subcommand(std::string(to_string(which)), help);
    sub->fallthrough();
    sub->callback([&run, which] { run.devices.insert(which); });
  };
  device(Device::Plc, "the PLC, as Modbus/TCP client of the daemon");
  device(Device::Pivot, "the Schunk PR 70 on its CAN bus");
  device(Device::Scanner, "the line scanner that scanner.model names, over the emulated bin");
  device(Device::Robot, "the arm of the make that robot.dialect names, as client of the daemon");
  auto* cell = app.add_subcommand("cell", "all four");
  cell->fallthrough();
  auto* parts = app.add_subcommand("parts", "write the four example parts (meshes and PART.toml) and end");
  parts->add_option("folder", arguments.parts_folder, "where to")->required();
  parts->add_flag("--conveyor", arguments.conveyor, "with picking = \"conveyor\", for objects that lie by themselves");

  app.add_option("--config", arguments.config, "cell file: addresses, mounts, supplies, parts");
  app.add_option("--part", arguments.part, "what lies in the bin: name or id of a [[part]]; default: the first");
  app.add_option("--supply", arguments.supply, "where: name or id of a [[supply]]; default: the first");
  app.add_option("--objects", run.bin.objects, "in a full bin, or on the belt: a supply whose walls are 0 mm high")
      ->check(CLI::Range(0, 200))
      ->capture_default_str();
  app.add_option("--seed", run.bin.seed, "of pile and noise")->capture_default_str();
  app.add_option("--cycles", run.cycles, "end after so many picks; 0: go on until told to quit")
      ->check(CLI::NonNegativeNumber)
      ->capture_default_str();
  app.add_option("--tolerance-mm", run.tolerance_mm, "a pick that is further off makes the run fail")
      ->capture_default_str();
  app.add_option("--tolerance-deg", run.tolerance_deg, "the same for its rotation")->capture_default_str();
  app.add_option("--failed-grips", run.failed_grips,
                 "share of the picks, rounded up, that the gripper may fail at though the pose is right; more make the "
                 "run fail")
      ->check(CLI::Range(0.0, 1.0))
      ->capture_default_str();
  app.add_option("--timeout", arguments.timeout_s, "s until the run is given up; default: 60 and 20 for each cycle");
  app.add_flag("--serve", arguments.serve, "go on until told to quit; same as --cycles 0");
  app.add_option("--without", arguments.without, "of cell: a device that is real, or played elsewhere")
      ->check(CLI::IsMember({"plc", "pivot", "scanner", "robot"}));
  app.add_option("--daemon", run.daemon_host, "host of binpickd; default: as the cell file says, or this machine");
  app.add_option("--pivot", arguments.pivot, "protocol that the pivot speaks; default: the cell file's pivot.protocol")
      ->check(CLI::IsMember({"powercube", "motion"}));
  app.add_option("--pick-time", arguments.pick_time_s, "s that the emulated PLC gives a robot that is not played here")
      ->check(CLI::NonNegativeNumber)
      ->capture_default_str();
  app.add_option("--pause", arguments.pause_s, "s between a pick and the next request")
      ->check(CLI::NonNegativeNumber)
      ->capture_default_str();
  bool by_hand = false;
  app.add_flag("--by-hand", by_hand, "the emulated PLC asks only on the command \"pick\"");
  app.add_option("--fault", run.commands,
                 "a command to begin with, e.g. \"scanner silent\"; more than one is possible");
  app.footer("While it runs it takes commands, one per line:\n" + command_help());
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    if (error.get_exit_code() == 0) return app.exit(error);  // --help
    return complain(std::string{error.what()} + "; binpick-emulator --help says what it takes");
  }
  run.requests = !by_hand;
  if (parts->parsed()) return write_parts(arguments.parts_folder, arguments.conveyor);
  if (cell->parsed()) {
    run.devices = {Device::Plc, Device::Pivot, Device::Scanner, Device::Robot};
    for (const Device which : {Device::Plc, Device::Pivot, Device::Scanner, Device::Robot})
      if (std::ranges::find(arguments.without, to_string(which)) != arguments.without.end()) run.devices.erase(which);
  }
  if (arguments.config.empty())
    return complain("--config CELL.toml is missing; it says where the devices are to be found");
  return play(arguments);
}
}  // namespace
}  // namespace binpick::emulators

int main(int argc, char** argv) {
  try {
    return binpick::emulators::main(argc, argv);
  } catch (const std::exception& failure) {
    std::fprintf(stderr, "binpick-emulator: %s\n", failure.what());
    return 1;
  }
}
