#include <algorithm>
#include <cmath>
#include <utility>

#include "base/overloaded.hpp"
#include "drivers/pivot/motion_errors.hpp"
#include "drivers/pivot/state_word.hpp"
#include "tests/emulators/pivot/pivot.hpp"

/// The emulated module as the Motion Protocol shows it.
namespace binpick::emulators {
using namespace drivers::pivot;
namespace {
using namespace std::chrono_literals;
using drivers::link::CanFrame;
namespace info = motion::info_code;

constexpr Duration kErrorAgain = 15s;
constexpr double kLimitRounding_rad = 1e-4;  // a soft limit as it comes back from a float in degrees
}  // namespace

void Pivot::say(const motion::Reply& reply, TimePoint now) {
  const auto* trouble = std::get_if<motion::Trouble>(&reply);
  const std::uint32_t base = trouble != nullptr ? motion::kErrorBase : motion::kReplyBase;
  for (const CanFrame& frame : frames_of(base + options_.module_id, encode(reply, options_.units)))
    send_in_time(frame, now);
}

std::uint8_t Pivot::motion_error(TimePoint now) const {
  const std::uint32_t faults_now = state_word(now) & state::kFaults;
  if (faults.error_code) return static_cast<std::uint8_t>(*faults.error_code);
  if (faults_now != 0)
    return latched_code_ != 0 && !faults.emergency_stop ? latched_code_ : motion::error_code(faults_now);
  return halted_ ? motion::kFastStopped : std::uint8_t{0};
}

void Pivot::update_motion(TimePoint now) {
  if (now < off_until_) return;
  if (latched_ == 0) latched_code_ = 0;
  if (faults.error_code) latched_code_ = static_cast<std::uint8_t>(*faults.error_code);
  const std::uint8_t error = motion_error(now);
  if (error != 0 && (error != told_error_ || now >= error_again_at_)) {
    error_again_at_ = now + kErrorAgain;
    say(motion::Trouble{motion::Command::Error, error}, now);
  }
  told_error_ = error;
  if (error != 0) arrives_at_.reset();
  if (arrives_at_ && now >= *arrives_at_) {
    arrives_at_.reset();
    if (options_.impulses) say(motion::Impulse{motion::Command::PositionReached, reported(now)}, now);
  }
  if (cyclic_ && now >= report_at_) {
    report_at_ = now + from_s(cyclic_->period_s);
    say(report(cyclic_->mode, now), now);
  }
}

std::optional<TimePoint> Pivot::motion_deadline() const {
  std::optional<TimePoint> at = arrives_at_;
  if (cyclic_) at = earlier(at, std::max(report_at_, off_until_));
  if (told_error_ != 0) at = earlier(at, error_again_at_);
  return at;
}

motion::StateReport Pivot::report(std::uint8_t mode, TimePoint now) const {
  namespace bit = motion::state_byte;
  const TimePoint read_at = now + options_.reaction / 2;
  motion::StateReport report;
  if ((mode & motion::report_mode::kPosition) != 0) report.position_rad = reported(read_at);
  if ((mode & motion::report_mode::kVelocity) != 0) report.velocity_rad_s = axis_.speed(read_at);
  if ((mode & motion::report_mode::kCurrent) != 0) report.current_a = axis_.moving(read_at) ? 1.0F : 0.0F;
  report.error = motion_error(read_at);
  const bool moves = axis_.moving(read_at) || reference_end_.has_value();
  const auto set = [&report](bool condition, std::uint8_t value) {
    if (condition) report.state = static_cast<std::uint8_t>(report.state | value);
  };
  set(home_ok_, bit::kReferenced);
  set(moves, bit::kMoving);
  set(report.error != 0, bit::kError);
  set(report.error != 0 && !moves, bit::kBrake);
  set(moved_ && !moves, bit::kMoveEnd);
  set(moved_ && !moves && report.error == 0, bit::kPositionReached);
  return report;
}

motion::Reply Pivot::motion_value(motion::ConfigItem item) const {
  using motion::ConfigItem;
  const auto number = [this](ConfigItem which) -> double {
    switch (which) {
      case ConfigItem::PositionMin:
        return options_.position_min.in_rad();
      case ConfigItem::PositionMax:
        return options_.position_max.in_rad();
      case ConfigItem::VelocityMax:
        return options_.velocity_max_rad_s;
      default:
        return options_.acceleration_max_rad_s2;
    }
  };
  switch (item) {
    case ConfigItem::ModuleId:
      return motion::ConfigValue{item, std::uint32_t{options_.module_id}};
    case ConfigItem::UnitSystem:
      return motion::ConfigValue{item, static_cast<std::uint32_t>(options_.units)};
    case ConfigItem::SerialNumber:
      return motion::ConfigValue{item, options_.serial};
    case ConfigItem::OrderNumber:
      return motion::ConfigValue{item, std::uint32_t{307330}};
    default:
      return motion::ConfigValue{item, number(item)};
  }
}

void Pivot::on_motion_frame(const CanFrame& frame, TimePoint now) {
  if (frame.extended || frame.rtr || frame.error || frame.id != motion::kCommandBase + options_.module_id) return;
  const TimePoint before = std::exchange(heard_at_, now);
  if (options_.hurry > Duration{0} && before != TimePoint::min() && now - before < options_.hurry) hurried_ = true;
  if (hurried_) return;
  const auto message = assembler_.take(frame);
  if (!message) {
    if (message.error().kind != DecodeError::Kind::BadFragment)
      return say(motion::Refused{message.error().what, info::kMessageLength}, now);
    trip(state::kCommunication, now);
    return update_motion(now);
  }
  if (!*message) return;
  const auto request = decode_request(**message, options_.units);
  if (request) return obey_motion(*request, now);
  using Kind = DecodeError::Kind;
  const Kind kind = request.error().kind;
  say(motion::Refused{(*message)->command, kind == Kind::UnknownCommand ? info::kUnknownCommand
                                           : kind == Kind::BadLength    ? info::kMessageLength
                                                                        : info::kWrongParameter},
      now);
}

void Pivot::obey_motion(const motion::Request& request, TimePoint now) {
  std::visit(Overloaded{
                 [&](const motion::GetConfig& get) {
                   if (get.item) return say(motion_value(*get.item), now);
                   say(motion::ModuleType{"PR-70", 307330, options_.firmware, 1, 1, "May 21 2012 10:11:12"}, now);
                 },
                 [&](const motion::GetState& get) {
                   if (get.cyclic) {
                     mode_ = get.cyclic->mode;
                     cyclic_ = get.cyclic->period_s > 0 ? get.cyclic : std::nullopt;
                     if (cyclic_) report_at_ = now + from_s(cyclic_->period_s);
                   }
                   if (options_.ok_before_report > 0 && ++states_asked_ % options_.ok_before_report == 0)
                     return say(motion::Done{motion::Command::GetState}, now);
                   say(report(mode_, now), now);
                 },
                 [&](const motion::SetTarget& set) {
                   const bool speed = set.command == motion::Command::SetTargetVelocity;
                   const double most = speed ? options_.velocity_max_rad_s : options_.acceleration_max_rad_s2;
                   if (!(set.value > 0) || set.value > most * (1 + 1e-5))
                     return say(motion::Refused{static_cast<std::uint8_t>(set.command), info::kWrongParameter}, now);
                   (speed ? ramp_velocity_ : ramp_acceleration_) = std::min(set.value, most);
                   say(motion::Done{set.command}, now);
                 },
                 [&](const motion::MovePosition& move) { obey_motion_move(move, now); },
                 [&](const motion::Plain& plain) { obey_motion_plain(plain.command, now); },
             },
             request);
  update_motion(now);
}

void Pivot::obey_motion_move(const motion::MovePosition& move, TimePoint now) {
  const auto refuse = [&](std::uint8_t code) {
    say(motion::Refused{static_cast<std::uint8_t>(motion::Command::MovePosition), code}, now);
  };
  if (!home_ok_) return refuse(info::kNotReferenced);
  if (!may_move()) return refuse(info::kFailed);
  const double real = clamped(move.position_rad);
  if (std::abs(real - zero_rad_ - move.position_rad) > kLimitRounding_rad) return refuse(info::kWrongParameter);
  if (move.velocity_rad_s) ramp_velocity_ = std::clamp(*move.velocity_rad_s, 1e-3, options_.velocity_max_rad_s);
  if (move.acceleration_rad_s2)
    ramp_acceleration_ = std::clamp(*move.acceleration_rad_s2, 1e-3, options_.acceleration_max_rad_s2);
  moved_ = true;
  axis_.ramp_to(real, ramp_velocity_, ramp_acceleration_, now);
  arrives_at_ = axis_.leg_end(now);
  say(motion::MoveTime{static_cast<float>(in_s(*arrives_at_ - now))}, now);
}

void Pivot::obey_motion_plain(motion::Command command, TimePoint now) {
  using motion::Command;
  const auto done = [&] { say(motion::Done{command}, now); };
  switch (command) {
    case Command::Acknowledge:
      reset();
      done();
      if (motion_error(now) == 0) say(motion::Info{info::kNoError}, now);
      return;
    case Command::FastStop:
      halt(now);
      arrives_at_.reset();
      return done();
    case Command::Stop:
      reference_end_.reset();
      arrives_at_.reset();
      axis_.brake(ramp_acceleration_, now);
      return done();
    case Command::Reference:
      if (!start_reference_run(now))
        return say(motion::Refused{static_cast<std::uint8_t>(command), info::kFailed}, now);
      arrives_at_ = reference_end_;
      return done();
    case Command::Reboot:
      done();
      return power_cycle(now, 0ms);
    default:
      return done();
  }
}
}  // namespace binpick::emulators
