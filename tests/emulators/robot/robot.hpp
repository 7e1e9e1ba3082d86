#pragma once

#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <optional>
#include <random>
#include <string>
#include <variant>

#include "base/bytes.hpp"
#include "base/clock.hpp"
#include "drivers/robot/codec.hpp"
#include "tests/emulators/faults.hpp"

namespace binpick::emulators {
/// A path that the robot carries the scanner along, at constant speed.
struct ScanPath {
  Transform<frame::Base, frame::Flange> T_base_begin, T_base_end;
  Duration duration = std::chrono::seconds(3);
};

struct RobotOptions {
  drivers::robot::Dialect dialect = drivers::robot::Dialect::UniversalRobots;
  Duration poll_period = std::chrono::milliseconds(100);
  Duration reply_timeout = std::chrono::seconds(2);  ///< Of the programs: then the socket is opened anew.
  Duration approach = std::chrono::milliseconds(600);
  Duration grasp = std::chrono::milliseconds(200);
  Duration retreat = std::chrono::milliseconds(600);
  std::map<std::uint16_t, ScanPath> paths = {};  ///< By the numbers that the program knows.
  Duration to_path = std::chrono::milliseconds(800);
  std::uint64_t seed = 1;  ///< Of garbage.
};

/// An arm whose program is that of its make's page in docs/robots/, as the client of the cell: says hello, fetches
/// until there is a pick, moves, reports. What the program keeps in variables that survive (the open pick, and whether
/// the part is gripped) outlives restart_program() and every lost connection. No clock, no socket.
///
/// Faults: `silent` freezes the program, `error_code` is a gripper that never holds anything, `wrong_id` reports the
/// pick under the next id, `emergency_stop` stops program and arm where they are and starts the program again when it
/// is released.
class Robot {
 public:
  struct PickRead {
    drivers::robot::Pick pick;
  };  ///< The answer to a fetch, as the robot read it.
  struct NoPickRead {
    drivers::robot::Status status;
  };  ///< When it changed.
  struct ReportAnswered {
    std::uint16_t pick_id;
    bool done;
    drivers::robot::Status status;
  };
  struct ScanAnswered {
    std::uint16_t scan;
    bool broken;
    drivers::robot::Status status;
  };  ///< To the word that its path has ended, or was broken off.
  struct Trouble {
    std::string text;
  };  ///< The program opens its socket anew.
  using Event = std::variant<PickRead, NoPickRead, ReportAnswered, ScanAnswered, Trouble>;

  explicit Robot(const RobotOptions& options = {});

  void on_connected(TimePoint now);
  void on_bytes(ByteView bytes, TimePoint now);
  void on_disconnected(TimePoint now);
  void on_deadline(TimePoint now);
  std::optional<TimePoint> deadline() const;
  Bytes take_output();
  bool take_reopen();  ///< True once when the robot closes its socket.
  std::optional<Event> take_event();

  /// False while no connection may stand: unplugged, or the program is stopped.
  bool wants_link() const { return !faults.unplugged && !faults.emergency_stop; }
  /// The signal "robot clear of the view", which a plant wires to its PLC.
  bool clear_of_view() const { return motion_ == Motion::None; }
  /// Where the flange is; it moves on scan paths only (the arm's other motions take time and nothing else).
  Transform<frame::Base, frame::Flange> flange_at(TimePoint at) const;
  /// It stops at this share of the next path and stays there, as by a protective stop. Says so, or not: a program that
  /// is stopped cannot.
  std::optional<double> stops_at;
  bool tells_of_stop = true;
  std::uint64_t picks_done() const { return done_; }
  std::uint64_t picks_failed() const { return failed_; }

  /// The operator stops the program and starts it again, at any point: the arm retreats first, then the program goes on
  /// with what its variables say.
  void restart_program(TimePoint now);

  /// At the grasp pose with the gripper closed: the world takes the object away and tells whether one was there.
  /// Empty: there always is.
  std::function<bool(const drivers::robot::Pick&)> on_grasp;

  Faults faults;

 private:
  enum class Motion { None, Approach, Grasp, Retreat, ToPath, AtPath, OnPath, PathOver, Stopped };
  enum class Waiting { None, Hello, Fetch, Report, Begin, PathReport };
  struct Due {
    TimePoint at;
    std::byte byte;
  };
  void update(TimePoint now);
  void move_on(TimePoint now);
  void talk(TimePoint now);
  void ask(const drivers::robot::Request& request, Waiting waiting, TimePoint now);
  void on_reply(const drivers::robot::Reply& reply, TimePoint now);
  bool may_talk() const;
  bool is_on_scan() const;
  void halt(TimePoint now);
  void fail_link(const std::string& text);
  void send_due(TimePoint now);
  void send(std::byte byte);

  RobotOptions options_;
  // Variables that survive: installation variables (UR), registers (Fanuc), globals (Kawasaki).
  drivers::robot::Pick pick_;
  bool pick_open_ = false;
  bool gripped_ = false;
  // The arm.
  Motion motion_ = Motion::None;
  TimePoint motion_until_{};
  std::uint16_t scan_ = 0;
  std::optional<ScanPath> path_;  // the last one, that the flange stands on
  std::optional<TimePoint> path_began_;
  double path_share_ = 1;  // of it that is run
  bool stopped_before_ = false;
  TimePoint stopped_at_{};
  // The program.
  bool connected_ = false;
  bool greeted_ = false;
  Waiting waiting_ = Waiting::None;
  TimePoint reply_until_{};
  TimePoint next_poll_{};
  std::optional<drivers::robot::Status> last_status_;
  std::string received_;
  std::deque<Due> due_;
  Bytes out_;
  bool reopen_ = false;
  std::optional<std::size_t> bytes_limit_;
  std::size_t bytes_sent_ = 0;
  TimePoint now_{};
  std::uint64_t done_ = 0, failed_ = 0;
  std::deque<Event> events_;
  std::mt19937_64 random_;
};
}  // namespace binpick::emulators
