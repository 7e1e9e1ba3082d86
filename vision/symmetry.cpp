#include "vision/symmetry.hpp"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <numbers>
#include <optional>

#include "vision/surface.hpp"

namespace binpick::vision {
namespace {
using Eigen::Matrix3d;
using Eigen::Vector3d;
constexpr double kPi = std::numbers::pi;
constexpr int kOrderMax = 36;           ///< Of one axis; a part with more folds counts as turned if it looks so.
constexpr std::size_t kGroupMax = 72;   ///< Of a prism of 36 folds; a cube has 24, an icosahedron 60.
constexpr double kDegenerate = 0.03;    ///< Relative difference of two principal deviations that are taken for equal.
constexpr double kSameRotation = 0.07;  ///< rad; below the 10 degrees between neighbours of 36 folds.

Matrix3d turn(double angle, const Vector3d& axis) { return Eigen::AngleAxisd(angle, axis).toRotationMatrix(); }

double angle_of(const Matrix3d& R) {
  // From the quaternion: exact for small angles, where the trace is not.
  const Eigen::Quaterniond q(R);
  return 2 * std::atan2(q.vec().norm(), std::abs(q.w()));
}

/// How well the mesh, turned about its centroid, lies on itself.
class SelfMatch {
 public:
  SelfMatch(const Mesh& mesh, double tolerance_mm)
      : tree_(mesh), centre_(mesh.centroid_mm()), tolerance_mm_(tolerance_mm), limit_mm_(0.2 * mesh.diameter_mm()) {
    coarse_ = sample_surface(mesh, 64);
    fine_ = sample_surface(mesh, 1500);
    for (auto* points : {&coarse_, &fine_})
      for (Vector3d& p : *points) p -= centre_;
  }
  double coarse_rms_mm(const Matrix3d& R) const { return rms_mm(R, coarse_, limit_mm_); }
  bool accepts(const Matrix3d& R, double factor = 1) const {
    // The coarse look saves the fine one where there is nothing to hope for.
    if (coarse_rms_mm(R) > 3 * factor * tolerance_mm_) return false;
    return rms_mm(R, fine_, limit_mm_) <= factor * tolerance_mm_ &&
           rms_mm(R.transpose(), fine_, limit_mm_) <= factor * tolerance_mm_;
  }
  const Vector3d& centre() const { return centre_; }

