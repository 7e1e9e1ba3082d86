#include "drivers/pivot/session.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <deque>

#include "base/log.hpp"
#include "drivers/pivot/codec.hpp"
#include "drivers/pivot/setpoints.hpp"
#include "drivers/pivot/state_word.hpp"

namespace binpick::drivers::pivot {
namespace {
using namespace std::chrono_literals;

constexpr int kAttemptsMax = 3;          ///< A request is sent this often before the module counts as gone.
constexpr Duration kProbePause = 200ms;  ///< With three attempts of 100 ms: one probe in half a second.
constexpr int kLateReadsMax = 5;         ///< Of the nine reads of an identification: a busy host may be late once.
constexpr Duration kQuiet = 300ms;       ///< After a reply that came too late, before the module is believed.
constexpr Duration kStatePollStanding = 250ms;  ///< Full state word, for what the short state does not say.
constexpr Duration kStatePollMoving = 100ms;
constexpr Duration kReferencePoll = 50ms;
constexpr Duration kResetSettle = 100ms;         ///< Between RESET and the next look at the state.
constexpr Duration kResetPeriod = 400ms;         ///< RESET does not move the axis, so it may be tried for ever.
constexpr Duration kWatchdogPeriod = 50ms;       ///< The module's own period is not public.
constexpr Duration kMoveLateMax = 1s;            ///< After the end of its ramp, a move must be done.
constexpr Duration kStoppedReferencePause = 3s;  ///< A stopped reference run is not started again at once.
constexpr Duration kSetpointCycleMax = 20ms;
constexpr Duration kSettle = 100ms;              ///< The last set-point is repeated this often, in case it was lost.
constexpr double kTargetTolerance_rad = 0.0015;  ///< 0.09 degrees; the axis repeats to 0.02.
constexpr double kAcceleration_rad_s2 = 4.0;     ///< Gentler than most modules can: the scanner rides on the axis.
constexpr std::size_t kEventsMax = 100'000;      ///< Nobody takes them: drop the oldest rather than grow.

constexpr std::array kIdentity{Parameter::Firmware,    Parameter::SerialNumber,    Parameter::Config,
                               Parameter::Setup,       Parameter::PositionMin,     Parameter::PositionMax,
                               Parameter::VelocityMax, Parameter::AccelerationMax, Parameter::StateWord};

std::string formatted(const char* format, auto... values) {
  char text[256];
  std::snprintf(text, sizeof text, format, values...);
  return text;
}
double degrees(double rad) { return Angle::rad(rad).in_deg(); }
}  // namespace

struct Session::Impl {
  enum class Phase { Offline, Identify, Recover, Reference, Stand, Move };
  enum class Halt { None, Stopping, Resetting };  // after stop(): HALT, stand, RESET
  struct Outstanding {
    Request request;
    TimePoint sent_at, give_up_at;
    int attempts = 1;
  };

  explicit Impl(const Options& o) : options{o} {
    const Duration horizon = std::max<Duration>(options.setpoint_horizon, 20ms);
    cycle = std::clamp<Duration>(horizon / 4, 5ms, kSetpointCycleMax);
  }

  Options options;
  Duration cycle{};
  Phase phase = Phase::Offline;
  std::optional<Outstanding> outstanding;
  std::vector<CanFrame> out;
  std::deque<Event> events;
  std::optional<Failed::Why> failed;  ///< Told to the cell and not yet followed by Ready.
  TimePoint now{};                    ///< The latest time heard of; kernel time stamps may lag behind the loop's.

  // What the module said.
  std::size_t identity_index = 0;
  ModuleInfo module;
  std::uint32_t config_word = 0;
  std::uint32_t word = 0;  ///< Last state word.
  std::uint8_t shorts = 0;
  bool seen_before = false;

