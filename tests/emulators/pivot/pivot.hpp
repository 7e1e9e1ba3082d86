#pragma once

#include <cstdint>
#include <deque>
#include <optional>
#include <random>
#include <vector>

#include "base/clock.hpp"
#include "base/units.hpp"
#include "drivers/pivot/codec.hpp"
#include "tests/emulators/faults.hpp"
#include "tests/emulators/pivot/axis.hpp"

namespace binpick::emulators {
struct PivotOptions {
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
};

/// A Schunk PR 70 on its CAN bus: answers PowerCube requests and really turns. Frames in, frames out; no clock.
/// Public sources do not say how a module treats a step that comes while another one runs: both ways can be chosen.
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
  std::uint32_t state_word(TimePoint at) const;
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
  void obey(const drivers::pivot::Request& request, TimePoint now);
  void obey_plain(drivers::pivot::Command command, TimePoint now);
  void obey_move(const drivers::pivot::Move& move, TimePoint now);
  void step(double target, Duration time, TimePoint now);
  void trip(std::uint32_t bits, TimePoint now);
  void reply(const drivers::pivot::Reply& reply, TimePoint now, bool write);
  drivers::pivot::Value value_of(drivers::pivot::Parameter parameter, TimePoint now) const;
  float reported(TimePoint at) const;
  bool may_move() const;
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
  float ramp_velocity_;
  float ramp_acceleration_;
  std::optional<TimePoint> reference_end_;
  std::optional<TimePoint> watchdog_until_;
  TimePoint off_until_ = TimePoint::min();
  std::uint64_t reference_runs_ = 0;
  std::size_t bytes_sent_ = 0;
  std::optional<std::size_t> bytes_limit_;
  TimePoint loose_until_ = TimePoint::min();
  TimePoint now_{};
  std::deque<Due> due_;
  std::vector<drivers::link::CanFrame> out_;
  std::mt19937_64 random_;
};
}  // namespace binpick::emulators
