#pragma once

#include <compare>
#include <numbers>

namespace binpick {
/// A length. The unit is named wherever a number goes in or comes out: Length::mm(3).in_m().
class Length {
 public:
  constexpr Length() = default;
  static constexpr Length mm(double v) { return Length{v}; }
  static constexpr Length m(double v) { return Length{v * 1e3}; }
  constexpr double in_mm() const { return mm_; }
  constexpr double in_m() const { return mm_ * 1e-3; }
  friend constexpr auto operator<=>(Length, Length) = default;

 private:
  explicit constexpr Length(double millimetres) : mm_{millimetres} {}
  double mm_ = 0;
};

/// An angle, not normalised, counter-clockwise positive.
class Angle {
 public:
  constexpr Angle() = default;
  static constexpr Angle rad(double v) { return Angle{v}; }
  static constexpr Angle deg(double v) { return Angle{v * std::numbers::pi / 180.0}; }
  constexpr double in_rad() const { return rad_; }
  constexpr double in_deg() const { return rad_ * 180.0 / std::numbers::pi; }
  friend constexpr auto operator<=>(Angle, Angle) = default;
  friend constexpr Angle operator+(Angle a, Angle b) { return Angle{a.rad_ + b.rad_}; }
  friend constexpr Angle operator-(Angle a, Angle b) { return Angle{a.rad_ - b.rad_}; }
  friend constexpr Angle operator*(double k, Angle a) { return Angle{k * a.rad_}; }
  friend constexpr Angle operator-(Angle a) { return Angle{-a.rad_}; }

 private:
  explicit constexpr Angle(double radians) : rad_{radians} {}
  double rad_ = 0;
};
}  // namespace binpick
