#include "tests/emulators/pivot/pivot.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "drivers/pivot/motion_errors.hpp"
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

/// Of its maxima that a module begins with; the Motion Protocol's manual says 10 %.
double start_share(const PivotOptions& options) { return options.protocol == Protocol::Motion ? 0.1 : 1.0; }

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
      ramp_velocity_{start_share(options) * options.velocity_max_rad_s},
      ramp_acceleration_{start_share(options) * options.acceleration_max_rad_s2},
      cyclic_{options.cyclic},
      random_{options.seed} {}

std::uint32_t Pivot::state_word(TimePoint at) const {
  std::uint32_t word = latched_;
  if (faults.emergency_stop) word |= state::kError | state::kPowerFault | state::kMotorVoltage;
  word |= error_bits();
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

std::uint32_t Pivot::error_bits() const {
  if (!faults.error_code) return 0;
  if (options_.protocol == Protocol::PowerCube) return state::kError | *faults.error_code;
  return motion::error_bits(static_cast<std::uint8_t>(*faults.error_code));
}

void Pivot::halt(TimePoint now) {
  halted_ = options_.protocol == Protocol::PowerCube || options_.fast_stop_is_error;
  reference_end_.reset();
  axis_.brake(options_.brake_rad_s2, now);
}

void Pivot::reset() {
  if (faults.emergency_stop || faults.error_code) return;
  latched_ = 0;
  halted_ = false;
}

bool Pivot::start_reference_run(TimePoint now) {
  if (halted_ || latched_ != 0 || faults.emergency_stop || faults.error_code) return false;
  ++reference_runs_;
  home_ok_ = false;
  moved_ = true;
  axis_.ramp_to(home_switch_broken ? kHardStop_rad : 0.0, options_.home_velocity_rad_s,
                options_.acceleration_max_rad_s2, now);
  reference_end_ = axis_.leg_end(now) + kReferenceSettle;
  return true;
}

double Pivot::clamped(double target) const {
  return std::clamp(target, options_.position_min.in_rad(), options_.position_max.in_rad()) + zero_rad_;
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
  if ((latched_ & error_bits()) != error_bits()) trip(error_bits(), now);
  if (watchdog_until_ && now >= *watchdog_until_) {
    watchdog_until_.reset();
    if (axis_.moving(now)) {
      halted_ = true;
      trip(state::kWatchdog, now);
    }
  }
  if (options_.protocol == Protocol::Motion) update_motion(now);
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
  cyclic_.reset();
  arrives_at_.reset();
  hurried_ = false;
  ramp_velocity_ = start_share(options_) * options_.velocity_max_rad_s;
  ramp_acceleration_ = start_share(options_) * options_.acceleration_max_rad_s2;
  if (options_.protocol == Protocol::Motion) say(motion::Info{motion::info_code::kBoot}, off_until_);
}

double Pivot::reported(TimePoint at) const {
  const double step = options_.encoder_step.in_rad();
  const double exact = axis_.position(at) - zero_rad_;
  return step > 0 ? std::round(exact / step) * step : exact;
}

void Pivot::on_frame(const CanFrame& frame, TimePoint now) {
  update(now);
  if (faults.bus_off) {
    out_.push_back(error_frame(0x040));
    return;
  }
  if (faults.unplugged || now < loose_until_ || now < off_until_) return;
  if (options_.protocol == Protocol::Motion) return on_motion_frame(frame, now);
  if (const auto request = decode_request(options_.module_id, frame)) obey(*request, now);
}

void Pivot::send_in_time(const CanFrame& frame, TimePoint now) {
  due_.push_back(Due{now + options_.reaction + faults.delay, frame});
  std::ranges::stable_sort(due_, {}, &Due::at);
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
  if (options_.protocol == Protocol::Motion) at = earlier(at, motion_deadline());
  return at;
}

std::vector<CanFrame> Pivot::take_frames() {
  update_bus();
  return std::exchange(out_, {});
}
}  // namespace binpick::emulators