  // When to do what.
  TimePoint step_at{};  ///< Next step of identifying, recovering, referencing or of the halt sequence.
  TimePoint sample_at{}, state_at{}, setpoint_at{}, watchdog_at{};
  TimePoint reset_at{}, reference_until{}, reference_not_before{};
  TimePoint clean_sample_at{};  ///< Of the last sample that was good.
  bool halt_first = false;
  bool home_pending = false;
  bool state_next = false;  ///< Firmware without parameter 62: the state follows each position.
  int references_failed = 0;

  // The move.
  Halt halt = Halt::None;
  std::optional<std::pair<double, double>> goal;  ///< Target and speed, until it is planned.
  std::optional<SetpointStream> stream;
  TimePoint last_setpoint_at{};
  int setpoints_missed = 0;
  std::optional<Sample> last_sample;

  // The bus.
  bool bus_off = false;
  bool error_passive = false;
  int doubles =
      0;  ///< Positions that were asked twice and may come twice, the second one as the answer to a later request.
  TimePoint doubles_until{};
  int late_reads = 0;     ///< While identifying: answers that took longer than a position's may.
  bool repeated = false;  ///< While identifying: a request had to be repeated; late answers may still come.
  int garbled = 0;
  std::string garbled_text;
  std::uint32_t foreign_module = 0;

  // --- telling the cell ---------------------------------------------------------------------------------------------
  void tell(Event event) {
    if (events.size() >= kEventsMax) events.pop_front();
    events.push_back(std::move(event));
  }

  void fail(Failed::Why why, const std::string& text) {
    if (failed == why) return;
    failed = why;
    BINPICK_LOG(Warning, "pivot", "%s (state word %08X)", text.c_str(), word);
    tell(Failed{why, word, text});
  }

  void be_ready() {
    phase = Phase::Stand;
    failed.reset();
    references_failed = 0;
    halt = Halt::None;
    drop_move();
    sample_at = state_at = now;
    clean_sample_at = now;
    last_sample.reset();
    tell(Ready{module});
  }

  // --- leaving and entering phases ----------------------------------------------------------------------------------
  void drop_move() {
    goal.reset();
    stream.reset();
    setpoints_missed = 0;
  }

  void identify(Duration pause) {
    if (phase == Phase::Move || phase == Phase::Reference)
      out.push_back(encode(options.module_id, Plain{Command::Halt}));
    phase = Phase::Identify;
    identity_index = 0;
    repeated = false;
    late_reads = 0;
    doubles = 0;
    outstanding.reset();
    drop_move();
    halt = Halt::None;
    step_at = now + pause;
  }

  void recover(bool with_halt) {
    phase = Phase::Recover;
    drop_move();
    halt = Halt::None;
    halt_first = with_halt;
    step_at = now;
    reset_at = now;
  }

  void reference() {
    phase = Phase::Reference;
    drop_move();
    halt = Halt::None;
    home_pending = true;
    step_at = std::max(now, reference_not_before);
    reference_until = step_at + options.reference_timeout;
  }

  void reference_failed(const std::string& text) {
    fail(Failed::Why::ReferenceFailed, text);
    static constexpr std::array<Duration, 3> kPauses{1s, 10s, 30s};
    reference_not_before = now + kPauses[std::min<std::size_t>(static_cast<std::size_t>(references_failed), 2)];
    ++references_failed;
    recover(true);
  }

  /// The state word alone decides what comes next; the reference run is the only motion that starts by itself.
  void go_on_from_state() {
    if ((word & (state::kFaults | state::kHalt | state::kMotion)) != 0) {
      const bool moving = (word & state::kMotion) != 0;
      if ((word & state::kFaults) != 0) fail_by_state(Failed::Why::ModuleError);
      if (phase != Phase::Recover) recover(moving);
    } else if ((word & state::kHomeOk) == 0) {
      reference();
    } else {
      be_ready();
    }
  }

  void fail_by_state(Failed::Why otherwise) {
    const bool power = (word & state::kMotorSupply) != 0;
    fail(power ? Failed::Why::PowerFault : otherwise, "pivot: " + faults_in_words(word));
  }

