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
}

std::optional<Request> Session::Impl::next_request_at_work() {
  if (halt != Halt::None && now >= step_at) {
    step_at = now + kStatePoll;
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
    send(Plain{Command::Reset});
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
    out.push_back(encode(options.module_id, Plain{Command::Halt}));
    return;
  }
  outstanding.reset();  // a HALT waits for no reply; what was asked before may be answered or not
  if (!referencing) {
    halt = Halt::Stopping;
    step_at = now + kStatePoll;
  }
  send(Plain{Command::Halt});
}
}  // namespace binpick::drivers::pivot
