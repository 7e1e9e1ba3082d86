#include "plc/session.hpp"

#include <algorithm>
#include <array>
#include <deque>

#include "base/check.hpp"
#include "base/log.hpp"
#include "plc/alarm_list.hpp"
#include "plc/modbus_server.hpp"
#include "plc/register_image.hpp"

namespace binpick::plc {
namespace {
constexpr Duration kHeartbeatPeriod = std::chrono::milliseconds(500);
/// Without a heartbeat watch, this long without any connection means that the PLC is gone.
constexpr Duration kUnconnectedMax = std::chrono::seconds(3);

modbus::Limits limits_of(const Options& options) {
  const auto base = options.base_address;
  return {base, kMapLength, static_cast<std::uint16_t>(base + kRequestFirst), kRequestLength};
}

Timeouts timeouts_of(const Options& options) { return {options.scan_timeout, options.detect_timeout}; }

/// An answer as the result block shows it.
struct Answer {
  PickRequest request;
  PickResult result;
};

PickResult only_code(ResultCode code, std::uint16_t part_id) {
  PickResult result;
  result.code = code;
  result.part_id = part_id;
  return result;
}
}  // namespace

struct Session::Impl {
  Impl(const Options& opts, std::uint16_t boot)
      : options{opts},
        boot_count{boot},
        handshake{timeouts_of(opts)},
        server{{opts.allow, opts.connections_max},
               limits_of(opts),
               {[this](modbus::WrittenRange range, TimePoint now) { on_written(range, now); },
                [this](TimePoint now) { on_writer_gone(now); },
                [this](const std::string&, TimePoint now) { on_second_writer(true, now); },
                [this](TimePoint now) { on_second_writer(false, now); }}},
        image{server.words().subspan(opts.base_address), opts.word_order} {
    BINPICK_CHECK(std::size_t{opts.base_address} + kMapLength <= 65536);  // the cell file's key table sees to it
    refresh();
  }
  Impl(const Impl&) = delete;
  Impl& operator=(const Impl&) = delete;

  std::uint16_t word(std::uint16_t offset) const { return image.word(offset); }

  // What the PLC wrote.
  void on_written(modbus::WrittenRange range, TimePoint now);
  void on_writer_gone(TimePoint now);
  void on_second_writer(bool there, TimePoint now);
  void on_request_level(TimePoint now);
  Signal classify(const PickRequest& request);
  bool raised(std::uint16_t bit) const { return (word(at("control")) & bit) != 0; }
  PickRequest request_in_words() const { return {word(at("sequence")), word(at("part_id")), word(at("supply_id"))}; }

  // The handshake.
  void apply(Signal signal, TimePoint now);
  void settle(TimePoint now);
  void acknowledge(std::uint16_t sequence) { ack = true, ack_sequence = sequence; }
  void show(const Answer& answer);
  void clear_result();
  void end_cycle(ResultCode code);
  void log_refusal();

  // The watch on the PLC.
  void begin(TimePoint now);
  void on_beat(TimePoint now);
  std::optional<TimePoint> plc_expiry() const;
  void lose_plc();

  void refresh();

  Options options;
  std::uint16_t boot_count;
  Handshake handshake;
  modbus::Server server;
  RegisterImage image;
  AlarmList alarms;
  std::deque<Event> events;

  std::array<std::uint16_t, kRequestLength> seen{};  // request block as last looked at
  bool armed = false;                                // request was seen 0 since it was last answered
  bool seen_low = false;                             // request was seen 0 since the start
  bool standing_answered = false;
  bool ack = false, abort_ack = false, reset_ack = false, scan_done = false;
  std::uint16_t ack_sequence = 0;
  PickRequest asked;                              // the request being answered
  std::array<std::uint16_t, 3> logged_refusal{};  // code, part, supply
  ResultCode refusal = ResultCode::None;          // why Refuse
  PickRequest accepted;                           // the last one accepted; sequence 0: none
  std::optional<Answer> stored;                   // its answer, once there is one
  std::optional<PickResult> published;            // on its way into PublishResult
  Alarm fault_alarm = Alarm::None;                // on its way into RaiseFault
  std::optional<std::uint16_t> shown_sequence;    // the result block is valid for it

