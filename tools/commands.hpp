#pragma once

namespace CLI {
class App;
}

/// The subcommands of `binpick`, one file each (tools/<name>.cpp). Each adds itself to the command line; its callback
/// runs only after the whole line was understood and leaves the program's exit status: 0 done, 1 the work failed, 2
/// wrong usage or wrong input. An error is one line on stderr: what, where, what to do.
namespace binpick::tools {
void add_calibrate(CLI::App& app, int& exit_status);
void add_check(CLI::App& app, int& exit_status);
void add_probe(CLI::App& app, int& exit_status);
void add_scan(CLI::App& app, int& exit_status);
void add_train(CLI::App& app, int& exit_status);
void add_detect(CLI::App& app, int& exit_status);
void add_export(CLI::App& app, int& exit_status);
void add_replay(CLI::App& app, int& exit_status);
}  // namespace binpick::tools
