#include "plc/core.hpp"

#include <algorithm>

#include "base/check.hpp"
#include "base/log.hpp"

namespace binpick::plc {
namespace {
constexpr Duration kHeartbeatPeriod = std::chrono::milliseconds(500);

Timeouts timeouts_of(const Options& options) { return {options.scan_timeout, options.detect_timeout}; }

PickResult only_code(ResultCode code, std::uint16_t part_id) {
  PickResult result;
  result.code = code;
  result.part_id = part_id;
  return result;
}
}  // namespace

Core::Core(const Options& options, std::uint16_t boot_count, std::span<std::uint16_t> words)
    : options_{options},
      boot_count_{boot_count},
      handshake_{timeouts_of(options)},
      watch_{options.heartbeat_timeout},
      image_{words, options.word_order} {
  refresh();
}

void Core::begin(TimePoint now) {
  if (next_heartbeat_) return;
  next_heartbeat_ = now + kHeartbeatPeriod;
  watch_.begin(now);
}

void Core::set_connected(bool connected, TimePoint now) { watch_.set_connected(connected, now); }

void Core::on_beat(TimePoint now) {
  if (!watch_.on_beat(now)) return;
  alarms_.clear(Alarm::PlcLost);
  alarms_.clear(Alarm::PlcHeartbeatStopped);
  events_.emplace_back(PlcBack{});
}

void Core::lose_plc() {
  watch_.lose();
  alarms_.raise(watch_.connected() ? Alarm::PlcHeartbeatStopped : Alarm::PlcLost);
  events_.emplace_back(PlcLost{});
}

void Core::on_written(std::uint16_t first, std::uint16_t count, TimePoint now) {
  const auto before = seen_;
  std::ranges::copy(image_.request(), seen_.begin());

  if (seen_[at("plc_heartbeat")] != before[at("plc_heartbeat")] || !watch_.heartbeat_watched()) on_beat(now);

  const std::uint16_t changed = seen_[at("control")] ^ before[at("control")];
  if (changed & control::kRobotClear) events_.emplace_back(RobotClearChanged{raised(control::kRobotClear)});
  if (!raised(control::kAbort)) abort_ack_ = false;
  if (raised(control::kAbort) && !abort_ack_) {
    apply(Signal::AbortRaised, now);
    abort_ack_ = true;
  }
  if (!raised(control::kReset)) reset_ack_ = false;
  if (raised(control::kReset) && !reset_ack_) {
    alarms_.reset();
    apply(Signal::ResetRaised, now);
    reset_ack_ = true;
  }
  // The change to the number acknowledges: a number left over from before must not take an answer that is shown again.
  const std::uint16_t result_ack = seen_[at("result_ack")];
  if (result_ack != before[at("result_ack")] && result_ack != 0 && shown_sequence_ == result_ack)
    apply(Signal::ResultAcked, now);

  const bool control_written = first + count > at("control");
  if (control_written && !raised(control::kRequest)) {
    armed_ = seen_low_ = true;
    if (ack_) apply(Signal::RequestDropped, now);
  }
  on_request_level(now);
  settle(now);
}

void Core::on_writer_gone(TimePoint now) {
  // Levels fall with the line that held them. The same request raised again after it is a retry, and harmless; one that
  // stood when we came up still has to be seen 0.
  image_.put(at("control"), word(at("control")) & control::kRobotClear);
  seen_[at("control")] = word(at("control"));
  abort_ack_ = reset_ack_ = false;
  if (seen_low_) armed_ = true;
  if (ack_) apply(Signal::RequestDropped, now);
  settle(now);
}

void Core::on_second_writer(bool there, TimePoint now) {
  if (there)
    alarms_.raise(Alarm::PlcSecondWriter);
  else
    alarms_.clear(Alarm::PlcSecondWriter);
  settle(now);
}

void Core::on_request_level(TimePoint now) {
  if (!raised(control::kRequest)) return;
  asked_ = request_in_words();
  if (asked_.sequence == 0) return;  // "no request"
  if (!seen_low_) {
    if (standing_answered_) return;
    standing_answered_ = true;
    refusal_ = ResultCode::ControllerRestarted;
    apply(Signal::StandingRequest, now);
    return;
  }
  if (!armed_) return;
  armed_ = false;
  apply(classify(asked_), now);
}

Signal Core::classify(const PickRequest& request) {
  const auto bad = [&](ResultCode code) {
    refusal_ = code;
    return Signal::BadRequest;
  };
  // First of all: what was accepted has one answer, whatever else stands.
  if (request.sequence == accepted_.sequence) {
    const bool same = request.part_id == accepted_.part_id && request.supply_id == accepted_.supply_id;
    return same ? Signal::RepeatedRequest : bad(ResultCode::BadSequence);
  }
  if (raised(control::kAbort)) return bad(ResultCode::Aborted);
  if (std::ranges::find(options_.part_ids, request.part_id) == options_.part_ids.end())
    return bad(ResultCode::UnknownPart);
  if (std::ranges::find(options_.supply_ids, request.supply_id) == options_.supply_ids.end())
    return bad(ResultCode::UnknownSupply);
  // While a result is shown a device may be missing without the state saying so.
  if (handshake_.state() == State::ResultValid && device_reasons_ != 0) return bad(ResultCode::NotReady);
  return Signal::NewRequest;
}

void Core::clear_result() {
  image_.clear_result();
  shown_sequence_.reset();
}

void Core::show(const Answer& answer) {
  image_.put_result(answer.request, answer.result, options_.pose_convention);
  shown_sequence_ = answer.request.sequence;
}

void Core::end_cycle(ResultCode code) {
  stored_ = Answer{accepted_, only_code(code, accepted_.part_id)};
  clear_result();
  scan_done_ = false;
}

void Core::log_refusal() {
  // A PLC that asks in every poll is told in the log once, not twenty times a second.
  const std::array<std::uint16_t, 3> refused{static_cast<std::uint16_t>(refusal_), asked_.part_id, asked_.supply_id};
  if (refused == logged_refusal_) return;
  logged_refusal_ = refused;
  BINPICK_LOG(Info, "plc", "request %u (part %u, supply %u) refused: %s", asked_.sequence, asked_.part_id,
              asked_.supply_id, to_string(refusal_).data());
}

void Core::apply(Signal signal, TimePoint now) {
  const Step step = handshake_.apply(signal, now);
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
      acknowledge(asked_.sequence);
      accepted_ = asked_;
      logged_refusal_ = {};
      stored_.reset();
      scan_done_ = false;
      ++cycles_total_;
      events_.emplace_back(RequestAccepted{accepted_});
      break;
    case Effect::RefuseNotReady:
      refusal_ = ResultCode::NotReady;
      [[fallthrough]];
    case Effect::Refuse:
      acknowledge(asked_.sequence);
      show({asked_, only_code(refusal_, asked_.part_id)});
      log_refusal();
      break;
    case Effect::RepeatResult:
      acknowledge(asked_.sequence);
      BINPICK_CHECK(stored_.has_value());
      show(*stored_);
      break;
    case Effect::AckAgain:
      clear_result();  // a refusal of another number, perhaps
      acknowledge(asked_.sequence);
      break;
    case Effect::DropAck:
      ack_ = false;
      break;
    case Effect::StartDetection:
      scan_done_ = true;
      break;
    case Effect::PublishResult:
      stored_ = Answer{accepted_, *published_};
      show(*stored_);
      if (published_->code == ResultCode::PickFound) ++picks_total_;
      break;
    case Effect::ClearResult:
      if (signal == Signal::ResultAcked) events_.emplace_back(ResultAcknowledged{*shown_sequence_});
      if (signal == Signal::AbortRaised) events_.emplace_back(AnswerWithdrawn{});
      clear_result();
      break;
    case Effect::StopAndClear:
      end_cycle(ResultCode::Aborted);
      events_.emplace_back(CycleAborted{});
      break;
    case Effect::TimeOut:
      fault_alarm_ = step.before == State::Detecting                                ? Alarm::DetectTimeout
                     : raised(control::kRobotClear) || !options_.awaits_robot_clear ? Alarm::ScanTimeout
                                                                                    : Alarm::RobotNotClear;
      events_.emplace_back(CycleTimedOut{});
      [[fallthrough]];
    case Effect::RaiseFault:
      alarms_.note(fault_alarm_);
      if (cycle_ran) end_cycle(ResultCode::Fault);
      clear_result();
      scan_done_ = false;
      break;
    case Effect::ClearFault:
      events_.emplace_back(ResetRaised{});
      break;
  }
}

