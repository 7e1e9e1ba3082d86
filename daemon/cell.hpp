#pragma once

#include <cstdint>
#include <deque>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "base/clock.hpp"
#include "daemon/cycle/cell_data.hpp"
#include "daemon/cycle/detection.hpp"
#include "daemon/cycle/record.hpp"
#include "daemon/cycle/scan_picture.hpp"
#include "daemon/pick_memory.hpp"
#include "daemon/sequence.hpp"
#include "drivers/pivot/session.hpp"
#include "drivers/robot/session.hpp"
#include "drivers/scanner/any/scanner.hpp"
#include "drivers/sweep/pivot_carrier.hpp"
#include "drivers/sweep/robot_carrier.hpp"
#include "drivers/sweep/sweep.hpp"
#include "plc/session.hpp"

namespace binpick::daemon {
/// The cell: the four sessions, wired together. No I/O, no clock: the daemon pumps it on sockets, tests in memory and
/// virtual time. After any call into one of its sessions, and at its deadline, call run(now).
class Cell {
 public:
  Cell(std::shared_ptr<const CellData> data, std::uint16_t boot_count);

  plc::Session& plc() { return plc_; }
  drivers::pivot::Session& pivot() { return pivot_; }
  drivers::scanner::Scanner& scanner() { return scanner_; }
  drivers::robot::Session& robot() { return robot_; }
  /// Where the robot is; nothing unless it carries the scanner.
  drivers::robot::PoseSource* poses() { return poses_ ? &*poses_ : nullptr; }

  /// Serves deadlines that have come, drains every session's events and moves the cycle on, until nothing happens any
  /// more.
  void run(TimePoint now);
  std::optional<TimePoint> deadline() const;

  /// The scan to look through, once per cycle, when its last profile is in.
  std::optional<DetectRequest> take_detect_request();
  void on_detect_result(DetectResult result, TimePoint now);
  /// What a cycle that has ended leaves, oldest first; only where the configuration wants records.
  std::optional<Record> take_record();
  /// Records can be written, or cannot: an alarm, and never more than that.
  void on_records_written(bool written, TimePoint now);

  /// New configuration; in force at once when no cycle runs, else after it. What only a restart can change keeps its
  /// old value and is named in the log and by an alarm.
  void reload(std::shared_ptr<const CellData> data);
  /// A reload was refused: alarm and log, the old configuration stays in force.
  void reload_refused(const std::vector<std::string>& findings, TimePoint now);
  const CellData& data() const { return *data_; }

  /// Ends the cycle, stops the pivot, withdraws everything valid. Nothing is accepted any more.
  void shut_down(TimePoint now);
  /// After shut_down: the pivot stands (or is not there), nothing valid is left, and a PLC that is asked knows it.
  bool safe() const;

  CellState state() const { return state_; }
  drivers::sweep::State sweep_state() const { return sweep_.state(); }
  std::uint64_t cycles() const { return cycle_id_; }

 private:
  bool hear_plc(TimePoint now);
  bool drain(TimePoint now);
  drivers::sweep::Carrier& carrier();
  drivers::sweep::Motion motion_over(const config::Supply& supply) const;
  void apply(CellInput input, TimePoint now);
  void begin_sweep(TimePoint now);
  void start_detection(TimePoint now);
  void publish(TimePoint now);
  void tell_why_none(const DetectResult& scan) const;
  PickMemory::Place place() const { return {request_.supply_id, request_.part_id}; }
  void stop_cycle(TimePoint now);
  void begin_record();
  void end_record(RecordedAnswer answer, TimePoint now);
  void put_in_force(TimePoint now);
  void update_ready(TimePoint now);
  void watch_robot_lines(TimePoint now);
  /// What is wrong with a device, from its failure until it is ready again.
  struct Trouble {
    plc::Alarm alarm;
    std::string text;
  };
  void device_failed(std::optional<Trouble>& standing, Trouble trouble, TimePoint now);
  void alarm_off(std::optional<Trouble>& standing, TimePoint now);

  void on(const plc::Event& event, TimePoint now);
  void on(const drivers::pivot::Event& event, TimePoint now);
  void on(const drivers::scanner::Event& event, TimePoint now);
  void on(const drivers::robot::Event& event, TimePoint now);
  void on(const drivers::robot::PoseEvent& event, TimePoint now);
  void on(drivers::sweep::Event& event, TimePoint now);

  const config::Config started_with_;  // what the sessions and links still run on
  std::shared_ptr<const CellData> data_;
  std::shared_ptr<const CellData> edited_;  // in force after the running cycle
  plc::Session plc_;
  drivers::pivot::Session pivot_;
  drivers::scanner::Scanner scanner_;
  drivers::robot::Session robot_;
  std::optional<drivers::robot::PoseSource> poses_;
  drivers::sweep::PivotCarrier pivot_carrier_;
  std::optional<drivers::sweep::RobotCarrier> robot_carrier_;  // instead of the pivot
  drivers::sweep::Sweep sweep_;

  CellState state_ = CellState::Idle;
  bool stopping_ = false;
  bool robot_lost_ = false;
  std::uint64_t robot_bad_lines_ = 0;
  std::optional<TimePoint> robot_bad_since_;
  std::optional<Trouble> pivot_trouble_, scanner_trouble_, poses_trouble_;
  std::uint64_t cycle_id_ = 0;
  std::uint16_t boot_count_ = 0;
  std::uint16_t pick_id_ = 0;
  plc::Alarm cycle_alarm_ = plc::Alarm::None;  // why FaultCycle
  plc::PickRequest request_;
  PickMemory memory_;
  std::size_t supply_ = 0, recipe_ = 0;  // indices of the running request
  std::optional<drivers::pivot::ModuleInfo> module_;
  std::optional<ScanPicture> picture_;
  drivers::sweep::Done sweep_done_;
  TimePoint request_at_, last_profile_at_;
  std::optional<TimePoint> unfetched_since_;  ///< Of a pick from a new scan, until the robot has it: its last profile.
  std::optional<DetectRequest> detect_request_;
  std::optional<DetectResult> detect_result_;
  std::optional<Record> record_;  // of the running cycle, where it is wanted
  std::deque<Record> records_;    // of those that have ended
};
}  // namespace binpick::daemon
