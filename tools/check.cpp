#include <CLI/CLI.hpp>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <string>

#include "config/config.hpp"
#include "tools/commands.hpp"

namespace binpick::tools {
namespace {
/// What a good cell file says, in a few lines; and what is still to be done before it can pick.
void print_summary(const config::Config& cell) {
  std::printf("%s: good\n", cell.path.c_str());
  std::printf("  cell     %s, PLC at %s, %s\n", cell.name.c_str(), cell.plc_line().c_str(),
              cell.robot_listen.empty() ? "no robot socket" : ("robot at " + cell.robot_listen).c_str());
  std::printf("  devices  pivot %u on %s, LMS 400 at %s\n", cell.pivot.module_id, cell.pivot_can.c_str(),
              cell.scanner_address.c_str());
  for (const auto& supply : cell.supplies)
    std::printf("  supply   %u %s: %g x %g x %g mm, sweep %g ... %g deg\n", supply.id, supply.name.c_str(),
                supply.size_mm.x(), supply.size_mm.y(), supply.size_mm.z(), supply.sweep_start.in_deg(),
                supply.sweep_end.in_deg());
  for (const auto& recipe : cell.recipes) {
    std::printf("  part     %u %s: %zu grasp%s\n", recipe.id, recipe.part.options.name.c_str(),
                recipe.part.grasps.size(), recipe.part.grasps.size() == 1 ? "" : "s");
    std::error_code failure;
    if (!std::filesystem::exists(recipe.knowledge_base, failure))
      std::printf("           not trained yet: binpick train %s -o %s\n", recipe.part.path.c_str(),
                  recipe.knowledge_base.c_str());
  }
}
}  // namespace

void add_check(CLI::App& app, int& exit_status) {
  auto* command = app.add_subcommand("check", "Validates a cell file and its part files; all findings at once.");
  auto path = std::make_shared<std::string>();
  command->add_option("CELL.toml", *path, "the cell file")->required();
  command->callback([path, &exit_status] {
    const auto cell = config::load(*path);
    if (cell) {
      print_summary(*cell);
      return;
    }
    for (const auto& finding : cell.error()) std::printf("%s\n", to_string(finding).c_str());
    const std::size_t n = cell.error().size();
    std::printf("%zu finding%s\n", n, n == 1 ? "" : "s");
    exit_status = 2;
  });
}
}  // namespace binpick::tools
