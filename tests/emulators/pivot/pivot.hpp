#pragma once

#include <cstdint>
#include <deque>
#include <optional>
#include <random>
#include <vector>

#include "base/clock.hpp"
#include "base/units.hpp"
#include "drivers/pivot/codec.hpp"
#include "drivers/pivot/motion_codec.hpp"
#include "drivers/pivot/motion_message.hpp"
#include "drivers/pivot/session.hpp"
#include "tests/emulators/faults.hpp"
#include "tests/emulators/pivot/axis.hpp"

namespace binpick::emulators {
struct PivotOptions {
  drivers::pivot::Protocol protocol = drivers::pivot::Protocol::PowerCube;
  std::uint8_t module_id = 12;
  std::uint16_t firmware = 0x3518;
  std::uint32_t serial = 12345678;
  std::uint32_t config_word = drivers::pivot::config_bit::kBrake;
  std::uint32_t setup_word = 0x00000201;  ///< Encoder, CAN.
  Angle position_min = Angle::deg(-160), position_max = Angle::deg(160);
  double velocity_max_rad_s = 2.6;
  double acceleration_max_rad_s2 = 4.0;
  double following_error_max_rad = 0.1;
  double home_velocity_rad_s = 0.8;
  double brake_rad_s2 = 20;      ///< How the axis stops at HALT and when the motor supply goes.
  Angle start = Angle::deg(25);  ///< Where it really stands when it is switched on.
  bool referenced = false;       ///< True: as after an earlier reference run.
  Angle encoder_step = Angle::rad(2 * 3.14159265358979 / (2000.0 * 101.0));  ///< 2000 increments a turn, gear 1:101.
  Angle repeatability = Angle::rad(0);  ///< Spread (1 sd) of the zero that a reference run finds.
  std::uint64_t seed = 1;
  Duration reaction = std::chrono::microseconds(400);  ///< From request to reply; the position is read half-way.
  Duration boot = std::chrono::milliseconds(500);
  Duration watchdog = std::chrono::milliseconds(250);          ///< Used when config_word has the watchdog bit.
  enum class Steps { Replace, Queue } steps = Steps::Replace;  ///< What a step does that comes while another runs.
  // The Motion Protocol alone:
  drivers::pivot::motion::UnitSystem units = drivers::pivot::motion::UnitSystem::Degree;
  /// Reports that an earlier program left on.
  std::optional<drivers::pivot::motion::GetState::Cyclic> cyclic;
  int ok_before_report =
      0;                 ///< Every so many-th GET STATE is answered by a mere OK, as modules in the field do; 0: none.
  bool impulses = true;  ///< 93 and 94 at the end of a move.
  bool fast_stop_is_error = true;  ///< D9 after a FAST STOP; not confirmed by a public source.
  /// Frames that come faster silence it until the supply was off, as real ones are said to be; 0: it bears them.
  Duration hurry{0};
};

/// A Schunk PR 70 on its CAN bus: answers in its protocol and really turns. Frames in, frames out; no clock. What
/// turns, trips and loses its reference is the same in both (pivot.cpp); powercube.cpp and motion.cpp are what they
/// say. Public sources do not say how a module treats a step that comes while another one runs: both ways can be
/// chosen.
class Pivot {
 public:
  explicit Pivot(const PivotOptions& options = {});

  void on_frame(const drivers::link::CanFrame& frame, TimePoint now);
  void on_deadline(TimePoint now);
  std::optional<TimePoint> deadline() const;
  std::vector<drivers::link::CanFrame> take_frames();

  /// Where the axis really stands; the last ten seconds, and ahead as far as it is planned.
  Angle angle_at(TimePoint at) const { return Angle::rad(axis_.position(at)); }
  double speed_at(TimePoint at) const { return axis_.speed(at); }
  bool moving(TimePoint at) const { return axis_.moving(at); }
  std::uint32_t state_word(TimePoint at) const;  ///< In the bits of state_word.hpp, whatever it speaks.
  bool referenced() const { return home_ok_; }
  std::uint64_t reference_runs() const { return reference_runs_; }

  /// What the commissioning tool writes into the module: its soft limits.
  void limit_to(Angle min, Angle max) { options_.position_min = min, options_.position_max = max; }

