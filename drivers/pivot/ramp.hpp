#pragma once

#include <array>
#include <cstddef>

/// Motion of one axis under a limit of speed and acceleration: pieces of constant acceleration.
namespace binpick::drivers::pivot {
/// Time-optimal way from a position and speed to standstill at a target. Radians and seconds; time counts from the
/// start, before it and after duration_s() the ends hold.
class Ramp {
 public:
  /// `speed_max` and `acceleration` must be positive.
  static Ramp plan(double from, double speed_from, double target, double speed_max, double acceleration);

  double position(double t_s) const;
  double speed(double t_s) const;
  double duration_s() const { return duration_; }
  double target() const { return target_; }
  double speed_max() const { return speed_max_; }
  double acceleration() const { return acceleration_; }

 private:
  struct Piece {
    double duration = 0, position = 0, speed = 0, acceleration = 0;
  };
  void add(double duration, double acceleration);

  std::array<Piece, 4> pieces_{};
  std::size_t count_ = 0;
  double from_ = 0, speed_from_ = 0, target_ = 0, duration_ = 0, speed_max_ = 0, acceleration_ = 1;
};
}  // namespace binpick::drivers::pivot
