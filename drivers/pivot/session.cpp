#include "drivers/pivot/session.hpp"

#include <algorithm>
#include <cmath>

#include "base/log.hpp"
#include "drivers/pivot/session_impl.hpp"
#include "drivers/pivot/state_word.hpp"

namespace binpick::drivers::pivot {
namespace {
constexpr Duration kWatchdogPeriod = 50ms;  ///< The module's own period is not public.
constexpr Duration kSetpointCycleMax = 20ms;
constexpr Duration kMoveLateMax = 1s;        ///< After the end of its ramp, a move must be done.
constexpr std::size_t kEventsMax = 100'000;  ///< Nobody takes them: drop the oldest rather than grow.

bool has_position(const Value& value) {
  return value.parameter == Parameter::Position || value.parameter == Parameter::PositionAndState;
}
}  // namespace

Session::Impl::Impl(const Options& o) : options{o} {
  const Duration horizon = std::max<Duration>(options.setpoint_horizon, 20ms);
  cycle = std::clamp<Duration>(horizon / 4, 5ms, kSetpointCycleMax);
}

void Session::Impl::tell(Event event) {
  if (events.size() >= kEventsMax) events.pop_front();
  events.push_back(std::move(event));
}

void Session::Impl::fail(Failed::Why why, const std::string& text) {
  if (failed == why) return;
  failed = why;
  BINPICK_LOG(Warning, "pivot", "%s (state word %08X)", text.c_str(), word);
  tell(Failed{why, word, text});
}

std::string Session::Impl::bus_off_text() {
  return "CAN bus-off: short circuit, wrong termination or wrong bit rate; it restarts by itself where the interface "
         "has restart-ms set";
}

void Session::Impl::send(const Request& request, int attempts) {
  out.push_back(encode(options.module_id, request));
  const bool read = std::holds_alternative<Get>(request);
  if (std::holds_alternative<Move>(request) && (config_word & config_bit::kSynchronousMotion) != 0)
    out.push_back(encode(options.module_id, Broadcast{Command::StartMotion}));
  if (!read && (config_word & config_bit::kSuppressAcknowledge) != 0) return;
  outstanding = Outstanding{request, now, now + options.reply_timeout, attempts};
}

void Session::Impl::pump() {
  for (int i = 0; i < 4 && !outstanding; ++i) {
    const auto request = next_request();
    if (!request) return;
    send(*request);
  }
}

std::optional<Request> Session::Impl::next_request() {
  switch (phase) {
    case Phase::Offline:
      return std::nullopt;
    case Phase::Identify:
    case Phase::Recover:
    case Phase::Reference:
      if (now < step_at) return std::nullopt;
      return next_request_bringing_up();
    case Phase::Stand:
    case Phase::Move:
      return next_request_at_work();
  }
  return std::nullopt;
}

void Session::Impl::on_reply(const Reply& reply, TimePoint received_at) {
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

bool Session::Impl::is_sure(int attempts, const Value& value) {
  if (!has_position(value)) return true;
  if (attempts > 1) return false;
  if (doubles == 0 || now >= doubles_until) return true;
  --doubles;
  return false;
}

void Session::Impl::on_unexpected(const Reply& reply) {
  const auto* value = std::get_if<Value>(&reply);
  if (value == nullptr) return;  // echoes of commands that waited for none
  if (has_position(*value) && doubles > 0) --doubles;
  if (phase != Phase::Identify) return;
  if (repeated) return late_replies(options.reply_timeout);
  identify(kQuiet);  // answers to what was asked before: let them pass
}

void Session::Impl::on_no_reply() {
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

void Session::Impl::on_frame(const CanFrame& frame, TimePoint received_at) {
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

void Session::Impl::on_error_frame(const CanFrame& frame) {
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

void Session::Impl::on_time() {
  if (outstanding && now >= outstanding->give_up_at) on_no_reply();
  const bool in_use = phase != Phase::Offline && phase != Phase::Identify;
  if (in_use && (config_word & config_bit::kWatchdog) != 0 && now >= watchdog_at) {
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

std::optional<TimePoint> Session::Impl::deadline() const {
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

std::optional<ModuleInfo> Session::module() const {
  if (!impl_->identified) return std::nullopt;
  return impl_->module;
}

std::uint32_t Session::state_word() const { return impl_->word; }

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