  /// A reference run or a move that ended with the module's error stays what was told.
  Failed::Why why_so_far() const {
    const bool keep = failed == Failed::Why::ReferenceFailed || failed == Failed::Why::MoveRefused;
    return keep ? *failed : Failed::Why::ModuleError;
  }

  void lost() {
    const unsigned id = options.module_id;
    if (bus_off) {
      fail(Failed::Why::BusOff, bus_off_text());
    } else if (error_passive) {
      fail(Failed::Why::BusDown,
           "CAN controller is error-passive: nobody acknowledges its frames; check the module's 24 V logic supply, the "
           "cable, its termination and the bit rate");
    } else if (garbled > 0) {
      fail(Failed::Why::NoReply, formatted("pivot module %u: %d replies garbled, last: ", id, garbled) + garbled_text +
                                     "; check cable, shield and termination");
    } else if (foreign_module != 0) {
      fail(Failed::Why::NoReply,
           formatted("pivot module %u does not answer, but module %u does: is pivot.module_id right?", id,
                     foreign_module));
    } else {
      fail(Failed::Why::NoReply,
           formatted("pivot module %u does not answer: check its 24 V logic supply, the CAN cable, the bit rate and "
                     "pivot.module_id",
                     id));
    }
    garbled = 0;
    identify(kProbePause);
  }

  void late_replies(Duration round_trip) {
    fail(Failed::Why::NoReply,
         formatted(
             "pivot module %u answers too late (%.0f ms or more): positions would be wrong; check bus load and adapter",
             unsigned{options.module_id}, in_ms(round_trip)));
    identify(kQuiet);
  }

  static std::string bus_off_text() {
    return "CAN bus-off: short circuit, wrong termination or wrong bit rate; it restarts by itself where the interface "
           "has restart-ms set";
  }

  // --- requests -----------------------------------------------------------------------------------------------------
  void send(const Request& request, int attempts = 1) {
    out.push_back(encode(options.module_id, request));
    const bool read = std::holds_alternative<Get>(request);
    if (std::holds_alternative<Move>(request) && (config_word & config_bit::kSynchronousMotion) != 0)
      out.push_back(encode(options.module_id, Broadcast{Command::StartMotion}));
    if (!read && (config_word & config_bit::kSuppressAcknowledge) != 0) return;
    outstanding = Outstanding{request, now, now + options.reply_timeout, attempts};
  }

  void pump() {
    for (int i = 0; i < 4 && !outstanding; ++i) {
      const auto request = next_request();
      if (!request) return;
      send(*request);
    }
  }

  std::optional<Request> next_request() {
    switch (phase) {
      case Phase::Offline:
        return std::nullopt;
      case Phase::Identify:
        if (now < step_at) return std::nullopt;
        return Get{kIdentity[identity_index]};
      case Phase::Recover:
        if (now < step_at) return std::nullopt;
        if (halt_first) {
          halt_first = false;
          return Plain{Command::Halt};
        }
        step_at = now + kResetSettle;
        return Get{Parameter::StateWord};
      case Phase::Reference:
        if (now < step_at) return std::nullopt;
        step_at = now + kReferencePoll;
        if (home_pending) {
          home_pending = false;
          BINPICK_LOG(Info, "pivot", "reference run");
          return Plain{Command::Home};
        }
        return Get{Parameter::StateWord};
      case Phase::Stand:
      case Phase::Move:
        return next_request_at_work();
    }
    return std::nullopt;
  }

