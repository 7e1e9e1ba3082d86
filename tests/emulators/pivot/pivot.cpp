#include "tests/emulators/pivot/pivot.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "drivers/pivot/state_word.hpp"

namespace binpick::emulators {
using namespace drivers::pivot;
namespace {
using namespace std::chrono_literals;
using drivers::link::CanFrame;

constexpr double kHardStop_rad = 170.0 * std::numbers::pi / 180.0;
constexpr Duration kTick = 10ms;  // while it moves, faults are looked for this often
constexpr Duration kReferenceSettle = 50ms;
constexpr Duration kLoose = 1s;  // how long a connector stays open after disconnect_after_bytes
constexpr double kHomeSwitch_rad = 0.02;

CanFrame error_frame(std::uint32_t classes) {
  CanFrame frame;
  frame.error = true;
  frame.id = classes;
  frame.length = 8;
  return frame;
}
}  // namespace

Pivot::Pivot(const PivotOptions& options)
    : options_{options},
      axis_{options.start.in_rad()},
      zero_rad_{options.referenced ? 0.0 : options.start.in_rad()},
      home_ok_{options.referenced},
      moved_{options.referenced},
      ramp_velocity_{static_cast<float>(options.velocity_max_rad_s)},
      ramp_acceleration_{static_cast<float>(options.acceleration_max_rad_s2)},
      random_{options.seed} {}

std::uint32_t Pivot::state_word(TimePoint at) const {
  std::uint32_t word = latched_;
  if (faults.emergency_stop) word |= state::kError | state::kPowerFault | state::kMotorVoltage;
  if (faults.error_code) word |= state::kError | *faults.error_code;
  if (home_ok_) word |= state::kHomeOk;
  if (halted_) word |= state::kHalt;
  if (std::abs(axis_.position(at)) < kHomeSwitch_rad) word |= state::kHomeSwitch;
  const bool moves = axis_.moving(at);
  if (moves) {
    word |= state::kMotion;
    const double faster = std::abs(axis_.speed(at + 1ms)) - std::abs(axis_.speed(at));
    if (axis_.in_line(at))
      word |= state::kStepInProgress;
    else if (faster > 1e-6)
      word |= state::kRampAccelerating;
    else if (faster < -1e-6)
      word |= state::kRampDecelerating;
    else
      word |= state::kRampSteady;
  } else if (moved_ && !reference_end_) {
    word |= state::kRampEnd;
  }
  if (axis_.queued(at)) word |= state::kStepBufferFull;
  const bool braked = halted_ || (word & (state::kFaults)) != 0;
  if (braked && !moves && (options_.config_word & config_bit::kBrake) != 0) word |= state::kBrake;
  return word;
}

bool Pivot::may_move() const {
  return !halted_ && home_ok_ && !reference_end_ && latched_ == 0 && !faults.emergency_stop && !faults.error_code;
}

void Pivot::trip(std::uint32_t bits, TimePoint now) {
  latched_ |= bits | state::kError;
  reference_end_.reset();
  axis_.brake(options_.brake_rad_s2, now);
}

void Pivot::update_bus() {
  if (faults.bus_off && !bus_off_before_) out_.push_back(error_frame(0x040));
  if (!faults.bus_off && bus_off_before_) out_.push_back(error_frame(0x100));
  bus_off_before_ = faults.bus_off;
  if (bytes_limit_ != faults.disconnect_after_bytes) {
    bytes_limit_ = faults.disconnect_after_bytes;
    bytes_sent_ = 0;
  }
}

void Pivot::update(TimePoint now) {
  now_ = std::max(now_, now);
  update_bus();
  if (reference_end_ && now >= *reference_end_) end_reference_run(now);
  if (faults.emergency_stop && !stopped_before_) trip(state::kPowerFault | state::kMotorVoltage, now);
  if (!faults.emergency_stop && stopped_before_)
    latched_ &= ~state::kMotorVoltage;  // the voltage is back; the rest stays
  stopped_before_ = faults.emergency_stop;
  if (faults.error_code && (latched_ & *faults.error_code) != *faults.error_code) trip(*faults.error_code, now);
  if (watchdog_until_ && now >= *watchdog_until_) {
    watchdog_until_.reset();
    if (axis_.moving(now)) {
      halted_ = true;
      trip(state::kWatchdog, now);
    }
  }
}

void Pivot::end_reference_run(TimePoint now) {
  reference_end_.reset();
  if (home_switch_broken) return trip(state::kHardLimit, now);
  std::normal_distribution<double> spread{0.0, 1.0};
  zero_rad_ = axis_.position(now) + options_.repeatability.in_rad() * spread(random_);
  home_ok_ = true;
}

void Pivot::power_cycle(TimePoint now, Duration off) {
  update(now);
  axis_.brake(options_.brake_rad_s2, now);
  off_until_ = now + off + options_.boot;
  zero_rad_ = axis_.position(off_until_);
  home_ok_ = halted_ = moved_ = false;
  latched_ = 0;
  reference_end_.reset();
  watchdog_until_.reset();
  due_.clear();
}

float Pivot::reported(TimePoint at) const {
  const double step = options_.encoder_step.in_rad();
  const double exact = axis_.position(at) - zero_rad_;
  return static_cast<float>(step > 0 ? std::round(exact / step) * step : exact);
}

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
      return {parameter, reported(read_at)};
    case Parameter::PositionAndState:
      return {parameter, PositionReport{reported(read_at), to_short_state(state_word(read_at)), 0}};
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
      return {parameter, ramp_velocity_};
    case Parameter::RampAcceleration:
      return {parameter, ramp_acceleration_};
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
  const double min = options_.position_min.in_rad();
  const double max = options_.position_max.in_rad();
  const double value = static_cast<double>(move.value);
  const double real = std::clamp(value, min, max) + zero_rad_;
  const double acceleration = static_cast<double>(ramp_acceleration_);
  switch (move.motion) {
    case Motion::Step:
    case Motion::StepExtended:
      return step(real, std::chrono::milliseconds(move.time_ms), now);
    case Motion::Ramp:
    case Motion::RampExtended:
      moved_ = true;
      return axis_.ramp_to(real, static_cast<double>(ramp_velocity_), acceleration, now);
    case Motion::Velocity:
    case Motion::VelocityExtended: {
      moved_ = true;
      const double speed = std::min(std::abs(value), options_.velocity_max_rad_s);
      if (speed < 1e-6) return axis_.brake(acceleration, now);
      return axis_.ramp_to((value > 0 ? max : min) + zero_rad_, speed, acceleration, now);
    }
    case Motion::Current:
    case Motion::CurrentExtended:
      return;  // no load is emulated that a torque could move
  }
}

