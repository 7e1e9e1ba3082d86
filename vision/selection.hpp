#pragma once

#include <functional>
#include <string>
#include <vector>

#include "vision/refinement.hpp"
#include "vision/symmetry.hpp"

namespace binpick::vision {
/// A refined pose with all that is known of it.
struct Candidate {
  Pose pose;
  DenseTest test;
  Matrix6 information = Matrix6::Zero();
  float rival = 0;  ///< Evidence of the best distinct pose at the same place, relative to its own, 0 … 1.
};

struct SelectOptions {
  double same_mm = 10;  ///< Poses nearer (surface displacement) are one object.
  double diameter_mm = 100;
  double radius_mm = 40;                                  ///< Rms distance of the surface from its centroid.
  Eigen::Vector3d centroid_mm = Eigen::Vector3d::Zero();  ///< Object frame.
};

struct Selected {
  Candidate candidate;
  double score = 0;           ///< Probability of being right.
  std::string reason;         ///< Why it is not believed; empty: it is.
  bool overshadowed = false;  ///< The reason is a better one at the same place.
};

/// Goes through the candidates by evidence: the first stands; what shows the same object again is dropped, what lives
/// on pixels that a better one explains already, or stands inside of it, is rejected with that reason, and so is what
/// contradicts the picture by itself. Best first.
std::vector<Selected> select(const Scene& scene, const Rasteriser& part, const Symmetry& symmetry,
                             std::vector<Candidate> candidates, const SelectOptions& options);

/// Calibrated probability that a candidate is right, from its own figures.
double score_of(const Candidate& candidate);
/// Surface displacement (rms, mm) that the distance of two poses stands for.
double displacement_mm(const Candidate& a, const Candidate& b, const Symmetry& symmetry, double radius_mm);
}  // namespace binpick::vision
