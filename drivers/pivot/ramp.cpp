#include "drivers/pivot/ramp.hpp"

#include <algorithm>
#include <cmath>

namespace binpick::drivers::pivot {
void Ramp::add(double duration, double acceleration) {
  if (duration <= 0 || count_ == pieces_.size()) return;
  Piece piece{duration, from_, speed_from_, acceleration};
  if (count_ > 0) {
    const Piece& last = pieces_[count_ - 1];
    piece.position =
        last.position + last.speed * last.duration + 0.5 * last.acceleration * last.duration * last.duration;
    piece.speed = last.speed + last.acceleration * last.duration;
  }
  pieces_[count_++] = piece;
  duration_ += duration;
}

Ramp Ramp::plan(double from, double speed_from, double target, double speed_max, double acceleration) {
  Ramp ramp;
  ramp.from_ = from;
  ramp.speed_from_ = speed_from;
  ramp.target_ = target;
  ramp.speed_max_ = speed_max;
  ramp.acceleration_ = acceleration;
  // Where it would stand if it braked now decides the direction of the way.
  const double stop_at = from + speed_from * std::abs(speed_from) / (2 * acceleration);
  const double sign = target >= stop_at ? 1.0 : -1.0;
  const double v0 = sign * speed_from;  // seen along the way; may be negative (turn round) or above speed_max
  const double way = sign * (target - from);
  const double peak =
      std::min(speed_max, std::sqrt(std::max(0.0, acceleration * way + 0.5 * v0 * v0)));  // without a steady piece
  ramp.add((peak - v0) / acceleration, sign * acceleration);                              // peak above v0
  ramp.add((v0 - peak) / acceleration, -sign * acceleration);                             // too fast: slow down first
  const double used = std::abs(peak - v0) * (peak + v0) / (2 * acceleration) + peak * peak / (2 * acceleration);
  if (peak > 0) ramp.add((way - used) / peak, 0);
  ramp.add(peak / acceleration, -sign * acceleration);
  return ramp;
}

double Ramp::position(double t_s) const {
  if (t_s <= 0) return from_;
  for (std::size_t i = 0; i < count_; ++i) {
    const Piece& piece = pieces_[i];
    if (t_s < piece.duration) return piece.position + piece.speed * t_s + 0.5 * piece.acceleration * t_s * t_s;
    t_s -= piece.duration;
  }
  return target_;
}

double Ramp::speed(double t_s) const {
  if (t_s < 0) return speed_from_;
  for (std::size_t i = 0; i < count_; ++i) {
    if (t_s < pieces_[i].duration) return pieces_[i].speed + pieces_[i].acceleration * t_s;
    t_s -= pieces_[i].duration;
  }
  return 0;
}
}  // namespace binpick::drivers::pivot
