#include "vision/calibration/sphere_search.hpp"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <optional>
#include <unordered_map>

namespace binpick::vision::calibration {
namespace {
using Eigen::Matrix3d;
using Eigen::Vector3d;

/// All of the following as shares of the radius.
constexpr double kPatch = 0.4;              ///< Reach of a patch whose normal votes.
constexpr double kVoteReach = 0.15;         ///< Votes this near each other mean the same centre.
constexpr double kOnSphere = 0.2;           ///< A point this near the surface may belong to it, under a wrong mount.
constexpr double kNear = 1.6;               ///< From the centre: what later steps need to see.
constexpr double kFrontal = 0.8;            ///< A ray that passes the centre this near meets the sphere well.
constexpr std::size_t kPointsMax = 60'000;  ///< Of a scan, for the votes.
constexpr std::size_t kSeedsMax = 4'000;
constexpr std::size_t kPatchPointsMin = 8;
constexpr std::size_t kSpherePointsMin = 60;
constexpr double kShareMin = 0.6;  ///< Of the rays that should have met the sphere, so many did.
/// Of a sphere in the noise that it may be measured with; a box of its size is twice as rough.
constexpr double kRoughMax = 0.07;
constexpr double kShearMax = 0.25, kShearSparing = 1e-3;
constexpr int kCandidates = 5;

struct Point {
  Vector3d p_base, eye_base;
  Matrix3d R_base_scanner;
};

/// Points by cubes of an edge, so that those within that edge of a place are in 27 of them.
class Cubes {
 public:
  explicit Cubes(double edge_mm) : edge_mm_{edge_mm} {}
  void add(const Vector3d& p, std::uint32_t index) { cubes_[key(cell(p))].push_back(index); }
  template <class Visit>
  void near(const Vector3d& p, const Visit& visit) const {
    const Eigen::Vector3i c = cell(p);
    for (int i = -1; i <= 1; ++i)
      for (int j = -1; j <= 1; ++j)
        for (int k = -1; k <= 1; ++k) {
          const auto it = cubes_.find(key(c + Eigen::Vector3i{i, j, k}));
          if (it == cubes_.end()) continue;
          for (const std::uint32_t index : it->second) visit(index);
        }
  }

