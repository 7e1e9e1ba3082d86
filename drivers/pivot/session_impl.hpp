#pragma once

#include <cstdio>
#include <deque>
#include <optional>
#include <string>
#include <vector>

#include "drivers/pivot/protocol.hpp"
#include "drivers/pivot/session.hpp"
#include "drivers/pivot/setpoints.hpp"

/// The inside of the pivot's session, in three files: session.cpp (asks and answers), session_bringup.cpp (until it is
/// ready, and again after a fault), session_work.cpp (positions and moves). What a module speaks is behind
/// protocol.hpp.
namespace binpick::drivers::pivot {
using namespace std::chrono_literals;

constexpr int kAttemptsMax = 3;           ///< A request is sent this often before the module counts as gone.
constexpr int kLateReadsMax = 5;          ///< Of the nine reads of an identification: a busy host may be late once.
constexpr Duration kQuiet = 300ms;        ///< After a reply that came too late, before the module is believed.
constexpr Duration kProbePause = 200ms;   ///< With three attempts of 100 ms: one probe in half a second.
constexpr Duration kStatePoll = 50ms;     ///< While something is waited for.
constexpr Duration kResetPeriod = 400ms;  ///< RESET does not move the axis, so it may be tried for ever.

template <class... Values>
std::string formatted(const char* format, Values... values) {
  char text[256];
  std::snprintf(text, sizeof text, format, values...);
  return text;
}
inline double degrees(double rad) { return Angle::rad(rad).in_deg(); }

struct Session::Impl {
  enum class Phase { Offline, Identify, Recover, Reference, Stand, Move };
  enum class Halt { None, Stopping, Resetting };  // after stop(): HALT, stand, RESET
  struct Outstanding {
    Ask ask;
    TimePoint sent_at, give_up_at;
    int attempts = 1;
  };
  /// To be sent before anything else, as soon as the module can bear another frame.
  struct Owed {
    Ask ask;
    int attempts = 1;
    bool answer_matters = true;
  };

  explicit Impl(const Options& o);

  // Telling the cell.
  void tell(Event event);
  void fail(Failed::Why why, const std::string& text);
  void fail_by_state(Failed::Why otherwise);
  /// A reference run or a move that ended with the module's error stays what was told.
  Failed::Why why_so_far() const;
  static std::string bus_off_text();

  // Asks and answers.
  void owe(Ask::What what, bool answer_matters = true);
  void send(const Owed& owed);
  void pump();
  std::optional<Ask> next_ask();
  void on_answer(const Answer& answer, TimePoint received_at);
  /// Whether a position is the answer to the ask it seems to answer, and not a late one to an earlier ask.
  bool is_sure(int attempts, const Answer& answer);
  /// Whether `ask` is answered as a position is, so that a late answer may be taken for one.
  bool looks_like_position(const Ask& ask) const;
  void on_unexpected(const Answer& answer);
  void on_no_answer();
  void on_refused(const Ask& ask, const Answer& answer);
  void on_other_master();
  void on_blocked(double position);
  void on_frame(const CanFrame& frame, TimePoint received_at);
  void on_error_frame(const CanFrame& frame);
  void on_time();
  std::optional<TimePoint> deadline() const;

  // Bring-up: identify, recover, reference.
  std::optional<Ask> next_ask_bringing_up();
  void be_ready();
  void identify(Duration pause);
  void recover(bool with_halt);
  void reference();
  void reference_failed(const std::string& text);
  /// The state word alone decides what comes next; the reference run is the only motion that starts by itself.
  void go_on_from_state();
  void lost();
  void late_replies(Duration round_trip);
  void on_identity(const Ask& ask, const Answer& answer);
  void on_identified();
  std::string module_problem() const;
  void on_command_done(const Ask& ask);
  void on_state(const ModuleState& heard);
  void on_state_recovering();
  void on_state_referencing();

  // At work: positions, moves, stops.
  void drop_move();
  std::optional<Ask> next_ask_at_work();
  std::optional<Ask> next_setpoint();
  void start_move(double from, double speed_from);
  void on_state_at_work();
  void on_state_halting();
  void on_position(double position, TimePoint sent_at, Duration round_trip, bool sure);
  Duration round_trip_max() const;
  TimePoint silent_until() const;
  void move_to(double target, double speed);
  void stop();

  Options options;
  Duration cycle{};
  Phase phase = Phase::Offline;
  std::unique_ptr<ModuleProtocol> protocol;
  std::optional<Outstanding> outstanding;
  std::optional<Owed> owed;
  TimePoint write_at{};  ///< Not before, for a module that cannot bear frames on one another's heels.
  std::vector<CanFrame> out;
  std::deque<Event> events;
  std::optional<Failed::Why> failed;  ///< Told to the cell and not yet followed by Ready.
  TimePoint now{};                    ///< The latest time heard of; kernel time stamps may lag behind the loop's.

  // What the module said.
  std::size_t identity_index = 0;
  ModuleInfo module;
  std::uint32_t word = 0;  ///< Last state word.
  std::uint8_t code = 0;   ///< Its error's own code, where the protocol has one.
  std::uint8_t shorts = 0;
  bool identified = false;   ///< Module and word are of a real module.
  bool seen_before = false;  ///< It was logged.
  bool told_identity = false;

  // When to do what.
  TimePoint step_at{};  ///< Next step of identifying, recovering, referencing or of the halt sequence.
  TimePoint sample_at{}, state_at{}, setpoint_at{}, watchdog_at{};
  TimePoint reset_at{}, reference_until{}, reference_not_before{};
  TimePoint clean_sample_at{};  ///< Of the last sample that was good.
  bool halt_first = false;
  bool home_pending = false;
  bool state_next = false;  ///< Firmware without parameter 62: the state follows each position.
  int references_failed = 0;
  std::string reference_refused;  ///< Why the module did not begin it.

  // The move.
  Halt halt = Halt::None;
  std::optional<std::pair<double, double>> goal;  ///< Target and speed, until it is planned.
  std::optional<SetpointStream> stream;
  double stream_speed = 0;   ///< Wanted, should the rest of the way be planned again.
  std::size_t prepared = 0;  ///< Settings before the move that the module has taken.
  TimePoint last_setpoint_at{};
  std::optional<double> accepted_rad;  ///< The set-point that the module took last.
  int setpoints_missed = 0;
  std::optional<Sample> last_sample;

  // The bus.
  bool bus_off = false;
  bool error_passive = false;
  /// Positions that were asked twice and may come twice, the second one as the answer to a later request.
  int doubles = 0;
  TimePoint doubles_until{};
  int late_reads = 0;     ///< While identifying: answers that took longer than a position's may.
  bool repeated = false;  ///< While identifying: a request had to be repeated; late answers may still come.
  int garbled = 0;
  std::string garbled_text;
  std::uint32_t foreign_module = 0;
};
}  // namespace binpick::drivers::pivot