  /// 24 V off and on again: the position counter starts at zero, the reference is lost.
  void power_cycle(TimePoint now, Duration off = std::chrono::milliseconds(200));

  Faults faults;
  bool home_switch_broken = false;  ///< A reference run then ends at the hard stop.

 private:
  struct Due {
    TimePoint at;
    drivers::link::CanFrame frame;
  };
  void update(TimePoint now);
  void update_bus();
  void end_reference_run(TimePoint now);
  // What it does, whoever asks.
  void halt(TimePoint now);
  void reset();
  bool start_reference_run(TimePoint now);
  void trip(std::uint32_t bits, TimePoint now);
  std::uint32_t error_bits() const;  ///< Of faults.error_code.
  double reported(TimePoint at) const;
  bool may_move() const;
  double clamped(double target) const;  ///< Inside the soft limits, as a real angle.
  void send_in_time(const drivers::link::CanFrame& frame, TimePoint now);
  // PowerCube.
  void obey(const drivers::pivot::Request& request, TimePoint now);
  void obey_plain(drivers::pivot::Command command, TimePoint now);
  void obey_move(const drivers::pivot::Move& move, TimePoint now);
  void step(double target, Duration time, TimePoint now);
  void reply(const drivers::pivot::Reply& reply, TimePoint now, bool write);
  drivers::pivot::Value value_of(drivers::pivot::Parameter parameter, TimePoint now) const;
  // Motion Protocol.
  void on_motion_frame(const drivers::link::CanFrame& frame, TimePoint now);
  void obey_motion(const drivers::pivot::motion::Request& request, TimePoint now);
  void obey_motion_plain(drivers::pivot::motion::Command command, TimePoint now);
  void obey_motion_move(const drivers::pivot::motion::MovePosition& move, TimePoint now);
  void update_motion(TimePoint now);
  std::optional<TimePoint> motion_deadline() const;
  std::uint8_t motion_error(TimePoint now) const;
  drivers::pivot::motion::Reply motion_value(drivers::pivot::motion::ConfigItem item) const;
  drivers::pivot::motion::StateReport report(std::uint8_t mode, TimePoint now) const;
  void say(const drivers::pivot::motion::Reply& reply, TimePoint now);
  void send_due(TimePoint now);
  void corrupt(drivers::link::CanFrame& frame);

  PivotOptions options_;
  Axis axis_;
  double zero_rad_;  ///< Real angle of the reported position zero.
  bool home_ok_;
  bool halted_ = false;
  bool moved_ = false;           ///< Any motion since power-up; the ramp-finished bit needs one.
  std::uint32_t latched_ = 0;    ///< Error bits until RESET.
  bool stopped_before_ = false;  ///< Emergency stop as last seen.
  bool bus_off_before_ = false;
  double ramp_velocity_;
  double ramp_acceleration_;
  std::optional<TimePoint> reference_end_;
  std::optional<TimePoint> watchdog_until_;
  TimePoint off_until_ = TimePoint::min();
  std::uint64_t reference_runs_ = 0;
  std::size_t bytes_sent_ = 0;
  std::optional<std::size_t> bytes_limit_;
  TimePoint loose_until_ = TimePoint::min();
  TimePoint now_{};
  // Motion Protocol.
  drivers::pivot::motion::Assembler assembler_;
  std::optional<drivers::pivot::motion::GetState::Cyclic> cyclic_;
  TimePoint report_at_{};
  std::uint8_t mode_ = drivers::pivot::motion::report_mode::kAll;  ///< Of the last request that named one.
  int states_asked_ = 0;
  std::uint8_t latched_code_ = 0;  ///< What exactly tripped it.
  std::uint8_t told_error_ = 0;    ///< The error that was told last.
  TimePoint error_again_at_{};
  std::optional<TimePoint> arrives_at_;  ///< End of the move that ends with an impulse.
  TimePoint heard_at_ = TimePoint::min();
  bool hurried_ = false;
  std::deque<Due> due_;
  std::vector<drivers::link::CanFrame> out_;
  std::mt19937_64 random_;
};
}  // namespace binpick::emulators