void Pivot::obey_plain(Command command, TimePoint now) {
  if (command == Command::Halt) {
    halted_ = true;
    reference_end_.reset();
    axis_.brake(options_.brake_rad_s2, now);
  } else if (command == Command::Reset) {
    if (faults.emergency_stop || faults.error_code) return;
    latched_ = 0;
    halted_ = false;
  } else if (command == Command::Home) {
    if (halted_ || latched_ != 0 || faults.emergency_stop || faults.error_code) return;
    ++reference_runs_;
    home_ok_ = false;
    moved_ = true;
    axis_.ramp_to(home_switch_broken ? kHardStop_rad : 0.0, options_.home_velocity_rad_s,
                  options_.acceleration_max_rad_s2, now);
    reference_end_ = axis_.leg_end(now) + kReferenceSettle;
  }
}

void Pivot::reply(const Reply& reply, TimePoint now, bool write) {
  if (write && (options_.config_word & config_bit::kSuppressAcknowledge) != 0) return;
  due_.push_back(Due{now + options_.reaction + faults.delay, encode(options_.module_id, reply)});
  std::ranges::stable_sort(due_, {}, &Due::at);
}

void Pivot::obey(const Request& request, TimePoint now) {
  if (const auto* get = std::get_if<Get>(&request)) {
    if (get->parameter == Parameter::PositionAndState && !has_position_and_state(options_.firmware)) return;
    return reply(value_of(get->parameter, now), now, false);
  }
  if (const auto* set = std::get_if<Set>(&request)) {
    if (const auto* number = std::get_if<float>(&set->value)) {
      if (set->parameter == Parameter::RampVelocity)
        ramp_velocity_ = std::clamp(*number, 0.001F, static_cast<float>(options_.velocity_max_rad_s));
      if (set->parameter == Parameter::RampAcceleration)
        ramp_acceleration_ = std::clamp(*number, 0.001F, static_cast<float>(options_.acceleration_max_rad_s2));
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
      accepted.report = PositionReport{reported(read_at), to_short_state(state_word(read_at)), 0};
    }
    return reply(accepted, now, !is_extended(move->motion));
  }
  if (std::get<Broadcast>(request).command == Command::Watchdog && (options_.config_word & config_bit::kWatchdog) != 0)
    watchdog_until_ = now + options_.watchdog;
}

void Pivot::on_frame(const CanFrame& frame, TimePoint now) {
  update(now);
  if (faults.bus_off) {
    out_.push_back(error_frame(0x040));
    return;
  }
  if (faults.unplugged || now < loose_until_ || now < off_until_) return;
  if (const auto request = decode_request(options_.module_id, frame)) obey(*request, now);
}

void Pivot::corrupt(CanFrame& frame) {
  for (int flips = 1 + static_cast<int>(random_() % 3); flips > 0; --flips) {
    const std::size_t at = random_() % std::max<std::size_t>(frame.length, 1);
    frame.payload[at] = static_cast<std::uint8_t>(frame.payload[at] ^ (1 + random_() % 255));
  }
}

void Pivot::send_due(TimePoint now) {
  while (!due_.empty() && due_.front().at <= now) {
    CanFrame frame = due_.front().frame;
    due_.pop_front();
    if (faults.silent || faults.unplugged || faults.bus_off || now < loose_until_) continue;
    if (faults.garbage) corrupt(frame);
    if (faults.wrong_id) ++frame.id;
    bytes_sent_ += frame.length;
    if (bytes_limit_ && bytes_sent_ > *bytes_limit_) {
      bytes_limit_.reset();
      faults.disconnect_after_bytes.reset();
      loose_until_ = now + kLoose;
      continue;
    }
    out_.push_back(frame);
  }
}

void Pivot::on_deadline(TimePoint now) {
  update(now);
  send_due(now);
}

std::optional<TimePoint> Pivot::deadline() const {
  std::optional<TimePoint> at;
  if (!due_.empty()) at = due_.front().at;
  if (reference_end_) at = earlier(at, reference_end_);
  if (watchdog_until_) at = earlier(at, watchdog_until_);
  if (axis_.moving(now_)) at = earlier(at, now_ + kTick);
  return at;
}

std::vector<CanFrame> Pivot::take_frames() {
  update_bus();
  return std::exchange(out_, {});
}
}  // namespace binpick::emulators
