#include <algorithm>
#include <cmath>

#include "base/log.hpp"
#include "drivers/pivot/session_impl.hpp"
#include "drivers/pivot/state_word.hpp"

namespace binpick::drivers::pivot {
namespace {
constexpr Duration kStatePollStanding = 250ms;  ///< Full state word, for what the short state does not say.
constexpr Duration kStatePollMoving = 100ms;
constexpr Duration kSettle = 100ms;              ///< The last set-point is repeated this often, in case it was lost.
constexpr Duration kStoppedReferencePause = 3s;  ///< A stopped reference run is not started again at once.
constexpr double kTargetTolerance_rad = 0.0015;  ///< 0.09 degrees; the axis repeats to 0.02.
constexpr double kAcceleration_rad_s2 = 4.0;     ///< Gentler than most modules can: the scanner rides on the axis.
}  // namespace

void Session::Impl::drop_move() {
  goal.reset();
  stream.reset();
  setpoints_missed = 0;
  accepted_rad.reset();
}

std::optional<Ask> Session::Impl::next_ask_at_work() {
  Ask ask;
  if (halt != Halt::None && now >= step_at) {
    step_at = now + kStatePoll;
    return ask;
  }
  if (stream && now >= setpoint_at)
    if (auto setpoint = next_setpoint()) return setpoint;
  if (std::exchange(state_next, false)) return ask;
  if (now >= sample_at) {
    sample_at = std::max(sample_at + options.sample_period, now + options.sample_period / 2);
    ask.what = Ask::What::Position;
    state_next = !protocol->position_has_state();
    return ask;
  }
  if (now >= state_at) {
    state_at = now + (phase == Phase::Move ? kStatePollMoving : kStatePollStanding);
    return ask;
  }
  return std::nullopt;
}

std::optional<Ask> Session::Impl::next_setpoint() {
  Ask ask;
  if (prepared < protocol->prepare_steps()) {
    ask.what = Ask::What::Prepare;
    ask.step = prepared;
    ask.speed = stream_speed;
    ask.acceleration = stream->acceleration();
    return ask;
  }
  if (last_setpoint_at == TimePoint{}) stream->begin(now);  // preparing took its time
  const bool settled = last_setpoint_at >= stream->end();
  if (last_setpoint_at != TimePoint{} && !settled && now - last_setpoint_at > options.setpoint_horizon) {
    // The module has run out of set-points and stands: going on with the old ramp would be a jump.
    goal = {stream->target(), stream_speed};
    stream.reset();
    setpoint_at = now + cycle;
    return std::nullopt;
  }
  setpoint_at = now + (now >= stream->end() ? kSettle : cycle);
  if ((shorts & short_state::kBufferFull) != 0) return std::nullopt;
  last_setpoint_at = now;
  ask.what = Ask::What::Go;
  ask.to = protocol->setpoint(*stream, now);
  ask.to.position_rad = std::clamp(ask.to.position_rad, module.position_min.in_rad(), module.position_max.in_rad());
  if (!protocol->repeats_setpoints() && accepted_rad == ask.to.position_rad) return std::nullopt;
  return ask;
}

void Session::Impl::start_move(double from, double speed_from) {
  const auto [target, speed] = *goal;
  goal.reset();
  const double acceleration = std::min(module.acceleration_max_rad_s2, kAcceleration_rad_s2);
  const Ramp ramp = Ramp::plan(from, speed_from, target, speed, acceleration);
  stream.emplace(ramp, now, cycle, std::max<Duration>(options.setpoint_horizon, 20ms));
  stream_speed = speed;
  last_setpoint_at = {};
  setpoint_at = now;
  setpoints_missed = 0;
  prepared = 0;
  accepted_rad.reset();
}

void Session::Impl::on_state_at_work() {
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

void Session::Impl::on_state_halting() {
  if ((word & state::kMotion) != 0) return;  // still braking
  if (!goal) phase = Phase::Stand;
  if (halt == Halt::Resetting && (word & state::kHalt) == 0) {
    halt = Halt::None;
    return;
  }
  if (halt == Halt::Stopping || now >= reset_at) {
    halt = Halt::Resetting;
    reset_at = now + kResetPeriod;
    step_at = now + kStatePoll;
    owe(Ask::What::Reset);
  }
}

void Session::Impl::on_position(double position, TimePoint sent_at, Duration round_trip, bool sure) {
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

Duration Session::Impl::round_trip_max() const { return 2 * options.sample_period; }

TimePoint Session::Impl::silent_until() const {
  return clean_sample_at + std::max<Duration>(kAttemptsMax * options.reply_timeout, 10 * options.sample_period) + 50ms;
}

void Session::Impl::move_to(double target, double speed) {
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

void Session::Impl::stop() {
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
    owe(Ask::What::Halt, false);
    return;
  }
  outstanding.reset();  // a HALT waits for no reply; what was asked before may be answered or not
  if (!referencing) {
    halt = Halt::Stopping;
    step_at = now + kStatePoll;
  }
  owe(Ask::What::Halt);
}
}  // namespace binpick::drivers::pivot
