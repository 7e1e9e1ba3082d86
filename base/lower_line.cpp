#include "base/lower_line.hpp"

#include <algorithm>
#include <vector>

namespace binpick {
LowerLine line_under_with(const std::deque<Arrival>& arrivals, double slope) {
  // Heights are taken at the newest arrival: at_s may be hours, and a slope's rounding would show.
  const double newest_s = arrivals.back().at_s;
  double lowest = arrivals.back().late_s;
  for (const Arrival& a : arrivals) lowest = std::min(lowest, a.late_s - slope * (a.at_s - newest_s));
  return {slope, lowest - slope * newest_s};
}

LowerLine line_under(const std::deque<Arrival>& arrivals, double slope_max) {
  std::vector<Arrival> hull;
  double mean_s = 0;
  for (const Arrival& a : arrivals) {
    mean_s += a.at_s - arrivals.front().at_s;
    const auto turns_down = [&] {
      const Arrival &p = hull[hull.size() - 2], &q = hull.back();
      return (q.late_s - p.late_s) * (a.at_s - p.at_s) >= (a.late_s - p.late_s) * (q.at_s - p.at_s);
    };
    while (hull.size() >= 2 && turns_down()) hull.pop_back();
    hull.push_back(a);
  }
  if (hull.size() < 2) return line_under_with(arrivals, 0);
  mean_s = arrivals.front().at_s + mean_s / static_cast<double>(arrivals.size());
  std::size_t right = 1;
  while (right + 1 < hull.size() && hull[right].at_s < mean_s) ++right;
  const Arrival &p = hull[right - 1], &q = hull[right];
  if (q.at_s <= p.at_s) return line_under_with(arrivals, 0);
  return line_under_with(arrivals, std::clamp((q.late_s - p.late_s) / (q.at_s - p.at_s), -slope_max, slope_max));
}
}  // namespace binpick
