#pragma once

#include <deque>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "config/config.hpp"
#include "drivers/link/loop.hpp"
#include "tests/emulators/program/bin.hpp"
#include "tests/emulators/program/command.hpp"
#include "tests/emulators/program/pose_port.hpp"

namespace binpick::emulators {
struct RunOptions {
  std::set<Device> devices;  ///< That are played here; the others are real, or played elsewhere.
  BinOptions bin;
  std::optional<drivers::pivot::Protocol> pivot;  ///< None: what the cell file says.
  int cycles = 0;                                 ///< Picks until the end; 0: until told to quit.
  double tolerance_mm = 5;                        ///< A pick that is further off makes the run fail.
  double tolerance_deg = 3;
  double failed_grips = 0.1;  ///< Share of the picks, rounded up, that may fail at a right pose.
  Duration timeout = Duration::max();
  Duration pick_time{std::chrono::seconds(8)};  ///< Without the emulated robot: the PLC lets a real one work this long.
  Duration pause{0};                            ///< Between a pick and the next request.
  bool requests = true;                         ///< The emulated PLC asks pick after pick; else by the command "pick".
  std::string daemon_host;            ///< Where binpickd runs; empty: as the cell file says, this machine for "any".
  std::vector<std::string> commands;  ///< Carried out at the start.
};

/// Plays the chosen devices of one cell on real sockets, all in one scene, until enough picks are made.
class Run {
 public:
  /// Fills the bin and opens the sockets. Throws std::runtime_error with what and where.
  Run(const config::Config& config, const RunOptions& options);
  ~Run();
  /// Exit status: 0 when all poses were right (pick_line.hpp) and the gripper failed at no more than allowed.
  int run();

 private:
  /// One pick on its way: from the PLC's request to the robot's report, each as far as it is played here.
  struct Pick {
    std::optional<PlcResult> result;
    std::optional<drivers::robot::Pick> read;
    std::optional<Bin::Nearest> nearest;
    std::optional<GripResult> grip;
  };
  enum class Step { Idle, Asked, Robot };

  void open_devices();
  WhereScanner where_scanner(const config::Supply& supply);
  void say_bin(const char* what) const;
  void print_addresses() const;
  void on_line(const std::string& line, TimePoint now);
  void read_commands(TimePoint now);
  void obey(const FaultCommand& command);
  void obey(Order::Kind order, TimePoint now);
  void turn_devices(TimePoint now);
  void turn_plc(TimePoint now);
  void on_result(const PlcResult& result, TimePoint now);
  void turn_robot(TimePoint now);
  /// The gripper closes where the pick says; true: it holds the object.
  bool close_gripper(Pick& pick, const Transform<frame::Base, frame::Tcp>& T_base_approach,
                     const Transform<frame::Base, frame::Tcp>& T_base_grasp,
                     const Transform<frame::Base, frame::Tcp>& T_base_retreat);
  void finish_pick(std::uint16_t pick_id, const std::string& how, TimePoint now);
  void finish_as_counted();
  void tell_alarms();
  void refill_when_low();
  std::optional<TimePoint> deadline() const;
  void finish(int status, const std::string& why);
  std::string summary() const;

  const config::Config& config_;
  RunOptions options_;
  int signals_ = -1;  // before anything that starts a thread: all inherit the mask
  drivers::link::Loop loop_;
  Bin bin_;
  std::unique_ptr<PivotPort> pivot_;
  std::unique_ptr<ScannerPort> scanner_;
  std::unique_ptr<RobotPort> robot_;
  std::unique_ptr<PosePort> poses_;  ///< Of a robot that carries the scanner.
  std::unique_ptr<PlcPort> plc_;
  std::string typed_;
  std::optional<int> status_;

  Step step_ = Step::Idle;
  TimePoint step_since_{}, next_request_{}, next_reset_{};
  std::uint16_t asked_boot_ = 0;  ///< Of the daemon that was asked.
  bool pick_wanted_ = false;
  bool supply_changed_ = false;  ///< Since the last request: what was scanned does not hold.
  std::map<std::uint16_t, Pick> picks_;
  std::uint16_t picking_ = 0;
  std::uint16_t alarms_told_ = 0;
  int done_ = 0, right_ = 0, taken_ = 0, without_pick_ = 0, without_pick_in_row_ = 0, refills_ = 0;
  double worst_mm_ = 0, worst_deg_ = 0;
};
}  // namespace binpick::emulators
