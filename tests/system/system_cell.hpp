#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <sys/socket.h>
#include <sys/types.h>

#include "base/clock.hpp"
#include "config/config.hpp"
#include "drivers/link/loop.hpp"
#include "tests/emulators/program/pose_port.hpp"
#include "tests/emulators/world/world.hpp"
#include "tests/support/cell_file.hpp"

namespace binpick::support {
/// A port of this machine that was free a moment ago; SOCK_STREAM or SOCK_DGRAM.
std::uint16_t free_port(int type);

/// The real binpickd as a process, and the emulated devices on real sockets of this machine, in real time.
class SystemCell {
 public:
  /// Writes the cell file (ports are chosen free), plays the devices, starts the daemon.
  SystemCell(CellFile file, emulators::World scene);
  ~SystemCell();  ///< Kills what still runs; shows the daemon's log when the test failed.
  SystemCell(const SystemCell&) = delete;
  SystemCell& operator=(const SystemCell&) = delete;

  emulators::PivotPort& pivot() { return *pivot_; }
  emulators::Faults& scanner_faults() { return scanner_->faults(); }
  emulators::Robot& robot() { return robot_->device; }
  emulators::Plc& plc() { return plc_->device; }

  bool run_until(const std::function<bool()>& done, Duration limit = std::chrono::seconds(20));
  void run_for(Duration time);
  bool run_until_ready(Duration limit = std::chrono::seconds(30));
  std::optional<emulators::PlcResult> pick();
  bool pivot_moves();

  void start_daemon();
  void signal(int number) const;  ///< SIGTERM, SIGHUP, SIGKILL …
  /// The exit status, once the daemon has ended; 128 + n when signal n ended it.
  std::optional<int> exit_status();
  const std::string& cell_path() const { return cell_path_; }
  const CellFile& file() const { return file_; }
  std::string daemon_log() const;

 private:
  CellFile file_;
  std::string cell_path_, log_path_;
  std::optional<config::Config> config_;
  emulators::World world_;
  drivers::link::Loop loop_;
  std::unique_ptr<emulators::PivotPort> pivot_;  ///< Or, where the robot carries the scanner, poses_.
  std::unique_ptr<emulators::PosePort> poses_;
  std::unique_ptr<emulators::ScannerPort> scanner_;
  std::unique_ptr<emulators::RobotPort> robot_;
  std::unique_ptr<emulators::PlcPort> plc_;
  pid_t daemon_ = -1;
  std::optional<int> exit_status_;
};

/// Runs a program to its end: exit status and all that it wrote to stderr and stdout.
struct Ended {
  int status = -1;
  std::string errors, output;
};
Ended run_program(const std::string& program, const std::vector<std::string>& arguments);
}  // namespace binpick::support