  std::optional<Request> next_request_at_work() {
    if (halt != Halt::None && now >= step_at) {
      step_at = now + kReferencePoll;
      return Get{Parameter::StateWord};
    }
    if (stream && now >= setpoint_at) {
      const bool settled = last_setpoint_at >= stream->end();
      if (last_setpoint_at != TimePoint{} && !settled && now - last_setpoint_at > options.setpoint_horizon) {
        // The module has run out of set-points and stands: going on with the old ramp would be a jump.
        goal = {stream->target(), stream_speed};
        stream.reset();
        setpoint_at = now + cycle;
      } else {
        setpoint_at = now + (now >= stream->end() ? kSettle : cycle);
        if ((shorts & short_state::kBufferFull) == 0) {
          last_setpoint_at = now;
          const Setpoint next = stream->at(now);
          const double clamped =
              std::clamp(next.position_rad, module.position_min.in_rad(), module.position_max.in_rad());
          return pivot::Move{Motion::Step, static_cast<float>(clamped), next.time_ms};
        }
      }
    }
    if (state_next) {
      state_next = false;
      return Get{Parameter::StateWord};
    }
    if (now >= sample_at) {
      sample_at = std::max(sample_at + options.sample_period, now + options.sample_period / 2);
      if (has_position_and_state(module.firmware)) return Get{Parameter::PositionAndState};
      state_next = true;
      return Get{Parameter::Position};
    }
    if (now >= state_at) {
      state_at = now + (phase == Phase::Move ? kStatePollMoving : kStatePollStanding);
      return Get{Parameter::StateWord};
    }
    return std::nullopt;
  }

  double stream_speed = 0;

  void start_move(double from, double speed_from) {
    const auto [target, speed] = *goal;
    goal.reset();
    const double acceleration = std::min(module.acceleration_max_rad_s2, kAcceleration_rad_s2);
    const Ramp ramp = Ramp::plan(from, speed_from, target, speed, acceleration);
    stream.emplace(ramp, now, cycle, std::max<Duration>(options.setpoint_horizon, 20ms));
    stream_speed = speed;
    last_setpoint_at = {};
    setpoint_at = now;
    setpoints_missed = 0;
  }

  // --- replies ------------------------------------------------------------------------------------------------------
  Duration round_trip_max() const { return 2 * options.sample_period; }

  void on_reply(const Reply& reply, TimePoint received_at) {
    const Outstanding was = *outstanding;
    outstanding.reset();
    const Duration round_trip = received_at - was.sent_at;
    bus_off = false;
    error_passive = false;
    if (std::holds_alternative<MoveAccepted>(reply)) setpoints_missed = 0;
    const auto* value = std::get_if<Value>(&reply);
    if (value == nullptr) return on_command_done(was.request);
    if (phase == Phase::Identify && round_trip > round_trip_max() && ++late_reads >= kLateReadsMax)
      return late_replies(round_trip);
    const bool sure = is_sure(was.attempts, *value);
    if (const auto* report = std::get_if<PositionReport>(&value->value)) {
      shorts = report->short_state;
      on_position(report->position_rad, was.sent_at, round_trip, sure);
      if ((shorts & short_state::kError) != 0) state_next = phase == Phase::Stand || phase == Phase::Move;
    } else if (value->parameter == Parameter::Position) {
      on_position(std::get<float>(value->value), was.sent_at, round_trip, sure);
    } else if (value->parameter == Parameter::StateWord && phase != Phase::Identify) {
      word = std::get<std::uint32_t>(value->value);
      shorts = to_short_state(word);
      on_state_word();
    } else if (phase == Phase::Identify) {
      on_identity(*value);
    }
  }

  static bool has_position(const Value& value) {
    return value.parameter == Parameter::Position || value.parameter == Parameter::PositionAndState;
  }

  /// Whether a position is the answer to the request it seems to answer, and not a late one to an earlier request.
  bool is_sure(int attempts, const Value& value) {
    if (!has_position(value)) return true;
    if (attempts > 1) return false;
    if (doubles == 0 || now >= doubles_until) return true;
    --doubles;
    return false;
  }

  void on_unexpected(const Reply& reply) {
    const auto* value = std::get_if<Value>(&reply);
    if (value == nullptr) return;  // echoes of commands that waited for none
    if (has_position(*value) && doubles > 0) --doubles;
    if (phase != Phase::Identify) return;
    if (repeated) return late_replies(options.reply_timeout);
    identify(kQuiet);  // answers to what was asked before: let them pass
  }