 private:
  Eigen::Vector3i cell(const Vector3d& p) const {
    return (p / edge_mm_).array().floor().max(-1e6).min(1e6).cast<int>();
  }
  static std::uint64_t key(const Eigen::Vector3i& c) {
    const auto part = [](int v) { return static_cast<std::uint64_t>(v + (1 << 20)) & 0x1FFFFF; };
    return part(c.x()) << 42 | part(c.y()) << 21 | part(c.z());
  }
  double edge_mm_;
  std::unordered_map<std::uint64_t, std::vector<std::uint32_t>> cubes_;
};

bool measured(float x, float z) { return std::isfinite(x) && std::isfinite(z) && z > 0; }

std::vector<Point> points_of(const SphereScan& scan, const Mount& mount) {
  std::size_t all = 0;
  for (const CarriedProfile& profile : scan.profiles) all += profile.x_mm.size();
  const std::size_t stride = all / kPointsMax + 1;
  std::vector<Point> points;
  std::size_t count = 0;
  for (const CarriedProfile& profile : scan.profiles) {
    const Eigen::Isometry3d T = mount.T_base_scanner(profile.T_root_carrier);
    for (std::size_t i = 0; i < profile.x_mm.size(); ++i)
      if (measured(profile.x_mm[i], profile.z_mm[i]) && count++ % stride == 0)
        points.push_back({T * Vector3d{profile.x_mm[i], 0, profile.z_mm[i]}, T.translation(), T.linear()});
  }
  return points;
}

/// The centre for which a patch of the surface votes.
std::optional<Vector3d> vote_of(const std::vector<Point>& points, const Cubes& cubes, const Point& seed,
                                double radius_mm) {
  const double reach = kPatch * radius_mm;
  Vector3d sum = Vector3d::Zero();
  Matrix3d squares = Matrix3d::Zero();
  std::size_t n = 0;
  cubes.near(seed.p_base, [&](std::uint32_t index) {
    const Vector3d d = points[index].p_base - seed.p_base;
    if (d.squaredNorm() > reach * reach) return;
    sum += d;
    squares += d * d.transpose();
    ++n;
  });
  if (n < kPatchPointsMin) return std::nullopt;
  const Vector3d mean = sum / static_cast<double>(n);
  const Eigen::SelfAdjointEigenSolver<Matrix3d> axes{squares / static_cast<double>(n) - mean * mean.transpose()};
  // A patch is thin and wide; a line of points, or an edge, says nothing of a centre.
  if (axes.eigenvalues()[1] < 0.02 * reach * reach || axes.eigenvalues()[0] > 0.3 * axes.eigenvalues()[1])
    return std::nullopt;
  Vector3d normal = axes.eigenvectors().col(0);
  if (normal.dot(seed.eye_base - seed.p_base) < 0) normal = -normal;
  // The middle of a round patch lies a quarter of the squared reach beneath the surface, in radii.
  return seed.p_base + mean - (1 - kPatch * kPatch / 4) * radius_mm * normal;
}

/// Where votes crowd, most crowded first, each place once.
std::vector<Vector3d> crowded(std::vector<Vector3d> votes, double reach_mm) {
  std::vector<Vector3d> centres;
  while (static_cast<int>(centres.size()) < kCandidates && votes.size() >= 3) {
    Cubes cubes{reach_mm};
    for (std::uint32_t i = 0; i < votes.size(); ++i) cubes.add(votes[i], i);
    std::size_t most = 0;
    Vector3d best = Vector3d::Zero();
    for (const Vector3d& vote : votes) {
      std::size_t n = 0;
      Vector3d sum = Vector3d::Zero();
      cubes.near(vote, [&](std::uint32_t i) {
        if ((votes[i] - vote).norm() < reach_mm) sum += votes[i], ++n;
      });
      if (n > most) most = n, best = sum / static_cast<double>(n);
    }
    centres.push_back(best);
    std::erase_if(votes, [&](const Vector3d& v) { return (v - best).norm() < 4 * reach_mm; });
  }
  return centres;
}

struct Trial {
  Vector3d centre_mm = Vector3d::Zero();
  double rough_mm = 0;      ///< Root mean square of how far the points on it are off.
  std::size_t on_it = 0;    ///< Points of rays that meet it well, and lie on it.
  std::size_t awaited = 0;  ///< All points of such rays.
  double share() const { return awaited == 0 ? 0 : static_cast<double>(on_it) / static_cast<double>(awaited); }
};

/// How near the ray to a point passes the centre.
double miss_mm(const Point& point, const Vector3d& centre) {
  const Vector3d ray = (point.p_base - point.eye_base).normalized();
  return ray.cross(centre - point.eye_base).norm();
}

/// The centre by least squares of the distances to the surface, its points chosen anew a few times. A wrong mount moves
/// each profile against the one before: a shear of three numbers, which are fitted with it.
Trial fitted(const std::vector<Point>& points, Vector3d centre, double radius_mm) {
  Vector3d shear = Vector3d::Zero();
  const auto straightened = [&](const Point& point) -> Vector3d {
    const Vector3d d = point.p_base - centre;
    return d - point.R_base_scanner.col(1).dot(d) * (point.R_base_scanner * shear);
  };
  Trial trial;
  for (int round = 0; round < 12; ++round) {
    Eigen::Matrix<double, 6, 6> normal = Eigen::Matrix<double, 6, 6>::Zero();
    Eigen::Matrix<double, 6, 1> right = Eigen::Matrix<double, 6, 1>::Zero();
    for (const Point& point : points) {
      const Vector3d d = straightened(point);
      const double distance = d.norm(), off = distance - radius_mm;
      if (std::abs(off) > kOnSphere * radius_mm || d.dot(point.eye_base - centre) < 0) continue;
      const Vector3d n = d / distance;
      Eigen::Matrix<double, 6, 1> row;
      row << n, point.R_base_scanner.col(1).dot(d) * (point.R_base_scanner.transpose() * n);
      normal += row * row.transpose();
      right += row * off;
    }
    if (normal.topLeftCorner<3, 3>().trace() < 3) return trial;
    // Sheared by a fifth is as much as 10 degrees do: what the points do not say stays near none.
    normal.diagonal().head<3>().array() += 1e-3 * normal.topLeftCorner<3, 3>().trace();
    normal.diagonal().tail<3>().array() += kShearSparing * normal.bottomRightCorner<3, 3>().trace();
    const Eigen::Matrix<double, 6, 1> step = normal.ldlt().solve(right);
    centre += step.head<3>();
    shear = (shear + step.tail<3>()).cwiseMin(kShearMax).cwiseMax(-kShearMax);
    if (step.head<3>().norm() < 1e-3 * radius_mm) break;
  }
  trial.centre_mm = centre;
  double squares = 0;
  for (const Point& point : points) {
    if ((point.p_base - point.eye_base).dot(centre - point.eye_base) < 0) continue;
    if (miss_mm(point, centre) > kFrontal * radius_mm) continue;
    ++trial.awaited;
    const Vector3d d = straightened(point);
    const double off = d.norm() - radius_mm;
    if (std::abs(off) > kOnSphere * radius_mm || d.dot(point.eye_base - centre) < 0) continue;
    ++trial.on_it;
    squares += off * off;
  }
  trial.rough_mm = std::sqrt(squares / static_cast<double>(std::max<std::size_t>(trial.on_it, 1)));
  return trial;
}

std::string in_words(const char* format, double a, double b) {
  char text[200];
  std::snprintf(text, sizeof text, format, a, b);
  return text;
}
}  // namespace

Expected<SphereSight, std::string> find_sphere(const SphereScan& scan, const Mount& mount, double radius_mm) {
  const std::vector<Point> points = points_of(scan, mount);
  if (points.size() < kSpherePointsMin) return unexpected(scan.name + ": the scan has hardly a point");
  Cubes cubes{kPatch * radius_mm};
  for (std::uint32_t i = 0; i < points.size(); ++i) cubes.add(points[i].p_base, i);
  std::vector<Vector3d> votes;
  for (std::size_t i = 0; i < points.size(); i += points.size() / kSeedsMax + 1)
    if (const auto vote = vote_of(points, cubes, points[i], radius_mm)) votes.push_back(*vote);

  Trial best;
  for (const Vector3d& centre : crowded(std::move(votes), kVoteReach * radius_mm)) {
    const Trial trial = fitted(points, centre, radius_mm);
    const auto round = [&](const Trial& t) { return t.rough_mm <= kRoughMax * radius_mm; };
    if (trial.on_it < kSpherePointsMin || (best.on_it > 0 && round(best) > round(trial))) continue;
    if (round(trial) > round(best) || trial.share() > best.share()) best = trial;
  }
  if (best.share() < kShareMin || best.rough_mm > kRoughMax * radius_mm) {
    std::string text = scan.name + in_words(": no sphere of %.4g mm in the scan", 2 * radius_mm, 0);
    if (best.on_it > 0)
      text +=
          in_words("; of the likeliest thing %.0f %% lie on one, %.2g mm off it", 100 * best.share(), best.rough_mm);
    return unexpected(text + "; it must be seen whole, and be of the diameter that --sphere-mm says");
  }

  SphereSight sight{scan.name, scan.T_base_holder, {}, best.centre_mm, best.on_it};
  for (const CarriedProfile& profile : scan.profiles) {
    const Vector3d centre = mount.T_base_scanner(profile.T_root_carrier).inverse() * best.centre_mm;
    if (std::abs(centre.y()) > kNear * radius_mm) continue;
    SphereSight::Line line{profile.T_root_carrier, {}};
    for (std::size_t i = 0; i < profile.x_mm.size(); ++i) {
      if (!measured(profile.x_mm[i], profile.z_mm[i])) continue;
      const Vector3d p{profile.x_mm[i], 0, profile.z_mm[i]};
      if ((p - centre).norm() < kNear * radius_mm) line.points_mm.push_back({p.x(), p.z()});
    }
    if (!line.points_mm.empty()) sight.lines.push_back(std::move(line));
  }
  return sight;
}
}  // namespace binpick::vision::calibration