  std::uint16_t device_reasons = 0;
  bool starting = true;
  std::uint16_t heartbeat = 0, picks_total = 0, cycles_total = 0;

  std::optional<TimePoint> next_heartbeat;  // nullopt: no time was given yet
  TimePoint last_beat{};
  TimePoint unconnected_since{};
  bool plc_lost = false;
};

void Session::Impl::begin(TimePoint now) {
  if (next_heartbeat) return;
  next_heartbeat = now + kHeartbeatPeriod;
  last_beat = now;
  unconnected_since = now;
}

void Session::Impl::on_beat(TimePoint now) {
  last_beat = now;
  if (!plc_lost) return;
  plc_lost = false;
  alarms.clear(Alarm::PlcLost);
  alarms.clear(Alarm::PlcHeartbeatStopped);
  events.emplace_back(PlcBack{});
}

std::optional<TimePoint> Session::Impl::plc_expiry() const {
  if (plc_lost || !next_heartbeat) return std::nullopt;
  if (options.heartbeat_timeout.count() > 0) return last_beat + options.heartbeat_timeout;
  if (server.connections() == 0) return unconnected_since + kUnconnectedMax;
  return std::nullopt;
}

void Session::Impl::lose_plc() {
  plc_lost = true;
  const Alarm alarm = server.connections() == 0 ? Alarm::PlcLost : Alarm::PlcHeartbeatStopped;
  alarms.raise(alarm);
  events.emplace_back(PlcLost{});
}

void Session::Impl::on_written(modbus::WrittenRange range, TimePoint now) {
  const auto first = static_cast<std::uint16_t>(range.first - options.base_address);
  const auto before = seen;
  std::ranges::copy(image.request(), seen.begin());

  if (seen[at("plc_heartbeat")] != before[at("plc_heartbeat")] || options.heartbeat_timeout.count() == 0) on_beat(now);

  const std::uint16_t changed = seen[at("control")] ^ before[at("control")];
  if (changed & control::kRobotClear) events.emplace_back(RobotClearChanged{raised(control::kRobotClear)});
  if (!raised(control::kAbort)) abort_ack = false;
  if (raised(control::kAbort) && !abort_ack) {
    apply(Signal::AbortRaised, now);
    abort_ack = true;
  }
  if (!raised(control::kReset)) reset_ack = false;
  if (raised(control::kReset) && !reset_ack) {
    alarms.reset();
    apply(Signal::ResetRaised, now);
    reset_ack = true;
  }
  // The change to the number acknowledges: a number left over from before must not take an answer that is shown again.
  const std::uint16_t result_ack = seen[at("result_ack")];
  if (result_ack != before[at("result_ack")] && result_ack != 0 && shown_sequence == result_ack)
    apply(Signal::ResultAcked, now);

  const bool control_written = first + range.count > at("control");
  if (control_written && !raised(control::kRequest)) {
    armed = seen_low = true;
    if (ack) apply(Signal::RequestDropped, now);
  }
  on_request_level(now);
  settle(now);
}

void Session::Impl::on_writer_gone(TimePoint now) {
  // Levels fall with the line that held them. The same request raised again after it is a retry, and harmless; one that
  // stood when we came up still has to be seen 0.
  image.put(at("control"), word(at("control")) & control::kRobotClear);
  seen[at("control")] = word(at("control"));
  abort_ack = reset_ack = false;
  if (seen_low) armed = true;
  if (ack) apply(Signal::RequestDropped, now);
  settle(now);
}

void Session::Impl::on_second_writer(bool there, TimePoint now) {
  if (there)
    alarms.raise(Alarm::PlcSecondWriter);
  else
    alarms.clear(Alarm::PlcSecondWriter);
  settle(now);
}

void Session::Impl::on_request_level(TimePoint now) {
  if (!raised(control::kRequest)) return;
  asked = request_in_words();
  if (asked.sequence == 0) return;  // "no request"
  if (!seen_low) {
    if (standing_answered) return;
    standing_answered = true;
    refusal = ResultCode::ControllerRestarted;
    apply(Signal::StandingRequest, now);
    return;
  }
  if (!armed) return;
  armed = false;
  apply(classify(asked), now);
}

Signal Session::Impl::classify(const PickRequest& request) {
  const auto bad = [&](ResultCode code) {
    refusal = code;
    return Signal::BadRequest;
  };
  // First of all: what was accepted has one answer, whatever else stands.
  if (request.sequence == accepted.sequence) {
    const bool same = request.part_id == accepted.part_id && request.supply_id == accepted.supply_id;
    return same ? Signal::RepeatedRequest : bad(ResultCode::BadSequence);
  }
  if (raised(control::kAbort)) return bad(ResultCode::Aborted);
  if (std::ranges::find(options.part_ids, request.part_id) == options.part_ids.end())
    return bad(ResultCode::UnknownPart);
  if (std::ranges::find(options.supply_ids, request.supply_id) == options.supply_ids.end())
    return bad(ResultCode::UnknownSupply);
  // While a result is shown a device may be missing without the state saying so.
  if (handshake.state() == State::ResultValid && device_reasons != 0) return bad(ResultCode::NotReady);
  return Signal::NewRequest;
}

void Session::Impl::clear_result() {
  image.clear_result();
  shown_sequence.reset();
}

void Session::Impl::show(const Answer& answer) {
  image.put_result(answer.request, answer.result, options.pose_convention);
  shown_sequence = answer.request.sequence;
}

void Session::Impl::end_cycle(ResultCode code) {
  stored = Answer{accepted, only_code(code, accepted.part_id)};
  clear_result();
  scan_done = false;
}

void Session::Impl::log_refusal() {
  // A PLC that asks in every poll is told in the log once, not twenty times a second.
  const std::array<std::uint16_t, 3> refused{static_cast<std::uint16_t>(refusal), asked.part_id, asked.supply_id};
  if (refused == logged_refusal) return;
  logged_refusal = refused;
  BINPICK_LOG(Info, "plc", "request %u (part %u, supply %u) refused: %s", asked.sequence, asked.part_id,
              asked.supply_id, to_string(refusal).data());
}

void Session::Impl::apply(Signal signal, TimePoint now) {
  const Step step = handshake.apply(signal, now);
  if (!step.expected) {
    BINPICK_LOG(Debug, "plc", "%s in state %s: nothing to do", to_string(signal).data(), to_string(step.before).data());
    return;
  }
  const bool cycle_ran = step.before == State::Scanning || step.before == State::Detecting;
  switch (step.effect) {
    case Effect::None:
      break;
    case Effect::AcceptAndScan:
      clear_result();
      acknowledge(asked.sequence);
      accepted = asked;
      logged_refusal = {};
      stored.reset();
      scan_done = false;
      ++cycles_total;
      events.emplace_back(RequestAccepted{accepted});
      break;
    case Effect::RefuseNotReady:
      refusal = ResultCode::NotReady;
      [[fallthrough]];
    case Effect::Refuse:
      acknowledge(asked.sequence);
      show({asked, only_code(refusal, asked.part_id)});
      log_refusal();
      break;
    case Effect::RepeatResult:
      acknowledge(asked.sequence);
      BINPICK_CHECK(stored.has_value());
      show(*stored);
      break;
    case Effect::AckAgain:
      clear_result();  // a refusal of another number, perhaps
      acknowledge(asked.sequence);
      break;
    case Effect::DropAck:
      ack = false;
      break;
    case Effect::StartDetection:
      scan_done = true;
      break;
    case Effect::PublishResult:
      stored = Answer{accepted, *published};
      show(*stored);
      if (published->code == ResultCode::PickFound) ++picks_total;
      break;
    case Effect::ClearResult:
      if (signal == Signal::ResultAcked) events.emplace_back(ResultAcknowledged{*shown_sequence});
      if (signal == Signal::AbortRaised) events.emplace_back(AnswerWithdrawn{});
      clear_result();
      break;
    case Effect::StopAndClear:
      end_cycle(ResultCode::Aborted);
      events.emplace_back(CycleAborted{});
      break;
    case Effect::TimeOut:
      fault_alarm = step.before == State::Detecting ? Alarm::DetectTimeout
                    : raised(control::kRobotClear)  ? Alarm::ScanTimeout
                                                    : Alarm::RobotNotClear;
      events.emplace_back(CycleTimedOut{});
      [[fallthrough]];
    case Effect::RaiseFault:
      alarms.note(fault_alarm);
      if (cycle_ran) end_cycle(ResultCode::Fault);
      clear_result();
      scan_done = false;
      break;
    case Effect::ClearFault:
      events.emplace_back(ResetRaised{});
      break;
  }
}

void Session::Impl::settle(TimePoint now) {
  if (handshake.state() == State::NotReady && device_reasons == 0 && !starting) apply(Signal::DevicesReady, now);
  if (handshake.state() == State::Ready && device_reasons != 0) apply(Signal::DevicesMissing, now);
  refresh();
}

void Session::Impl::refresh() {
  const State state = handshake.state();
  const bool busy = state == State::Scanning || state == State::Detecting;
  std::uint16_t bits = 0;
  const auto set = [&](bool on, std::uint16_t bit) { bits = static_cast<std::uint16_t>(bits | (on ? bit : 0)); };
  set(state == State::Ready, status::kReady);
  set(ack, status::kAck);
  set(busy, status::kBusy);
  set(shown_sequence.has_value(), status::kResultValid);
  set(scan_done, status::kScanDone);
  set(state == State::Fault, status::kFault);
  set(abort_ack, status::kAbortAck);
  set(reset_ack, status::kResetAck);
  set(alarms.active(), status::kAlarm);

  unsigned reasons = device_reasons;
  if (state == State::Fault) reasons |= static_cast<unsigned>(NotReady::Alarm);
  if (busy) reasons |= static_cast<unsigned>(NotReady::CycleRunning);
  if (state == State::ResultValid) reasons |= static_cast<unsigned>(NotReady::ResultPending);
  if (starting) reasons |= static_cast<unsigned>(NotReady::Starting);

  image.put(at("map_version"), kMapVersion);
  image.put(at("map_length"), kMapLength);
  image.put_long(at("test_f32"), kTestF32);
  image.put_long(at("test_u32"), kTestU32);
  image.put(at("boot_count"), boot_count);
  image.put(at("cell_heartbeat"), heartbeat);
  image.put(at("cell_state"), static_cast<std::uint16_t>(state));
  image.put(at("status"), bits);
  image.put(at("ack_sequence"), ack_sequence);
  image.put(at("not_ready"), static_cast<std::uint16_t>(reasons));
  image.put(at("first_alarm"), static_cast<std::uint16_t>(alarms.first()));
  image.put(at("alarm_count"), alarms.count());
  const auto listed = alarms.listed();
  for (std::uint16_t i = 0; i < listed.size(); ++i)
    image.put(static_cast<std::uint16_t>(at("alarm_1") + i), static_cast<std::uint16_t>(listed[i]));
  image.put(at("last_alarm"), static_cast<std::uint16_t>(alarms.last()));
  image.put(at("alarms_total"), alarms.total());
  image.put(at("picks_total"), picks_total);
  image.put(at("cycles_total"), cycles_total);
  image.put(at("word_order"), options.word_order == WordOrder::HighWordFirst ? 0 : 1);
  image.put(at("pose_convention"), static_cast<std::uint16_t>(options.pose_convention));
}

Session::Session(const Options& options, std::uint16_t boot_count)
    : impl_{std::make_unique<Impl>(options, boot_count)} {}
Session::~Session() = default;
Session::Session(Session&&) noexcept = default;
Session& Session::operator=(Session&&) noexcept = default;

bool Session::on_accept(ConnectionId id, const std::string& address, std::uint16_t port, TimePoint now) {
  impl_->begin(now);
  return impl_->server.on_accept(id, address, port, now);
}

void Session::on_bytes(ConnectionId id, ByteView bytes, TimePoint now) {
  impl_->begin(now);
  impl_->server.on_bytes(id, bytes, now);
}

void Session::on_closed(ConnectionId id, TimePoint now) {
  impl_->begin(now);
  impl_->server.on_closed(id, now);
  if (impl_->server.connections() == 0) impl_->unconnected_since = now;
}

Bytes Session::take_output(ConnectionId id) { return impl_->server.take_output(id); }
bool Session::wants_close(ConnectionId id) const { return impl_->server.wants_close(id); }

void Session::on_deadline(TimePoint now) {
  impl_->begin(now);
  impl_->server.on_deadline(now);
  if (now >= *impl_->next_heartbeat) {
    ++impl_->heartbeat;
    // Never faster to make up for a pause: the PLC would see a burst for what was a standstill.
    *impl_->next_heartbeat = std::max(*impl_->next_heartbeat, now - kHeartbeatPeriod) + kHeartbeatPeriod;
  }
  if (const auto at = impl_->handshake.deadline(); at && now >= *at) impl_->apply(Signal::Deadline, now);
  if (const auto at = impl_->plc_expiry(); at && now >= *at) impl_->lose_plc();
  impl_->settle(now);
}

std::optional<TimePoint> Session::deadline() const {
  if (!impl_->next_heartbeat) return TimePoint{};
  return earlier(earlier(impl_->next_heartbeat, impl_->handshake.deadline()),
                 earlier(impl_->plc_expiry(), impl_->server.deadline()));
}

std::optional<Event> Session::take_event() {
  if (impl_->events.empty()) return std::nullopt;
  Event event = impl_->events.front();
  impl_->events.pop_front();
  return event;
}

void Session::set_not_ready(std::uint16_t device_reasons, TimePoint now) {
  impl_->begin(now);
  impl_->starting = false;
  if (impl_->device_reasons == device_reasons && impl_->handshake.state() != State::NotReady) return;
  impl_->device_reasons = device_reasons;
  impl_->settle(now);
}

bool Session::robot_clear() const { return impl_->raised(control::kRobotClear); }

void Session::on_scan_done(TimePoint now) {
  impl_->apply(Signal::ScanComplete, now);
  impl_->settle(now);
}

void Session::publish(const PickResult& result, TimePoint now) {
  impl_->published = result;
  impl_->apply(Signal::DetectionDone, now);
  impl_->published.reset();
  impl_->settle(now);
}

void Session::fault(Alarm alarm, TimePoint now) {
  BINPICK_LOG(Warning, "plc", "fault: alarm %u, %s", static_cast<unsigned>(alarm), to_string(alarm).data());
  impl_->fault_alarm = alarm;
  impl_->apply(Signal::FaultRaised, now);
  impl_->settle(now);
}

void Session::raise(Alarm alarm, TimePoint now) {
  impl_->alarms.raise(alarm);
  impl_->settle(now);
}

void Session::clear(Alarm alarm, TimePoint now) {
  impl_->alarms.clear(alarm);
  impl_->settle(now);
}

void Session::reconfigure(const Options& options, TimePoint now) {
  // The words lie where they lay and the PLC reads them as it did: what would move them waits for a restart.
  const auto old = impl_->options;
  impl_->options = options;
  impl_->options.base_address = old.base_address;
  impl_->options.word_order = old.word_order;
  impl_->options.pose_convention = old.pose_convention;
  impl_->handshake.set_timeouts(timeouts_of(options));
  impl_->server.set_options({options.allow, options.connections_max});
  impl_->settle(now);
}

State Session::state() const { return impl_->handshake.state(); }

std::uint16_t Session::register_at(std::uint16_t offset) const {
  BINPICK_CHECK(offset < kMapLength);
  return impl_->word(offset);
}
}  // namespace binpick::plc
