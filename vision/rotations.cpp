#include "vision/rotations.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace binpick::vision {
namespace {
constexpr double kPi = std::numbers::pi;

Eigen::Quaterniond super_fibonacci(int i, int count) {
  constexpr double kPhi = std::numbers::sqrt2, kPsi = 1.533751168755204288118041;
  const double s = i + 0.5, t = s / count;
  const double r = std::sqrt(t), rest = std::sqrt(1 - t);
  const double a = 2 * kPi * s / kPhi, b = 2 * kPi * s / kPsi;
  return {rest * std::cos(b), r * std::sin(a), r * std::cos(a), rest * std::sin(b)};
}

/// Whether no other member of the orbit lies nearer to the identity.
bool is_representative(const Eigen::Quaterniond& q, const Symmetry& symmetry) {
  const Eigen::Matrix3d R = q.toRotationMatrix();
  const double own = R.trace();
  return std::ranges::all_of(symmetry.rotations,
                             [&](const Eigen::Matrix3d& g) { return (R * g).trace() <= own + 1e-9; });
}

std::vector<Eigen::Quaterniond> axis_directions(int count, const Symmetry& symmetry) {
  // As dense as the same number of rotations would be: the axis needs two of their three dimensions, and 2 500 of them
  // go with 20 000 rotations.
  const int whole = std::max(24, static_cast<int>(std::lround(2500 * std::pow(count / 20000.0, 2.0 / 3))));
  std::vector<Eigen::Quaterniond> rotations;
  for (int i = 0; i < whole; ++i) {
    const double z = 1 - (2 * i + 1.0) / whole, r = std::sqrt(1 - z * z), at = i * kPi * (3 - std::sqrt(5.0));
    if (symmetry.kind == Symmetry::Kind::RevolutionFlip && z < 0) continue;
    const Eigen::Vector3d direction(r * std::cos(at), r * std::sin(at), z);
    rotations.push_back(Eigen::Quaterniond::FromTwoVectors(symmetry.axis, direction));
  }
  return rotations;
}
}  // namespace

std::vector<Eigen::Quaterniond> training_rotations(int count, const Symmetry& symmetry) {
  std::vector<Eigen::Quaterniond> rotations;
  switch (symmetry.kind) {
    case Symmetry::Kind::Sphere:
      rotations.push_back(Eigen::Quaterniond::Identity());
      break;
    case Symmetry::Kind::Revolution:
    case Symmetry::Kind::RevolutionFlip:
      rotations = axis_directions(count, symmetry);
      break;
    case Symmetry::Kind::None:
    case Symmetry::Kind::Finite:
      for (int i = 0; i < count; ++i)
        if (const Eigen::Quaterniond q = super_fibonacci(i, count); is_representative(q, symmetry))
          rotations.push_back(q);
      break;
  }
  if (rotations.empty()) rotations.push_back(Eigen::Quaterniond::Identity());
  return rotations;
}
}  // namespace binpick::vision
