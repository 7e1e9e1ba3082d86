#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

/// Plain SVG charts.
namespace binpick::bench {
struct Axis {
  std::string name;
  double low = 0, high = 1;
  int ticks = 5;
};
struct Series {
  std::string name;
  std::vector<Eigen::Vector2d> points;
  bool steps = false;  ///< Level until the next point.
  bool dots = false;   ///< Marks on all points; else on the last one, where another series may hide the line.
  bool dashed = false;
};
/// A series beyond the axes is cut off at the frame. `legend_at`: its left end, share of the width.
std::string line_chart(const std::string& title, const Axis& x, const Axis& y, const std::vector<Series>& series,
                       double legend_at = 0);

/// How many of `values` fall into each of `bins` between the axis' ends; the last bin holds what is larger. `mark`: a
/// dashed line with its label.
std::string histogram(const std::string& title, const Axis& x, int bins, const std::vector<double>& values, double mark,
                      const std::string& label);

/// Throws std::runtime_error with path and reason.
void write_text(const std::string& path, const std::string& text);
}  // namespace binpick::bench