 private:
  double rms_mm(const Matrix3d& R, const std::vector<Vector3d>& points, double limit_mm) const {
    double sum = 0;
    for (const Vector3d& p : points) {
      const double d = tree_.distance_mm(R * p + centre_, limit_mm);
      sum += d * d;
    }
    return std::sqrt(sum / static_cast<double>(points.size()));
  }
  SurfaceTree tree_;
  Vector3d centre_;
  double tolerance_mm_, limit_mm_;
  std::vector<Vector3d> coarse_, fine_;
};

bool is_revolution(const SelfMatch& match, const Vector3d& axis) {
  // Golden angles fall between the folds of any polygon.
  for (int k = 1; k <= 9; ++k)
    if (!match.accepts(turn(std::fmod(k * 2.399963229728653, 2 * kPi), axis))) return false;
  return true;
}

/// Whether all turns by multiples of 2 pi / n fit: a small turn alone fits a generous tolerance anyway.
bool has_order(const SelfMatch& match, const Vector3d& axis, int n) {
  for (int k = 1; k <= n / 2; ++k)
    if (!match.accepts(turn(2 * kPi * k / n, axis))) return false;
  return true;
}

/// Order of rotation about the axis, 1 when there is none. A generous tolerance may let a wrong order pass beside the
/// right one, so the answer is the highest that fits among the multiples of the one that fits best.
int order_about(const SelfMatch& match, const Vector3d& axis) {
  std::vector<int> fitting;
  int best = 1;
  double best_rms = std::numeric_limits<double>::infinity();
  for (int n = kOrderMax; n > 1; --n) {
    if (!has_order(match, axis, n)) continue;
    fitting.push_back(n);
    if (const double rms = match.coarse_rms_mm(turn(2 * kPi / n, axis)); rms < best_rms) best_rms = rms, best = n;
  }
  for (const int n : fitting)
    if (n % best == 0) return n;
  return 1;
}

/// Least of f over [low, high], by thirds.
template <class F>
double least(F f, double low, double high) {
  while (high - low > 1e-4) {
    const double a = low + (high - low) / 3, b = high - (high - low) / 3;
    (f(a) < f(b) ? high : low) = f(a) < f(b) ? b : a;
  }
  return (low + high) / 2;
}

/// A half turn about an axis square to `axis`; with `order` folds about that, such axes repeat every pi / order.
std::optional<Matrix3d> flip_across(const SelfMatch& match, const Vector3d& axis, int order) {
  const Vector3d x = axis.unitOrthogonal(), y = axis.cross(x);
  const auto half_turn = [&](double at) { return turn(kPi, std::cos(at) * x + std::sin(at) * y); };
  const auto rms = [&](double at) { return match.coarse_rms_mm(half_turn(at)); };
  const double range = kPi / order;
  const int steps = std::max(12, 120 / order);
  std::vector<std::pair<double, int>> ranked;
  for (int i = 0; i < steps; ++i) ranked.emplace_back(rms(range * i / steps), i);
  std::ranges::sort(ranked);
  for (std::size_t k = 0; k < std::min<std::size_t>(4, ranked.size()); ++k) {
    const double middle = range * ranked[k].second / steps;
    const Matrix3d R = half_turn(least(rms, middle - range / steps, middle + range / steps));
    if (match.accepts(R)) return R;
  }
  return std::nullopt;
}

/// The group that the generators make; empty when it does not close or an element of it does not fit.
std::vector<Matrix3d> closure(const SelfMatch& match, const std::vector<Matrix3d>& generators) {
  std::vector<Matrix3d> group{Matrix3d::Identity()};
  const auto add = [&](const Matrix3d& R) {
    for (const Matrix3d& g : group)
      if (angle_of(g.transpose() * R) < kSameRotation) return;
    group.push_back(R);
  };
  for (std::size_t i = 0; i < group.size(); ++i)
    for (const Matrix3d& g : generators) {
      const Matrix3d product = group[i];  // add() may move the elements.
      add(Eigen::Quaterniond(product * g).normalized().toRotationMatrix());
      if (group.size() > kGroupMax) return {};
    }
  for (const Matrix3d& g : group)
    if (!match.accepts(g, 1.5)) return {};
  return group;
}

/// Improves an axis by small steps sideways.
Vector3d refined_axis(const SelfMatch& match, Vector3d axis, double angle, double step) {
  double best = match.coarse_rms_mm(turn(angle, axis));
  for (; step > 1e-4; step /= 2)
    for (bool moved = true; moved;) {
      moved = false;
      const Vector3d x = axis.unitOrthogonal(), y = axis.cross(x);
      for (const Vector3d& d : {x, y, Vector3d(-x), Vector3d(-y)}) {
        const Vector3d next = (axis + step * d).normalized();
        const double rms = match.coarse_rms_mm(turn(angle, next));
        if (rms >= best) continue;
        best = rms;
        axis = next;
        moved = true;
        break;
      }
    }
  return axis;
}

/// All axes of order 2 to 5 of a part whose inertia is that of a ball; each appears once for each order that it has.
std::vector<std::pair<Vector3d, int>> axes_everywhere(const SelfMatch& match) {
  constexpr int kDirections = 900, kTried = 20;
  std::vector<Vector3d> directions;
  for (int i = 0; i < kDirections; ++i) {
    const double z = (i + 0.5) / kDirections, r = std::sqrt(1 - z * z), at = i * kPi * (3 - std::sqrt(5.0));
    directions.emplace_back(r * std::cos(at), r * std::sin(at), z);
  }
  std::vector<std::pair<Vector3d, int>> axes;
  for (const int order : {5, 4, 3, 2}) {
    std::vector<std::pair<double, std::size_t>> ranked;
    for (std::size_t i = 0; i < directions.size(); ++i)
      ranked.emplace_back(match.coarse_rms_mm(turn(2 * kPi / order, directions[i])), i);
    std::ranges::sort(ranked);
    std::vector<Vector3d> tried;
    for (const auto& candidate : ranked) {
      if (tried.size() == kTried) break;
      const Vector3d& direction = directions[candidate.second];
      const auto near = [&](const Vector3d& other) { return std::abs(other.dot(direction)) > std::cos(0.2); };
      if (std::ranges::any_of(tried, near)) continue;
      tried.push_back(direction);
      const Vector3d axis = refined_axis(match, direction, 2 * kPi / order, 0.04);
      if (match.accepts(turn(2 * kPi / order, axis))) axes.emplace_back(axis, order);
    }
  }
  return axes;
}

Symmetry of_revolution(const SelfMatch& match, Vector3d axis) {
  Eigen::Index largest = 0;
  axis.cwiseAbs().maxCoeff(&largest);
  if (axis[largest] < 0) axis = -axis;
  const bool flips = match.accepts(turn(kPi, axis.unitOrthogonal()));
  Symmetry symmetry;
  symmetry.kind = flips ? Symmetry::Kind::RevolutionFlip : Symmetry::Kind::Revolution;
  symmetry.axis = axis;
  return symmetry;
}

Symmetry finite(const SelfMatch& match, const std::vector<Matrix3d>& generators) {
  Symmetry symmetry;
  std::vector<Matrix3d> group = closure(match, generators);
  // What does not close together is a near-symmetry: the largest group of one generator alone stays.
  if (group.empty())
    for (const Matrix3d& g : generators)
      if (auto alone = closure(match, {g}); alone.size() > group.size()) group = std::move(alone);
  if (group.size() < 2) return symmetry;
  symmetry.kind = Symmetry::Kind::Finite;
  symmetry.rotations = std::move(group);
  return symmetry;
}

Symmetry symmetry_about(const SelfMatch& match, const Vector3d& axis) {
  if (is_revolution(match, axis)) return of_revolution(match, axis);
  std::vector<Matrix3d> generators;
  const int order = order_about(match, axis);
  if (order > 1) generators.push_back(turn(2 * kPi / order, axis));
  if (const auto flip = flip_across(match, axis, order)) generators.push_back(*flip);
  return finite(match, generators);
}

Symmetry symmetry_of_ball_like(const SelfMatch& match) {
  Symmetry symmetry;
  bool sphere = true;
  for (int k = 1; k <= 9 && sphere; ++k)
    sphere =
        match.accepts(turn(0.4 + 0.27 * k, Vector3d(std::sin(1.3 * k), std::cos(2.1 * k), 0.3 * k - 1).normalized()));
  if (sphere) {
    symmetry.kind = Symmetry::Kind::Sphere;
    return symmetry;
  }
  std::vector<Matrix3d> generators;
  for (const auto& [axis, order] : axes_everywhere(match)) {
    if (is_revolution(match, axis)) return of_revolution(match, axis);
    generators.push_back(turn(2 * kPi / order, axis));
  }
  return finite(match, generators);
}
}  // namespace

Symmetry find_symmetry(const Mesh& mesh, double tolerance_mm) {
  Symmetry symmetry;
  if (mesh.triangles.empty()) return symmetry;
  const SelfMatch match(mesh, tolerance_mm);
  const Eigen::SelfAdjointEigenSolver<Matrix3d> solver(surface_covariance(mesh));
  const Vector3d deviation = solver.eigenvalues().cwiseMax(0).cwiseSqrt();  // Ascending.
  const Matrix3d axes = solver.eigenvectors();
  const bool low_pair = deviation[1] - deviation[0] < kDegenerate * deviation[2];
  const bool high_pair = deviation[2] - deviation[1] < kDegenerate * deviation[2];
  if (low_pair && high_pair) {
    symmetry = symmetry_of_ball_like(match);
  } else if (low_pair || high_pair) {
    symmetry = symmetry_about(match, axes.col(low_pair ? 2 : 0));
  } else {
    // Three different moments leave only half turns about the principal axes.
    std::vector<Matrix3d> generators;
    for (int i = 0; i < 3; ++i)
      if (const Matrix3d R = turn(kPi, axes.col(i)); match.accepts(R)) generators.push_back(R);
    symmetry = finite(match, generators);
  }
  symmetry.centre_mm = match.centre();
  return symmetry;
}

std::string to_string(const Symmetry& symmetry) {
  char text[96];
  // No "-0.000".
  const Vector3d a = symmetry.axis.unaryExpr([](double x) { return std::abs(x) < 5e-4 ? 0.0 : x; });
  switch (symmetry.kind) {
    case Symmetry::Kind::None:
      return "none";
    case Symmetry::Kind::Finite:
      return "finite, order " + std::to_string(symmetry.rotations.size());
    case Symmetry::Kind::Sphere:
      return "sphere";
    case Symmetry::Kind::Revolution:
    case Symmetry::Kind::RevolutionFlip:
      std::snprintf(text, sizeof text, "revolution about (%.3f, %.3f, %.3f)%s", a.x(), a.y(), a.z(),
                    symmetry.kind == Symmetry::Kind::RevolutionFlip ? ", both ends alike" : "");
      return text;
  }
  return "none";
}

PoseDistance pose_distance(const Eigen::Isometry3d& T_a_object_1, const Eigen::Isometry3d& T_a_object_2,
                           const Symmetry& symmetry, double radius_mm) {
  // Every element leaves the centroid where it is, so centroid and rotation part; the surface displacement of a turn by
  // the angle grows with the angle whatever the radius is.
  static_cast<void>(radius_mm);
  PoseDistance distance;
  distance.centroid_mm = (T_a_object_1 * symmetry.centre_mm - T_a_object_2 * symmetry.centre_mm).norm();
  const Matrix3d R1 = T_a_object_1.linear(), R2 = T_a_object_2.linear();
  switch (symmetry.kind) {
    case Symmetry::Kind::None:
      distance.angle_rad = angle_of(R1.transpose() * R2);
      break;
    case Symmetry::Kind::Finite:
      distance.angle_rad = kPi;
      for (const Matrix3d& g : symmetry.rotations)
        distance.angle_rad = std::min(distance.angle_rad, angle_of((R1 * g).transpose() * R2));
      break;
    case Symmetry::Kind::Revolution:
    case Symmetry::Kind::RevolutionFlip: {
      const Vector3d e1 = R1 * symmetry.axis, e2 = R2 * symmetry.axis;
      distance.angle_rad = std::atan2(e1.cross(e2).norm(), e1.dot(e2));
      if (symmetry.kind == Symmetry::Kind::RevolutionFlip)
        distance.angle_rad = std::min(distance.angle_rad, kPi - distance.angle_rad);
      break;
    }
    case Symmetry::Kind::Sphere:
      break;
  }
  return distance;
}
}  // namespace binpick::vision
