#pragma once

#include <deque>

/// What a clock's readings and their times of arrival tell of it: messages come late by anything, never early.
namespace binpick {
/// One message: `late_s` is its arrival against what the reading says, `at_s` when (on either clock, from any origin).
struct Arrival {
  double at_s = 0;
  double late_s = 0;
};
struct LowerLine {
  double slope = 0;
  double late_s = 0;  ///< At at_s = 0.
  double at(double at_s) const { return late_s + slope * at_s; }
};

/// The straight line under all arrivals that is nearest to them on average: the edge of their lower convex hull below
/// their mean. Arrivals in order of at_s, at least one. A steeper slope than slope_max is taken for slope_max.
LowerLine line_under(const std::deque<Arrival>& arrivals, double slope_max);
/// The highest line of this slope under all arrivals.
LowerLine line_under_with(const std::deque<Arrival>& arrivals, double slope);
}  // namespace binpick
