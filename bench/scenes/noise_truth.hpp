#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

namespace binpick::bench {
/// Means of what lies in each cube of a grid through the origin.
std::vector<Eigen::Vector3d> cube_means(const std::vector<Eigen::Vector3d>& points, double cube_mm);
struct Plane {
  Eigen::Vector3d normal = Eigen::Vector3d::UnitZ();  ///< Towards the origin.
  double distance_mm = 0;                             ///< From the origin.
};
/// Means of what lies in each column of a square grid on the plane, in the plane's own frame.
std::vector<Eigen::Vector3d> column_means(const std::vector<Eigen::Vector3d>& points, const Plane& plane,
                                          double cube_mm);
/// Of each point with at least ten others within `radius_mm`: how far these lie from their plane (rms). Ascending.
std::vector<double> plane_residuals(const std::vector<Eigen::Vector3d>& points, double radius_mm);

/// The plane with the most points within `band_mm`, of 2000 that each go through three of them.
Plane largest_plane(const std::vector<Eigen::Vector3d>& points, double band_mm);
/// Points within `band_mm` of the plane.
std::vector<Eigen::Vector3d> points_of(const std::vector<Eigen::Vector3d>& points, const Plane& plane, double band_mm);

/// A sweep of the emulated LMS 400 over an endless table: 70 degrees along a line, lines turned by a pivot; ranges 900
/// to 1800 mm.
struct TableScan {
  Plane table;  ///< In the scanner's frame at the middle line, which looks along -z.
  double sigma_mm = 3;
  double step_deg = 0.1;       ///< Along a line.
  double line_step_deg = 0.1;  ///< From line to line.
  int lines = 658;
  int first_line = -329;  ///< The middle line is 0.
};
/// In the frame of the middle line.
std::vector<Eigen::Vector3d> table_scan(const TableScan& scan);

/// Prints the residuals' quantiles of the emulated scan of a table beside those of a real one, and those of `cloud` (a
/// PLY file in millimetres, the largest plane of it) if one is given.
void print_noise_truth(const std::string& cloud);
}  // namespace binpick::bench
