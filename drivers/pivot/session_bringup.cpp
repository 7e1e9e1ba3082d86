#include <algorithm>
#include <array>
#include <cmath>

#include "base/log.hpp"
#include "drivers/pivot/session_impl.hpp"
#include "drivers/pivot/state_word.hpp"

namespace binpick::drivers::pivot {
namespace {
constexpr Duration kResetSettle = 100ms;  ///< Between RESET and the next look at the state.
constexpr Duration kStatePollPassive = 500ms;
constexpr double kLimitMin = 1e-3, kLimitMax = 1e4;  ///< rad, rad/s, rad/s²: no pivot has limits beyond.
constexpr Duration kBrakingMax = 500ms;              ///< Until an axis that still moves is halted once more.
}  // namespace

std::optional<Ask> Session::Impl::next_ask_bringing_up() {
  Ask ask;
  switch (phase) {
    case Phase::Identify:
      ask.step = identity_index;
      if (identity_index < protocol->identity_steps()) ask.what = Ask::What::Identity;
      return ask;
    case Phase::Recover:
      if (std::exchange(halt_first, false)) {
        ask.what = Ask::What::Halt;
        return ask;
      }
      step_at = now + kResetSettle;
      return ask;
    case Phase::Reference:
      step_at = now + kStatePoll;
      if (!std::exchange(home_pending, false)) return ask;
      BINPICK_LOG(Info, "pivot", "reference run");
      ask.what = Ask::What::Home;
      return ask;
    default:
      return std::nullopt;
  }
}

void Session::Impl::fail_by_state(Failed::Why otherwise) {
  const bool power = (word & state::kMotorSupply) != 0;
  fail(power ? Failed::Why::PowerFault : otherwise, "pivot: " + faults_in_words(ModuleState{word, code}));
}

Failed::Why Session::Impl::why_so_far() const {
  const bool keep = failed == Failed::Why::ReferenceFailed || failed == Failed::Why::MoveRefused;
  return keep ? *failed : Failed::Why::ModuleError;
}

void Session::Impl::be_ready() {
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

void Session::Impl::identify(Duration pause) {
  owed.reset();
  if (phase == Phase::Move || phase == Phase::Reference) owe(Ask::What::Halt, false);
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

void Session::Impl::recover(bool with_halt) {
  phase = Phase::Recover;
  drop_move();
  halt = Halt::None;
  halt_first = with_halt;
  step_at = now;
  reset_at = now;
}

void Session::Impl::reference() {
  phase = Phase::Reference;
  drop_move();
  halt = Halt::None;
  home_pending = true;
  reference_refused.clear();
  step_at = std::max(now, reference_not_before);
  reference_until = step_at + options.reference_timeout;
}

void Session::Impl::reference_failed(const std::string& text) {
  fail(Failed::Why::ReferenceFailed, text);
  static constexpr std::array<Duration, 3> kPauses{1s, 10s, 30s};
  reference_not_before = now + kPauses[std::min<std::size_t>(static_cast<std::size_t>(references_failed), 2)];
  ++references_failed;
  recover(true);
}

void Session::Impl::go_on_from_state() {
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

void Session::Impl::lost() {
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
         formatted("pivot module %u does not answer: check its 24 V logic supply, the CAN cable, the bit rate, "
                   "pivot.module_id and pivot.protocol",
                   id));
  }
  garbled = 0;
  identify(kProbePause);
}

void Session::Impl::late_replies(Duration round_trip) {
  fail(Failed::Why::NoReply,
       formatted(
           "pivot module %u answers too late (%.0f ms or more): positions would be wrong; check bus load and adapter",
           unsigned{options.module_id}, in_ms(round_trip)));
  identify(kQuiet);
}

void Session::Impl::on_identity(const Ask& ask, const Answer& answer) {
  if (ask.what == Ask::What::Identity) {
    protocol->learn(ask.step, answer);
    ++identity_index;
    return;
  }
  if (!answer.state) return;
  word = answer.state->word;
  code = answer.state->code;
  if (std::exchange(repeated, false)) {
    step_at = now + kQuiet;  // once more, when late answers would have come
    return;
  }
  on_identified();
}

void Session::Impl::on_identified() {
  identity_index = 0;
  shorts = to_short_state(word);
  module = protocol->module();
  identified = true;
  if (const std::string problem = module_problem(); !problem.empty()) {
    fail(Failed::Why::ModuleError, problem);
    return identify(kQuiet);
  }
  if (!std::exchange(seen_before, true))
    BINPICK_LOG(Info, "pivot", "module %u%s%s: firmware %04X, serial %u, %.1f to %.1f deg, at most %.0f deg/s; %s",
                unsigned{options.module_id}, module.type.empty() ? "" : ", ", module.type.c_str(),
                unsigned{module.firmware}, module.serial, module.position_min.in_deg(), module.position_max.in_deg(),
                degrees(module.velocity_max_rad_s), pivot::state_in_words(word).c_str());
  watchdog_at = now;
  if (!options.identify_only) return go_on_from_state();
  if (!std::exchange(told_identity, true) || failed) tell(Ready{module});
  failed.reset();
  identity_index = protocol->identity_steps();  // the state again and again, and nothing else
  step_at = now + kStatePollPassive;
}

std::string Session::Impl::module_problem() const {
  if (std::string problem = protocol->problem(); !problem.empty()) return problem;
  const auto is_limit = [](double value) { return value >= kLimitMin && value <= kLimitMax; };
  const auto is_angle = [](Angle angle) { return std::abs(angle.in_rad()) <= kLimitMax; };
  if (!(module.position_min < module.position_max) || !is_angle(module.position_min) ||
      !is_angle(module.position_max) || !is_limit(module.velocity_max_rad_s) ||
      !is_limit(module.acceleration_max_rad_s2))
    return formatted(
        "the module's limits make no sense (%.3f to %.3f rad, %.3f rad/s, %.3f rad/s2): set them with the "
        "vendor's tool",
        module.position_min.in_rad(), module.position_max.in_rad(), module.velocity_max_rad_s,
        module.acceleration_max_rad_s2);
  return {};
}

void Session::Impl::on_command_done(const Ask& ask) {
  if (ask.what == Ask::What::Prepare) ++prepared;
  if (ask.what == Ask::What::Go) {
    setpoints_missed = 0;
    accepted_rad = ask.to.position_rad;
  }
  if (phase == Phase::Recover) step_at = now + (ask.what == Ask::What::Reset ? kResetSettle : Duration{0});
}

void Session::Impl::on_state(const ModuleState& heard) {
  word = heard.word;
  code = heard.code;
  shorts = to_short_state(word);
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

void Session::Impl::on_state_recovering() {
  if ((word & state::kMotion) != 0 && (word & state::kFaults) == 0 && (word & state::kHalt) == 0) {
    step_at = now + kStatePoll;  // still braking
    halt_first = now >= reset_at + kBrakingMax;
    if (halt_first) reset_at = now;
    return;
  }
  if ((word & (state::kFaults | state::kHalt)) == 0) return go_on_from_state();
  if ((word & state::kFaults) != 0) fail_by_state(why_so_far());
  if (now >= reset_at) {
    reset_at = now + kResetPeriod;
    step_at = now + kResetSettle;
    owe(Ask::What::Reset);
  }
}

void Session::Impl::on_state_referencing() {
  if ((word & state::kFaults) != 0) {
    if ((word & state::kMotorSupply) == 0)
      return reference_failed("reference run failed: " + faults_in_words(ModuleState{word, code}));
    fail_by_state(Failed::Why::PowerFault);
    return recover(true);
  }
  if ((word & state::kHalt) != 0) return home_pending ? recover(false) : reference_failed("reference run was halted");
  if (!reference_refused.empty()) return reference_failed(reference_refused);
  constexpr std::uint32_t kDone = state::kHomeOk | state::kRampEnd;
  if (!home_pending && (word & kDone) == kDone && (word & state::kMotion) == 0) be_ready();
}
}  // namespace binpick::drivers::pivot