void Core::settle(TimePoint now) {
  if (handshake_.state() == State::NotReady && device_reasons_ == 0 && !starting_) apply(Signal::DevicesReady, now);
  if (handshake_.state() == State::Ready && device_reasons_ != 0) apply(Signal::DevicesMissing, now);
  refresh();
}

void Core::refresh() {
  const State state = handshake_.state();
  const bool busy = state == State::Scanning || state == State::Detecting;
  std::uint16_t bits = 0;
  const auto set = [&](bool on, std::uint16_t bit) { bits = static_cast<std::uint16_t>(bits | (on ? bit : 0)); };
  set(state == State::Ready, status::kReady);
  set(ack_, status::kAck);
  set(busy, status::kBusy);
  set(shown_sequence_.has_value(), status::kResultValid);
  set(scan_done_, status::kScanDone);
  set(state == State::Fault, status::kFault);
  set(abort_ack_, status::kAbortAck);
  set(reset_ack_, status::kResetAck);
  set(alarms_.active(), status::kAlarm);

  unsigned reasons = device_reasons_;
  if (state == State::Fault) reasons |= static_cast<unsigned>(NotReady::Alarm);
  if (busy) reasons |= static_cast<unsigned>(NotReady::CycleRunning);
  if (state == State::ResultValid) reasons |= static_cast<unsigned>(NotReady::ResultPending);
  if (starting_) reasons |= static_cast<unsigned>(NotReady::Starting);

  image_.put(at("map_version"), kMapVersion);
  image_.put(at("map_length"), kMapLength);
  image_.put_long(at("test_f32"), kTestF32);
  image_.put_long(at("test_u32"), kTestU32);
  image_.put(at("boot_count"), boot_count_);
  image_.put(at("cell_heartbeat"), heartbeat_);
  image_.put(at("cell_state"), static_cast<std::uint16_t>(state));
  image_.put(at("status"), bits);
  image_.put(at("ack_sequence"), ack_sequence_);
  image_.put(at("not_ready"), static_cast<std::uint16_t>(reasons));
  image_.put(at("first_alarm"), static_cast<std::uint16_t>(alarms_.first()));
  image_.put(at("alarm_count"), alarms_.count());
  const auto listed = alarms_.listed();
  for (std::uint16_t i = 0; i < listed.size(); ++i)
    image_.put(static_cast<std::uint16_t>(at("alarm_1") + i), static_cast<std::uint16_t>(listed[i]));
  image_.put(at("last_alarm"), static_cast<std::uint16_t>(alarms_.last()));
  image_.put(at("alarms_total"), alarms_.total());
  image_.put(at("picks_total"), picks_total_);
  image_.put(at("cycles_total"), cycles_total_);
  image_.put(at("word_order"), options_.word_order == WordOrder::HighWordFirst ? 0 : 1);
  image_.put(at("pose_convention"), static_cast<std::uint16_t>(options_.pose_convention));
}