  void on_command_done(const Request& request) {
    if (const auto* plain = std::get_if<Plain>(&request); plain != nullptr && phase == Phase::Recover)
      step_at = now + (plain->command == Command::Reset ? kResetSettle : Duration{0});
  }

  void on_identity(const Value& value) {
    const auto number = [&value] { return static_cast<double>(std::get<float>(value.value)); };
    switch (value.parameter) {
      case Parameter::Firmware:
        module.firmware = std::get<std::uint16_t>(value.value);
        break;
      case Parameter::SerialNumber:
        module.serial = std::get<std::uint32_t>(value.value);
        break;
      case Parameter::Config:
        config_word = std::get<std::uint32_t>(value.value);
        break;
      case Parameter::PositionMin:
        module.position_min = Angle::rad(number());
        break;
      case Parameter::PositionMax:
        module.position_max = Angle::rad(number());
        break;
      case Parameter::VelocityMax:
        module.velocity_max_rad_s = number();
        break;
      case Parameter::AccelerationMax:
        module.acceleration_max_rad_s2 = number();
        break;
      case Parameter::StateWord:
        word = std::get<std::uint32_t>(value.value);
        break;
      default:
        break;
    }
    if (++identity_index < kIdentity.size()) return;
    if (std::exchange(repeated, false)) {  // once more, when late answers would have come
      --identity_index;
      step_at = now + kQuiet;
      return;
    }
    identity_index = 0;
    shorts = to_short_state(word);
    if (const std::string problem = module_problem(); !problem.empty()) {
      fail(Failed::Why::ModuleError, problem);
      return identify(kQuiet);
    }
    if (!std::exchange(seen_before, true))
      BINPICK_LOG(Info, "pivot", "module %u: firmware %04X, serial %u, %.1f to %.1f deg, at most %.0f deg/s; %s",
                  unsigned{options.module_id}, unsigned{module.firmware}, module.serial, module.position_min.in_deg(),
                  module.position_max.in_deg(), degrees(module.velocity_max_rad_s), state_in_words(word).c_str());
    watchdog_at = now;
    go_on_from_state();
  }

  std::string module_problem() const {
    if ((config_word & config_bit::kLinear) != 0)
      return "the module is a linear axis, not a pivot: is pivot.module_id right?";
    if (!(module.position_min < module.position_max) || !(module.velocity_max_rad_s > 0) ||
        !(module.acceleration_max_rad_s2 > 0))
      return formatted(
          "the module's limits make no sense (%.3f to %.3f rad, %.3f rad/s, %.3f rad/s2): set them with the "
          "vendor's tool",
          module.position_min.in_rad(), module.position_max.in_rad(), module.velocity_max_rad_s,
          module.acceleration_max_rad_s2);
    return {};
  }

  void on_state_word() {
    switch (phase) {
      case Phase::Offline:
      case Phase::Identify:
        return;
      case Phase::Recover:
        return on_state_recovering();
      case Phase::Reference:
        return on_state_referencing();
      case Phase::Stand:
      case Phase::Move:
        return on_state_at_work();
    }
  }

  void on_state_recovering() {
    if ((word & state::kMotion) != 0 && (word & state::kFaults) == 0 && (word & state::kHalt) == 0) {
      step_at = now + kReferencePoll;  // still braking
      halt_first = now >= reset_at + 500ms;
      if (halt_first) reset_at = now;
      return;
    }
    if ((word & (state::kFaults | state::kHalt)) == 0) return go_on_from_state();
    if ((word & state::kFaults) != 0) fail_by_state(why_so_far());
    if (now >= reset_at) {
      reset_at = now + kResetPeriod;
      step_at = now + kResetSettle;
      send(Plain{Command::Reset});
    }
  }

