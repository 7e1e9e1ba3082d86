#include "drivers/pivot/session.hpp"

#include <algorithm>
#include <cmath>

#include "base/log.hpp"
#include "base/overloaded.hpp"
#include "drivers/pivot/motion_errors.hpp"
#include "drivers/pivot/session_impl.hpp"
#include "drivers/pivot/state_word.hpp"

namespace binpick::drivers::pivot {
namespace {
constexpr Duration kWatchdogPeriod = 50ms;  ///< The module's own period is not public.
constexpr Duration kSetpointCycleMax = 20ms;
constexpr Duration kMoveLateMax = 1s;        ///< After the end of its ramp, a move must be done.
constexpr std::size_t kEventsMax = 100'000;  ///< Nobody takes them: drop the oldest rather than grow.
constexpr Duration kUnfinishedMax = 5ms;     ///< From "heard" to what was asked for; then it is asked again.

bool is_answer(const ModuleProtocol& protocol, const Ask& ask, const Answer& answer) {
  const std::uint16_t key = protocol.key(ask);
  return answer.key == key || (answer.refused && answer.key >> 8 == key >> 8);
}
}  // namespace

Session::Impl::Impl(const Options& o) : options{o}, protocol{make_protocol(o)} {
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

void Session::Impl::owe(Ask::What what, bool answer_matters) {
  Ask ask;
  ask.what = what;
  owed = Owed{ask, 1, answer_matters};
}

void Session::Impl::send(const Owed& o) {
  for (const CanFrame& frame : protocol->frames(o.ask)) out.push_back(frame);
  write_at = now + protocol->write_gap();
  if (o.answer_matters && protocol->is_answered(o.ask))
    outstanding = Outstanding{o.ask, now, now + options.reply_timeout, o.attempts};
}

void Session::Impl::pump() {
  for (int i = 0; i < 4 && now >= write_at; ++i) {
    if (owed) {
      send(*std::exchange(owed, std::nullopt));
      continue;
    }
    if (outstanding) return;
    const auto ask = next_ask();
    if (!ask) return;
    send(Owed{*ask});
  }
}

std::optional<Ask> Session::Impl::next_ask() {
  switch (phase) {
    case Phase::Offline:
      return std::nullopt;
    case Phase::Identify:
    case Phase::Recover:
    case Phase::Reference:
      if (now < step_at) return std::nullopt;
      return next_ask_bringing_up();
    case Phase::Stand:
    case Phase::Move:
      return next_ask_at_work();
  }
  return std::nullopt;
}

void Session::Impl::on_answer(const Answer& answer, TimePoint received_at) {
  if (answer.unfinished) {
    outstanding->give_up_at = std::min(outstanding->give_up_at, now + kUnfinishedMax);
    return;
  }
  const Outstanding was = *outstanding;
  outstanding.reset();
  const Duration round_trip = received_at - was.sent_at;
  bus_off = false;
  error_passive = false;
  if (answer.refused) return on_refused(was.ask, answer);
  if (!answer.reads) return on_command_done(was.ask);
  if (phase == Phase::Identify) {
    if (round_trip > round_trip_max() && ++late_reads >= kLateReadsMax) return late_replies(round_trip);
    return on_identity(was.ask, answer);
  }
  const bool sure = is_sure(was.attempts, answer);
  if (answer.shorts) shorts = *answer.shorts;
  if (answer.state) on_state(*answer.state);
  if (answer.position_rad && was.ask.what == Ask::What::Position)
    on_position(*answer.position_rad, was.sent_at, round_trip, sure);
  if (answer.shorts && (shorts & short_state::kError) != 0) state_next = phase == Phase::Stand || phase == Phase::Move;
}

bool Session::Impl::looks_like_position(const Ask& ask) const {
  Ask position;
  position.what = Ask::What::Position;
  return protocol->key(ask) == protocol->key(position);
}

bool Session::Impl::is_sure(int attempts, const Answer& answer) {
  if (!answer.position_rad) return true;
  if (attempts > 1) return false;
  if (doubles == 0 || now >= doubles_until) return true;
  --doubles;
  return false;
}

void Session::Impl::on_unexpected(const Answer& answer) {
  if (!answer.reads) return;  // echoes of commands that waited for none
  if (answer.position_rad && doubles > 0) --doubles;
  if (phase != Phase::Identify || answer.unasked) return;
  if (repeated) return late_replies(options.reply_timeout);
  identify(kQuiet);  // answers to what was asked before: let them pass
}

void Session::Impl::on_no_answer() {
  const Outstanding was = *outstanding;
  outstanding.reset();
  repeated = phase == Phase::Identify;
  if (looks_like_position(was.ask)) {
    ++doubles;
    doubles_until = now + kQuiet;
  }
  if (was.ask.what == Ask::What::Go) {
    if (++setpoints_missed >= kAttemptsMax) return lost();
    setpoint_at = now;  // a fresh one, not the same again: time has passed
    return;
  }
  if (was.attempts >= kAttemptsMax) return lost();
  owed = Owed{was.ask, was.attempts + 1};
}

void Session::Impl::on_refused(const Ask& ask, const Answer& answer) {
  const std::string reason = motion::info_in_words(*answer.refused);
  switch (ask.what) {
    case Ask::What::Identity:
      return on_identity(ask, answer);
    case Ask::What::State:
    case Ask::What::Position:
      ++garbled;
      garbled_text = "its state is refused, " + reason;
      if (phase != Phase::Stand && phase != Phase::Move) lost();
      return;
    case Ask::What::Halt:
    case Ask::What::Reset:
      return;  // its state says how it goes on
    case Ask::What::Home:
      reference_refused = "the module refuses its reference run: " + reason;
      step_at = now;
      return;
    case Ask::What::Prepare:
    case Ask::What::Go:
      state_next = true;  // says more than the refusal, most often
      setpoint_at = now + cycle;
      if (++setpoints_missed < kAttemptsMax) return;
      fail(Failed::Why::MoveRefused, "the module refuses to move: " + reason);
      recover(true);
  }
}

void Session::Impl::on_other_master() {
  const bool in_use = phase == Phase::Stand || phase == Phase::Move || phase == Phase::Reference;
  if (!in_use || options.identify_only) return;
  fail(Failed::Why::ModuleError, formatted("another master commands pivot module %u on this bus: end the other program",
                                           unsigned{options.module_id}));
  recover(true);
}

void Session::Impl::on_blocked(double position) {
  const std::string text = formatted("the axis is blocked at %.2f deg: free it", degrees(position));
  if (phase == Phase::Reference && !home_pending) return reference_failed("reference run failed: " + text);
  if (phase != Phase::Move || !stream) return;
  fail(Failed::Why::MoveRefused, text);
  recover(true);
}

void Session::Impl::on_frame(const CanFrame& frame, TimePoint received_at) {
  if (frame.error) return on_error_frame(frame);
  std::visit(Overloaded{
                 [](const Nothing&) {},
                 [&](const Answer& answer) {
                   if (outstanding && is_answer(*protocol, outstanding->ask, answer))
                     on_answer(answer, received_at);
                   else
                     on_unexpected(answer);
                 },
                 [&](const StateChanged&) { state_next = phase == Phase::Stand || phase == Phase::Move; },
                 [&](const Garbled& news) {
                   ++garbled;
                   garbled_text = news.text;
                 },
                 [&](const ForeignModule& other) { foreign_module = other.id; },
                 [&](const OtherMaster&) { on_other_master(); },
                 [&](const Blocked& blocked) { on_blocked(blocked.position_rad); },
             },
             protocol->hear(frame));
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
  if (outstanding && now >= outstanding->give_up_at) on_no_answer();
  const bool in_use = phase != Phase::Offline && phase != Phase::Identify;
  if (const auto watchdog = protocol->watchdog(); in_use && watchdog && now >= watchdog_at) {
    watchdog_at = now + kWatchdogPeriod;
    out.push_back(*watchdog);
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
  const bool at_work = phase == Phase::Stand || phase == Phase::Move;
  std::optional<TimePoint> at;
  if (phase != Phase::Identify && protocol->watchdog()) at = watchdog_at;
  if (phase == Phase::Reference) at = earlier(at, reference_until);
  if (at_work) at = earlier(at, silent_until());
  if (stream) at = earlier(at, stream->end() + kMoveLateMax);
  if (owed) at = earlier(at, write_at);
  if (outstanding) return earlier(at, outstanding->give_up_at);
  TimePoint next = step_at;
  if (at_work) {
    next = std::min(sample_at, state_at);
    if (halt != Halt::None) next = std::min(next, step_at);
    if (stream) next = std::min(next, setpoint_at);
    if (state_next) next = std::min(next, now);
  }
  return earlier(at, std::max(next, write_at));
}

Session::Session(const Options& options) : impl_{std::make_shared<Impl>(options)} {}

std::vector<link::CanFilter> Session::filters() const { return impl_->protocol->filters(); }

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
  s.owed.reset();
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

std::string Session::state_in_words() const {
  std::string text = pivot::state_in_words(impl_->word);
  if (impl_->word != 0 && (impl_->word & state::kHomeOk) == 0) text = "not referenced, " + text;
  if (impl_->code != 0) text += "; " + motion::error_in_words(impl_->code);
  return text;
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
  s.pump();
}
}  // namespace binpick::drivers::pivot
