#pragma once

#include <Eigen/Geometry>
#include <vector>

#include "vision/symmetry.hpp"

namespace binpick::vision {
/// About `count` rotations spread evenly over all orientations that look different: one of each orbit of the symmetry.
/// A revolution leaves only the directions of its axis, a sphere a single view. Always the same ones.
/// Sources: super-Fibonacci spirals (Alexa, 2022) for rotations, Fibonacci sphere for axes. With n rotations the
/// nearest is about 122 degrees / n^(1/3) away on average, the farthest place 205 degrees / n^(1/3).
std::vector<Eigen::Quaterniond> training_rotations(int count, const Symmetry& symmetry);
}  // namespace binpick::vision