  void on_state_referencing() {
    if ((word & state::kFaults) != 0) {
      if ((word & state::kMotorSupply) == 0) return reference_failed("reference run failed: " + faults_in_words(word));
      fail_by_state(Failed::Why::PowerFault);
      return recover(true);
    }
    if ((word & state::kHalt) != 0) return home_pending ? recover(false) : reference_failed("reference run was halted");
    constexpr std::uint32_t kDone = state::kHomeOk | state::kRampEnd;
    if (!home_pending && (word & kDone) == kDone && (word & state::kMotion) == 0) be_ready();
  }

  void on_state_at_work() {
    if ((word & state::kFaults) != 0) {
      fail_by_state(Failed::Why::ModuleError);
      return recover(phase == Phase::Move);
    }
    if ((word & state::kHomeOk) == 0) {
      fail(Failed::Why::ModuleError, "the pivot lost its reference: was it switched off? It is referenced again");
      return (word & state::kHalt) != 0 ? recover(false) : reference();
    }
    if (halt != Halt::None) return on_state_halting();
    if ((word & state::kHalt) != 0) {
      fail(Failed::Why::ModuleError, "the pivot was halted, and not by us: is another master on the bus?");
      recover(false);
    }
  }

  void on_state_halting() {
    if ((word & state::kMotion) != 0) return;  // still braking
    if (!goal) phase = Phase::Stand;
    if (halt == Halt::Resetting && (word & state::kHalt) == 0) {
      halt = Halt::None;
      return;
    }
    if (halt == Halt::Stopping || now >= reset_at) {
      halt = Halt::Resetting;
      reset_at = now + kResetPeriod;
      step_at = now + kReferencePoll;
      send(Plain{Command::Reset});
    }
  }

  void on_position(double position, TimePoint sent_at, Duration round_trip, bool sure) {
    if (phase != Phase::Stand && phase != Phase::Move) return;
    if (!sure || round_trip > round_trip_max()) return;  // judged by the time since the last good one
    const Sample sample{sent_at + round_trip / 2, Angle::rad(position)};
    if (last_sample && sample.at - last_sample->at < 1s) {
      const double way_max = 1.5 * module.velocity_max_rad_s * std::abs(in_s(sample.at - last_sample->at)) + 0.05;
      if (std::abs(position - last_sample->angle.in_rad()) > way_max) {
        ++garbled;
        garbled_text = formatted("a jump of the position to %.2f deg", degrees(position));
        state_at = now;
        return;
      }
    }
    last_sample = sample;
    clean_sample_at = now;
    garbled = 0;
    tell(sample);
    if (goal && halt == Halt::None && !stream) return start_move(position, 0);
    const bool standing = (shorts & (short_state::kMotion | short_state::kInProgress)) == 0;
    if (stream && now >= stream->end() && standing && std::abs(position - stream->target()) < kTargetTolerance_rad) {
      drop_move();
      phase = Phase::Stand;
      tell(MoveDone{sample.angle});
    }
  }

  // --- time ---------------------------------------------------------------------------------------------------------
  void on_time() {
    if (outstanding && now >= outstanding->give_up_at) on_no_reply();
    const bool identified = phase != Phase::Offline && phase != Phase::Identify;
    if (identified && (config_word & config_bit::kWatchdog) != 0 && now >= watchdog_at) {
      watchdog_at = now + kWatchdogPeriod;
      out.push_back(encode(options.module_id, Broadcast{Command::Watchdog}));
    }
    if (phase == Phase::Reference && now >= reference_until)
      reference_failed(
          formatted("the reference run did not end within %lld s: is the axis free, does the home switch "
                    "work?",
                    static_cast<long long>(options.reference_timeout.count())));
    if ((phase == Phase::Stand || phase == Phase::Move) && now >= silent_until()) {
      if (garbled > 0) return lost();
      return late_replies(now - clean_sample_at);
    }
    if (stream && now >= stream->end() + kMoveLateMax) {
      const double at = last_sample ? last_sample->angle.in_deg() : 0;
      fail(Failed::Why::MoveRefused, formatted("the pivot stands at %.2f deg instead of %.2f: is the axis free, is the "
                                               "target inside its limits?",
                                               at, degrees(stream->target())));
      recover(true);
    }
  }

