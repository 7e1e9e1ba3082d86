#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "base/clock.hpp"
#include "daemon/cell.hpp"
#include "tests/emulators/pivot/pivot.hpp"
#include "tests/emulators/plc/plc.hpp"
#include "tests/emulators/robot/pose_sender.hpp"
#include "tests/emulators/robot/robot.hpp"
#include "tests/emulators/robot/rtde_device.hpp"
#include "tests/emulators/scanner/lms400_device.hpp"
#include "tests/emulators/scanner/lps36_view.hpp"
#include "tests/emulators/scanner/scanner_view.hpp"
#include "tests/emulators/world/world.hpp"
#include "tests/support/wire.hpp"

namespace binpick::support {
/// The whole cell in memory and virtual time: the daemon's Cell and the four emulated devices, joined by wires. Time
/// jumps to whoever wants to wake first; minutes of a plant take as long as the work in them.
class EmulatedCell {
 public:
  /// The emulated PLC speaks the word order and the convention of the cell file, the robot its dialect. The daemon is
  /// started. `robot_clock` stamps the robot's poses.
  EmulatedCell(std::shared_ptr<const daemon::CellData> data, emulators::World scene, std::uint64_t seed = 1,
               const emulators::PoseClock& robot_clock = {});

  emulators::World world;
  /// Where the forklift has put the supply: maps its frame as it stands to the one of the cell file.
  Transform<frame::Supply, frame::Supply> T_said_stands;
  emulators::Pivot pivot;
  emulators::Lms400 scanner;  ///< One of the two is wired, by the cell file.
  emulators::Lps36 lps36;
  emulators::Plc plc;
  emulators::Robot robot;
  // Where the robot's poses come from, if it carries the scanner: by its make, one of the two is wired.
  emulators::RtdeDevice rtde;
  emulators::PoseSender pose_sender;
  /// The robot's signal "clear of the view" is wired to the PLC; a test may hold it down.
  bool robot_in_the_way = false;
  /// What the vision worker takes in this world's time; the detection itself is the real one.
  Duration detection_time = std::chrono::milliseconds(150);
  /// A worker that never comes back.
  bool worker_hangs = false;

  TimePoint now() const { return now_; }
  void run_for(Duration time);
  /// Runs until `done`, at most for `limit`. False when the limit came first.
  bool run_until(const std::function<bool()>& done, Duration limit = std::chrono::seconds(30));
  /// Until the PLC reads `ready`.
  bool run_until_ready(Duration limit = std::chrono::seconds(60));
  /// Requests a pick and waits for its answer (the PLC's result); nothing when none came in 30 s.
  std::optional<emulators::PlcResult> pick(std::uint16_t part_id = 1, std::uint16_t supply_id = 1);
  /// A word from a PLC that is the client (FC6), that the daemon has read and not yet looked at: nothing runs in
  /// between.
  void plc_writes(std::uint16_t offset, std::uint16_t value);

  /// The daemon's face; only while it runs.
  daemon::Cell& cell() { return *cell_; }
  bool daemon_runs() const { return cell_ != nullptr; }
  void kill_daemon();   ///< As by SIGKILL: nothing is said to anybody.
  void start_daemon();  ///< As systemd does after it: the next boot count.

  const vision::DepthImage& last_image() const { return last_image_; }  ///< Of the last sweep.
  /// Real time that the cell took from seeing a request to having its sweep begun, of each.
  const std::vector<Duration>& took_up() const { return took_up_; }
  std::uint64_t sweeps() const { return sweeps_; }  ///< Detect requests that the cell made.
  const std::vector<daemon::DetectResult>& results() const { return results_; }  ///< Of all detections, oldest first.

 private:
  emulators::WhereScanner where_scanner(const config::Config& config);
  Wire plc_wire();
  Wire scanner_wire();
  Wire robot_wire();
  Wire rtde_wire();
  Wire pose_wire();
  void pump();
  bool pump_frames();
  bool pump_datagrams();
  void serve_deadlines();
  std::optional<TimePoint> next_deadline() const;

  std::shared_ptr<const daemon::CellData> data_;
  TimePoint now_{std::chrono::hours(1)};
  std::uint16_t boot_count_ = 0;
  std::unique_ptr<daemon::Cell> cell_;
  plc::ConnectionId plc_connection_ = 0;
  Wire plc_wire_, scanner_wire_, robot_wire_, rtde_wire_, pose_wire_;
  bool can_up_ = false;
  std::optional<TimePoint> udp_up_at_;           // the socket to an LPS 36 opens; nothing: it is open
  std::optional<daemon::DetectResult> looking_;  // comes out at looked_at_
  TimePoint looked_at_{};
  vision::DepthImage last_image_;
  std::uint64_t sweeps_ = 0;
  std::vector<Duration> took_up_;
  std::vector<daemon::DetectResult> results_;
};
}  // namespace binpick::support
