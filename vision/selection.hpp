#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "vision/refinement.hpp"
#include "vision/scene.hpp"
#include "vision/score.hpp"
#include "vision/symmetry.hpp"

namespace binpick::vision {
/// A refined pose with all that is known of it.
struct Candidate {
  Pose pose;
  DenseTest test;
  Matrix6 information = Matrix6::Zero();
  Eigen::Matrix3d loose_turn_rad2 = Eigen::Matrix3d::Zero();  ///< More covariance of the rotation, supply axes: turns
                                                              ///< that the picture hardly tells.
  Evidence evidence;  ///< What other poses tell of it (Clue::Claimed and those after it) comes with select().
};

struct SelectOptions {
  double same_mm = 10;  ///< Poses nearer (surface displacement) are one object.
  double diameter_mm = 100;
  double radius_mm = 40;                                  ///< Rms distance of the surface from its centroid.
  Eigen::Vector3f centroid_mm = Eigen::Vector3f::Zero();  ///< Object frame.
  int threads = 2;
  double score_min = 0.1;
  Grid<std::uint8_t> content;  ///< As large as the scene: 1 where something lies (Bounds::content()), else 0.
  std::function<std::string(const Pose&)> outside;  ///< Why the part cannot be there at all; empty: it can.
  bool explain_away = true;                         ///< A pixel is explained once.
  bool ask_known = true;  ///< What is known of the supply counts: not where only a part of it was looked at.
};

struct Selected {
  Candidate candidate;
  double score = 0;           ///< Probability of being right.
  std::string reason;         ///< Why it is not believed; empty: it is.
  bool overshadowed = false;  ///< The reason is a better one at the same place.
};

/// Goes through the candidates by evidence: the first stands; what shows the same object again is dropped, what lives
/// on pixels that a better one explains already is rejected with that reason, and so is what is not believed by
/// itself. Best first.
std::vector<Selected> select(const Scene& scene, const Rasteriser& part, const Symmetry& symmetry,
                             std::vector<Candidate> candidates, const SelectOptions& options);

/// Surface displacement (rms, mm) that the distance of two poses stands for.
double displacement_mm(const Pose& a, const Pose& b, const Symmetry& symmetry, double radius_mm);
}  // namespace binpick::vision