void Core::on_deadline(TimePoint now) {
  if (now >= *next_heartbeat_) {
    ++heartbeat_;
    // Never faster to make up for a pause: the PLC would see a burst for what was a standstill.
    *next_heartbeat_ = std::max(*next_heartbeat_, now - kHeartbeatPeriod) + kHeartbeatPeriod;
  }
  if (const auto at = handshake_.deadline(); at && now >= *at) apply(Signal::Deadline, now);
  if (const auto at = watch_.expiry(); at && now >= *at) lose_plc();
  settle(now);
}

std::optional<TimePoint> Core::deadline() const {
  if (!next_heartbeat_) return TimePoint{};
  return earlier(earlier(next_heartbeat_, handshake_.deadline()), watch_.expiry());
}

std::optional<Event> Core::take_event() {
  if (events_.empty()) return std::nullopt;
  Event event = events_.front();
  events_.pop_front();
  return event;
}

void Core::set_not_ready(std::uint16_t device_reasons, TimePoint now) {
  begin(now);
  starting_ = false;
  if (device_reasons_ == device_reasons && handshake_.state() != State::NotReady) return;
  device_reasons_ = device_reasons;
  settle(now);
}

bool Core::robot_clear() const { return raised(control::kRobotClear); }

void Core::on_scan_done(TimePoint now) {
  apply(Signal::ScanComplete, now);
  settle(now);
}

void Core::publish(const PickResult& result, TimePoint now) {
  published_ = result;
  apply(Signal::DetectionDone, now);
  published_.reset();
  settle(now);
}

void Core::fault(Alarm alarm, TimePoint now) {
  BINPICK_LOG(Warning, "plc", "fault: alarm %u, %s", static_cast<unsigned>(alarm), to_string(alarm).data());
  fault_alarm_ = alarm;
  apply(Signal::FaultRaised, now);
  settle(now);
}

void Core::raise(Alarm alarm, TimePoint now) {
  alarms_.raise(alarm);
  settle(now);
}

void Core::clear(Alarm alarm, TimePoint now) {
  alarms_.clear(alarm);
  settle(now);
}

void Core::reconfigure(const Options& options, TimePoint now) {
  // The words lie where they lay and the PLC reads them as it did: what would move them waits for a restart.
  const auto old = options_;
  options_ = options;
  options_.base_address = old.base_address;
  options_.word_order = old.word_order;
  options_.pose_convention = old.pose_convention;
  options_.awaits_robot_clear = old.awaits_robot_clear;
  handshake_.set_timeouts(timeouts_of(options));
  watch_.set_timeout(options.heartbeat_timeout);
  settle(now);
}
}  // namespace binpick::plc