  TimePoint silent_until() const {
    return clean_sample_at + std::max<Duration>(kAttemptsMax * options.reply_timeout, 10 * options.sample_period) +
           50ms;
  }

  void on_no_reply() {
    const Outstanding was = *outstanding;
    outstanding.reset();
    repeated = phase == Phase::Identify;
    if (const auto* get = std::get_if<Get>(&was.request);
        get != nullptr && (get->parameter == Parameter::Position || get->parameter == Parameter::PositionAndState)) {
      ++doubles;
      doubles_until = now + kQuiet;
    }
    if (std::holds_alternative<pivot::Move>(was.request)) {
      if (++setpoints_missed >= kAttemptsMax) return lost();
      setpoint_at = now;  // a fresh one, not the same again: time has passed
      return;
    }
    if (was.attempts >= kAttemptsMax) return lost();
    send(was.request, was.attempts + 1);
  }

  std::optional<TimePoint> deadline() const {
    if (phase == Phase::Offline) return std::nullopt;
    std::optional<TimePoint> at;
    if (phase != Phase::Identify && (config_word & config_bit::kWatchdog) != 0) at = watchdog_at;
    if (phase == Phase::Reference) at = earlier(at, reference_until);
    if (phase == Phase::Stand || phase == Phase::Move) at = earlier(at, silent_until());
    if (stream) at = earlier(at, stream->end() + kMoveLateMax);
    if (outstanding) return earlier(at, outstanding->give_up_at);
    if (phase == Phase::Stand || phase == Phase::Move) {
      at = earlier(earlier(at, sample_at), state_at);
      if (halt != Halt::None) at = earlier(at, step_at);
      if (stream) at = earlier(at, setpoint_at);
      if (state_next) at = now;
      return at;
    }
    return earlier(at, step_at);
  }

  // --- the bus ------------------------------------------------------------------------------------------------------
  void on_error_frame(const CanFrame& frame) {
    constexpr std::uint32_t kController = 0x004, kBusOff = 0x040, kRestarted = 0x100;
    if ((frame.id & kController) != 0 && frame.length > 1) {
      if ((frame.payload[1] & 0x30) != 0) error_passive = true;
      if ((frame.payload[1] & 0x40) != 0) error_passive = false;
    }
    if ((frame.id & kBusOff) != 0 && phase != Phase::Offline) {
      bus_off = true;
      fail(Failed::Why::BusOff, bus_off_text());
      identify(kProbePause);
    }
    if ((frame.id & kRestarted) != 0) {
      bus_off = false;
      if (phase == Phase::Identify) step_at = now;
    }
  }

  void on_frame(const CanFrame& frame, TimePoint received_at) {
    if (frame.error) return on_error_frame(frame);
    const auto reply = decode_reply(options.module_id, frame);
    if (!reply) {
      if (reply.error().kind != DecodeError::Kind::NotOurs) {
        ++garbled;
        garbled_text = to_string(reply.error());
      } else if (!frame.extended && !frame.rtr && frame.id > kReplyBase && frame.id <= kReplyBase + kModuleIdMax) {
        foreign_module = frame.id - kReplyBase;
      }
      return;
    }
    if (std::holds_alternative<StateChanged>(*reply)) {
      state_next = phase == Phase::Stand || phase == Phase::Move;
    } else if (outstanding && answers(outstanding->request, *reply)) {
      on_reply(*reply, received_at);
    } else {
      on_unexpected(*reply);
    }
  }

  void move_to(double target, double speed) {
    const double min = module.position_min.in_rad();
    const double max = module.position_max.in_rad();
    if (target < min || target > max)
      BINPICK_LOG(Warning, "pivot", "target %.2f deg is outside the module's %.2f to %.2f deg; it is clamped",
                  degrees(target), degrees(min), degrees(max));
    goal = {std::clamp(target, min, max), std::clamp(speed, 1e-3, module.velocity_max_rad_s)};
    phase = Phase::Move;
    if (stream && halt == Halt::None) start_move(stream->position(now), stream->speed(now));
    state_at = now + kStatePollMoving;
  }

