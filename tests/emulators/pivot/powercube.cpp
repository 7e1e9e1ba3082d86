#include <algorithm>
#include <cmath>

#include "drivers/pivot/state_word.hpp"
#include "tests/emulators/pivot/pivot.hpp"

/// The emulated module as PowerCube shows it.
namespace binpick::emulators {
using namespace drivers::pivot;

Value Pivot::value_of(Parameter parameter, TimePoint now) const {
  const TimePoint read_at = now + options_.reaction / 2;
  const auto f32 = [](double v) { return static_cast<float>(v); };
  switch (parameter) {
    case Parameter::SerialNumber:
      return {parameter, options_.serial};
    case Parameter::Firmware:
      return {parameter, options_.firmware};
    case Parameter::StateWord:
      return {parameter, state_word(read_at)};
    case Parameter::Config:
      return {parameter, options_.config_word};
    case Parameter::Setup:
      return {parameter, options_.setup_word};
    case Parameter::Position:
      return {parameter, f32(reported(read_at))};
    case Parameter::PositionAndState:
      return {parameter, PositionReport{static_cast<float>(reported(read_at)), to_short_state(state_word(read_at)), 0}};
    case Parameter::FollowingErrorMax:
      return {parameter, f32(options_.following_error_max_rad)};
    case Parameter::Velocity:
      return {parameter, f32(axis_.speed(read_at))};
    case Parameter::PositionMin:
      return {parameter, f32(options_.position_min.in_rad())};
    case Parameter::PositionMax:
      return {parameter, f32(options_.position_max.in_rad())};
    case Parameter::VelocityMax:
      return {parameter, f32(options_.velocity_max_rad_s)};
    case Parameter::AccelerationMax:
      return {parameter, f32(options_.acceleration_max_rad_s2)};
    case Parameter::CurrentMax:
      return {parameter, 8.0F};
    case Parameter::Current:
      return {parameter, axis_.moving(read_at) ? 1.0F : 0.0F};
    case Parameter::RampVelocity:
      return {parameter, f32(ramp_velocity_)};
    case Parameter::RampAcceleration:
      return {parameter, f32(ramp_acceleration_)};
    case Parameter::HomeOffset:
      return {parameter, 0.0F};
    case Parameter::HomeVelocity:
      return {parameter, f32(options_.home_velocity_rad_s)};
  }
  return {parameter, 0.0F};
}

void Pivot::step(double target, Duration time, TimePoint now) {
  const double seconds = std::max(in_s(time), 1e-3);
  const double speed = (target - axis_.position(now)) / seconds;
  const double jump = std::abs(speed - axis_.speed(now));
  // A motor that accelerates as hard as it can lags behind a jump of speed by so much.
  const double lag = jump * jump / (2 * options_.acceleration_max_rad_s2);
  const bool queue = options_.steps == PivotOptions::Steps::Queue && axis_.moving(now);
  if (!queue && (lag > options_.following_error_max_rad || std::abs(speed) > 1.5 * options_.velocity_max_rad_s))
    return trip(state::kTow, now);
  moved_ = true;
  if (queue)
    axis_.queue_line(target, time, now);
  else
    axis_.line_to(target, time, now);
}

void Pivot::obey_move(const Move& move, TimePoint now) {
  if (!may_move()) return;
  const double value = static_cast<double>(move.value);
  const double real = clamped(value);
  switch (move.motion) {
    case Motion::Step:
    case Motion::StepExtended:
      return step(real, std::chrono::milliseconds(move.time_ms), now);
    case Motion::Ramp:
    case Motion::RampExtended:
      moved_ = true;
      return axis_.ramp_to(real, ramp_velocity_, ramp_acceleration_, now);
    case Motion::Velocity:
    case Motion::VelocityExtended: {
      moved_ = true;
      const double speed = std::min(std::abs(value), options_.velocity_max_rad_s);
      if (speed < 1e-6) return axis_.brake(ramp_acceleration_, now);
      const Angle end = value > 0 ? options_.position_max : options_.position_min;
      return axis_.ramp_to(clamped(end.in_rad()), speed, ramp_acceleration_, now);
    }
    case Motion::Current:
    case Motion::CurrentExtended:
      return;  // no load is emulated that a torque could move
  }
}

void Pivot::obey_plain(Command command, TimePoint now) {
  if (command == Command::Halt) halt(now);
  if (command == Command::Reset) reset();
  if (command == Command::Home) start_reference_run(now);
}

void Pivot::reply(const Reply& reply, TimePoint now, bool write) {
  if (write && (options_.config_word & config_bit::kSuppressAcknowledge) != 0) return;
  send_in_time(encode(options_.module_id, reply), now);
}

void Pivot::obey(const Request& request, TimePoint now) {
  if (const auto* get = std::get_if<Get>(&request)) {
    if (get->parameter == Parameter::PositionAndState && !has_position_and_state(options_.firmware)) return;
    return reply(value_of(get->parameter, now), now, false);
  }
  if (const auto* set = std::get_if<Set>(&request)) {
    if (const auto* number = std::get_if<float>(&set->value)) {
      if (set->parameter == Parameter::RampVelocity)
        ramp_velocity_ = std::clamp(static_cast<double>(*number), 0.001, options_.velocity_max_rad_s);
      if (set->parameter == Parameter::RampAcceleration)
        ramp_acceleration_ = std::clamp(static_cast<double>(*number), 0.001, options_.acceleration_max_rad_s2);
    }
    return reply(SetDone{set->parameter}, now, true);
  }
  if (const auto* plain = std::get_if<Plain>(&request)) {
    obey_plain(plain->command, now);
    return reply(PlainDone{plain->command}, now, true);
  }
  if (const auto* move = std::get_if<Move>(&request)) {
    obey_move(*move, now);
    MoveAccepted accepted{move->motion, std::nullopt};
    if (is_extended(move->motion)) {
      const TimePoint read_at = now + options_.reaction / 2;
      accepted.report = PositionReport{static_cast<float>(reported(read_at)), to_short_state(state_word(read_at)), 0};
    }
    return reply(accepted, now, !is_extended(move->motion));
  }
  if (std::get<Broadcast>(request).command == Command::Watchdog && (options_.config_word & config_bit::kWatchdog) != 0)
    watchdog_until_ = now + options_.watchdog;
}

}  // namespace binpick::emulators
