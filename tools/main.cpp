#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <exception>
#include <string>

#include "tools/commands.hpp"

namespace {
/// CLI11's texts may span lines; an error of this command is one line.
std::string one_line(std::string text) {
  std::replace(text.begin(), text.end(), '\n', ' ');
  while (!text.empty() && text.back() == ' ') text.pop_back();
  return text;
}

/// "binpick export plc" of a line that began so: whose help is worth reading.
std::string spoken_to(const CLI::App& app) {
  const auto chosen = app.get_subcommands();
  return chosen.empty() ? app.get_name() : app.get_name() + " " + spoken_to(*chosen.front());
}
}  // namespace

int main(int argc, char** argv) {
  using namespace binpick;
  CLI::App app{
      "The command beside binpickd: check and calibrate a cell, reach its devices, train parts, detect them, program "
      "its PLC.",
      "binpick"};
  app.require_subcommand(1);
  app.set_version_flag("--version", "binpick " BINPICK_VERSION);
  int exit_status = 0;
  tools::add_check(app, exit_status);
  tools::add_probe(app, exit_status);
  tools::add_scan(app, exit_status);
  tools::add_calibrate(app, exit_status);
  tools::add_train(app, exit_status);
  tools::add_detect(app, exit_status);
  tools::add_export(app, exit_status);
  tools::add_replay(app, exit_status);
  // CLI11 would only say that a subcommand is missing.
  if (argc > 1 && argv[1][0] != '-') {
    std::string names;
    bool known = false;
    for (const CLI::App* command : app.get_subcommands([](const CLI::App*) { return true; })) {
      names += (names.empty() ? "" : ", ") + command->get_name();
      known = known || command->get_name() == argv[1];
    }
    if (!known) {
      std::fprintf(stderr, "binpick: no command '%s'; there are: %s\n", one_line(argv[1]).c_str(), names.c_str());
      return 2;
    }
  }
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& e) {
    if (e.get_exit_code() == static_cast<int>(CLI::ExitCodes::Success)) return app.exit(e);  // --help, --version
    std::fprintf(stderr, "binpick: %s; '%s --help' says what it takes\n", one_line(e.what()).c_str(),
                 spoken_to(app).c_str());
    return 2;
  } catch (const std::exception& e) {
    std::fprintf(stderr, "binpick: %s\n", one_line(e.what()).c_str());
    return 1;
  }
  return exit_status;
}