  void stop() {
    if (phase == Phase::Offline) return;
    const bool stands = phase == Phase::Stand && (shorts & (short_state::kMotion | short_state::kInProgress)) == 0;
    if (stands) return;
    const bool referencing = phase == Phase::Reference;
    drop_move();
    if (referencing) {
      reference_not_before = now + kStoppedReferencePause;
      recover(false);
    }
    if (phase == Phase::Identify || (phase == Phase::Recover && !referencing)) {
      out.push_back(encode(options.module_id, Plain{Command::Halt}));
      return;
    }
    outstanding.reset();  // a HALT waits for no reply; what was asked before may be answered or not
    if (!referencing) {
      halt = Halt::Stopping;
      step_at = now + kReferencePoll;
    }
    send(Plain{Command::Halt});
  }
};

Session::Session(const Options& options) : impl_{std::make_shared<Impl>(options)} {}

void Session::on_link_up(TimePoint now) {
  Impl& s = *impl_;
  s.now = std::max(s.now, now);
  s.bus_off = s.error_passive = false;
  if (s.phase == Impl::Phase::Offline) s.identify(Duration{0});
  s.pump();
}

void Session::on_link_down(const std::string& why, TimePoint now) {
  Impl& s = *impl_;
  s.now = std::max(s.now, now);
  s.out.clear();
  s.outstanding.reset();
  s.drop_move();
  s.phase = Impl::Phase::Offline;
  const bool bus_off = s.bus_off || why.starts_with("bus-off");
  s.fail(bus_off ? Failed::Why::BusOff : Failed::Why::BusDown, bus_off ? Impl::bus_off_text() : "CAN down: " + why);
}

void Session::on_frame(const CanFrame& frame, TimePoint received_at) {
  Impl& s = *impl_;
  s.now = std::max(s.now, received_at);
  s.on_frame(frame, received_at);
  s.pump();
}

void Session::on_deadline(TimePoint now) {
  Impl& s = *impl_;
  s.now = std::max(s.now, now);
  s.on_time();
  s.pump();
}

std::optional<TimePoint> Session::deadline() const { return impl_->deadline(); }

std::vector<CanFrame> Session::take_frames() { return std::exchange(impl_->out, {}); }

std::optional<Event> Session::take_event() {
  if (impl_->events.empty()) return std::nullopt;
  Event event = std::move(impl_->events.front());
  impl_->events.pop_front();
  return event;
}

Session::State Session::state() const {
  switch (impl_->phase) {
    case Impl::Phase::Offline:
      return State::Offline;
    case Impl::Phase::Identify:
      return State::Identifying;
    case Impl::Phase::Recover:
      return State::Faulted;
    case Impl::Phase::Reference:
      return State::Referencing;
    case Impl::Phase::Stand:
      return State::Standing;
    case Impl::Phase::Move:
      return State::Moving;
  }
  return State::Offline;
}

void Session::move_to(Angle target, double speed_rad_s, TimePoint now) {
  Impl& s = *impl_;
  s.now = std::max(s.now, now);
  const bool possible = s.phase == Impl::Phase::Stand || s.phase == Impl::Phase::Move;
  if (!possible || !std::isfinite(target.in_rad()) || !(speed_rad_s > 0)) {
    BINPICK_LOG(Warning, "pivot", "move to %.2f deg at %.2f deg/s ignored: %s", target.in_deg(), degrees(speed_rad_s),
                possible ? "not a target" : "the pivot is not ready");
    return;
  }
  s.move_to(target.in_rad(), speed_rad_s);
  s.pump();
}

void Session::stop(TimePoint now) {
  Impl& s = *impl_;
  s.now = std::max(s.now, now);
  s.stop();
}
}  // namespace binpick::drivers::pivot
