#include "vision/resting.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <numeric>
#include <optional>
#include <random>
#include <unordered_map>

namespace binpick::vision {
namespace {
using Eigen::Vector3d;
using Triangle = std::array<std::uint32_t, 3>;
constexpr double kPi = std::numbers::pi;

std::uint64_t edge_key(std::uint32_t a, std::uint32_t b) { return std::uint64_t{a} << 32 | b; }

/// Points added one by one in random order: what sees the new point goes, and its rim is joined to the point.
class Hull {
 public:
  explicit Hull(std::vector<Vector3d> points) : at_{std::move(points)} {
    if (!start()) return;
    std::vector<std::uint32_t> order(at_.size());
    std::iota(order.begin(), order.end(), 0U);
    std::mt19937 random{1};
    for (std::size_t i = order.size(); i > 1; --i) std::swap(order[i - 1], order[random() % i]);
    for (const std::uint32_t p : order)
      if (std::ranges::find(first_, p) == first_.end()) add(p);
  }
  std::vector<Triangle> triangles() const {
    std::vector<Triangle> all;
    for (const Face& face : faces_) all.push_back(face.corners);
    return all;
  }

 private:
  struct Face {
    Triangle corners;
    Vector3d normal;
    double offset;
  };

  void push(std::uint32_t a, std::uint32_t b, std::uint32_t c) {
    const Vector3d normal = (at_[b] - at_[a]).cross(at_[c] - at_[a]).normalized();
    faces_.push_back({{a, b, c}, normal, normal.dot(at_[a])});
  }

  std::uint32_t farthest(auto&& measure) const {
    std::uint32_t best = 0;
    double most = -1;
    for (std::uint32_t i = 0; i < at_.size(); ++i)
      if (const double d = measure(at_[i]); d > most) most = d, best = i;
    return best;
  }

  bool start() {
    if (at_.size() < 4) return false;
    const std::uint32_t a = farthest([&](const Vector3d& p) { return (p - at_[0]).squaredNorm(); });
    const std::uint32_t b = farthest([&](const Vector3d& p) { return (p - at_[a]).squaredNorm(); });
    const Vector3d along = at_[b] - at_[a];
    const std::uint32_t c = farthest([&](const Vector3d& p) { return along.cross(p - at_[a]).squaredNorm(); });
    const Vector3d normal = along.cross(at_[c] - at_[a]);
    const std::uint32_t d = farthest([&](const Vector3d& p) { return std::abs(normal.dot(p - at_[a])); });
    const double volume = normal.dot(at_[d] - at_[a]);
    if (!(std::abs(volume) > 0)) return false;
    const auto [x, y] = volume > 0 ? std::pair{c, b} : std::pair{b, c};
    first_ = {a, b, c, d};
    push(a, x, y);
    push(a, y, d);
    push(y, x, d);
    push(x, a, d);
    return true;
  }

  void add(std::uint32_t p) {
    std::vector<Face> kept;
    std::unordered_map<std::uint64_t, bool> rim;
    const std::size_t before = faces_.size();
    for (std::size_t i = 0; i < before; ++i) {
      const Face& face = faces_[i];
      if (!(face.normal.dot(at_[p]) > face.offset)) continue;
      const auto [a, b, c] = face.corners;
      for (const auto& [from, to] : {std::pair{a, b}, {b, c}, {c, a}}) rim.emplace(edge_key(from, to), true);
    }
    if (rim.empty()) return;
    std::erase_if(faces_, [&](const Face& face) { return face.normal.dot(at_[p]) > face.offset; });
    for (const auto& entry : rim) {
      const auto from = static_cast<std::uint32_t>(entry.first >> 32), to = static_cast<std::uint32_t>(entry.first);
      if (!rim.contains(edge_key(to, from))) push(from, to, p);
    }
  }

  std::vector<Vector3d> at_;
  std::vector<Face> faces_;
  std::array<std::uint32_t, 4> first_{};
};

/// Signed volume and its centroid; the volume is 0 where there is none.
std::pair<double, Vector3d> volume_of(const Mesh& mesh, const std::vector<Triangle>& triangles, const Vector3d& about) {
  double volume = 0;
  Vector3d sum = Vector3d::Zero();
  for (const Triangle& t : triangles) {
    const Vector3d a = mesh.vertices_mm[t[0]].cast<double>() - about, b = mesh.vertices_mm[t[1]].cast<double>() - about,
                   c = mesh.vertices_mm[t[2]].cast<double>() - about;
    const double six = a.dot(b.cross(c));
    volume += six / 6;
    sum += six / 24 * (a + b + c);
  }
  return {volume, volume != 0 ? Vector3d(about + sum / volume) : about};
}

/// Outward unit normal; none of a needle, whose own says nothing.
std::optional<Vector3d> normal_of(const Mesh& mesh, const Triangle& t) {
  constexpr double kNeedle = 1e-3;
  const Vector3d a = mesh.vertices_mm[t[0]].cast<double>();
  const Vector3d ab = mesh.vertices_mm[t[1]].cast<double>() - a, ac = mesh.vertices_mm[t[2]].cast<double>() - a;
  const Vector3d cross = ab.cross(ac);
  const double longest = std::max({ab.squaredNorm(), ac.squaredNorm(), (ac - ab).squaredNorm()});
  if (!(cross.norm() > kNeedle * longest)) return std::nullopt;
  return cross.normalized();
}

/// One triangle of the hull as a floor to lie on.
struct Floor {
  Vector3d down;
  double height_mm;
};

/// A needle lies as the neighbour does that it goes with: the one along its longest edge, and where that is one of
/// several needles that only know each other, along any other edge.
std::vector<Floor> floors_of(const Mesh& mesh, const std::vector<Triangle>& hull,
                             const std::unordered_map<std::uint64_t, std::uint32_t>& face_of_edge,
                             const Vector3d& centre) {
  const auto at = [&](std::uint32_t v) -> Vector3d { return mesh.vertices_mm[v].cast<double>(); };
  std::vector<std::optional<Floor>> known;
  for (const Triangle& t : hull) {
    const auto normal = normal_of(mesh, t);
    known.push_back(normal ? std::optional{Floor{*normal, normal->dot(at(t[0]) - centre)}} : std::nullopt);
  }
  // Whether some needle found its neighbour.
  const auto ask_neighbours = [&](std::size_t edges) {
    bool found = false;
    for (std::uint32_t i = 0; i < hull.size(); ++i) {
      if (known[i]) continue;
      std::array<std::pair<double, std::uint64_t>, 3> by_length;
      for (std::size_t k = 0; k < 3; ++k) {
        const std::uint32_t a = hull[i][k], b = hull[i][(k + 1) % 3];
        by_length[k] = {-(at(a) - at(b)).norm(), edge_key(b, a)};
      }
      std::ranges::sort(by_length);
      for (std::size_t k = 0; k < edges && !known[i]; ++k)
        if (const auto across = face_of_edge.find(by_length[k].second); across != face_of_edge.end())
          known[i] = known[across->second];
      found |= known[i].has_value();
    }
    return found;
  };
  while (ask_neighbours(1) || ask_neighbours(3)) continue;
  std::vector<Floor> floors;
  for (const auto& floor : known) floors.push_back(floor.value_or(Floor{Vector3d::UnitZ(), 0}));
  return floors;
}

/// Rolling over the edge that two of them share.
struct Tipping {
  double over_mm;  ///< The centre of mass's highest point on the way.
  std::uint32_t from, to;
};

double top_over_edge(const Floor& i, const Floor& j, const Vector3d& a, const Vector3d& b, const Vector3d& centre) {
  const Vector3d along = (b - a).normalized();
  const Vector3d foot = (a - centre) - along * along.dot(a - centre);
  const Vector3d u = foot.normalized(), turn = i.down.cross(j.down);
  const bool upright_between = i.down.cross(u).dot(turn) > 0 && u.cross(j.down).dot(turn) > 0;
  return upright_between ? foot.norm() : std::max(i.height_mm, j.height_mm);
}

/// Floors that are one basin so far: its lowest ones, and how low they are.
struct Basin {
  double lowest_mm;
  std::vector<std::uint32_t> floors;
};

double angle_between(const Vector3d& a, const Vector3d& b) { return std::atan2(a.cross(b).norm(), a.dot(b)); }

double angle_to_axis(const Vector3d& a, const Symmetry& symmetry) {
  const double angle = angle_between(a, symmetry.axis);
  return symmetry.kind == Symmetry::Kind::RevolutionFlip ? std::min(angle, kPi - angle) : angle;
}

/// Least angle between two directions of the part, the symmetry minded.
double angle_between(const Vector3d& a, const Vector3d& b, const Symmetry& symmetry) {
  switch (symmetry.kind) {
    case Symmetry::Kind::Sphere:
      return 0;
    case Symmetry::Kind::Revolution:
    case Symmetry::Kind::RevolutionFlip:
      return std::abs(angle_to_axis(a, symmetry) - angle_to_axis(b, symmetry));
    case Symmetry::Kind::None:
    case Symmetry::Kind::Finite:
      break;
  }
  double least = kPi;
  for (const Eigen::Matrix3d& g : symmetry.rotations) least = std::min(least, angle_between(g * a, b));
  return least;
}

/// The turn about `down` after which the part looks the same; 0 when every one does.
double period_about(const Vector3d& down, const Symmetry& symmetry) {
  constexpr double kSame = 0.05;  // rad
  switch (symmetry.kind) {
    case Symmetry::Kind::Sphere:
      return 0;
    case Symmetry::Kind::Revolution:
    case Symmetry::Kind::RevolutionFlip: {
      const double angle = angle_between(down, symmetry.axis);
      if (std::min(angle, kPi - angle) < kSame) return 0;
      return symmetry.kind == Symmetry::Kind::RevolutionFlip && std::abs(angle - kPi / 2) < kSame ? kPi : 2 * kPi;
    }
    case Symmetry::Kind::None:
    case Symmetry::Kind::Finite:
      break;
  }
  const auto same = std::ranges::count_if(
      symmetry.rotations, [&](const Eigen::Matrix3d& g) { return angle_between(g * down, down) < kSame; });
  return 2 * kPi / static_cast<double>(std::max<std::ptrdiff_t>(1, same));
}
}  // namespace

std::vector<Triangle> convex_hull(const std::vector<Eigen::Vector3f>& points) {
  Eigen::AlignedBox3f box;
  for (const Eigen::Vector3f& p : points) box.extend(p);
  if (points.empty() || !(box.diagonal().norm() > 0)) return {};
  // A shift of a millionth makes no four points lie in a plane, where rounding would decide who sees whom.
  std::mt19937 random{7};
  std::vector<Vector3d> shifted;
  const double jitter = 1e-6 * double{box.diagonal().norm()};
  const auto some = [&] { return jitter * (static_cast<double>(random()) / 4294967295.0 - 0.5); };
  for (const Eigen::Vector3f& p : points) {
    const double x = some(), y = some(), z = some();
    shifted.push_back(p.cast<double>() + Vector3d(x, y, z));
  }
  return Hull(std::move(shifted)).triangles();
}

Vector3d centre_of_mass_mm(const Mesh& mesh) {
  constexpr double kFilledMin = 0.02;
  const Vector3d surface = mesh.centroid_mm();
  const auto hull = convex_hull(mesh.vertices_mm);
  const double hull_mm3 = volume_of(mesh, hull, surface).first;
  const auto [mm3, centre] = volume_of(mesh, mesh.triangles, surface);
  if (!(std::abs(mm3) > kFilledMin * hull_mm3) || std::abs(mm3) > 1.001 * hull_mm3) return surface;
  for (const Triangle& t : hull)
    if (const auto out = normal_of(mesh, t); out && out->dot(centre - mesh.vertices_mm[t[0]].cast<double>()) > 0)
      return surface;
  return centre;
}

std::vector<RestingPose> resting_poses(const Mesh& mesh, const Symmetry& symmetry, double barrier_mm, double step_rad) {
  const auto hull = convex_hull(mesh.vertices_mm);
  const Vector3d centre = centre_of_mass_mm(mesh);
  const auto at = [&](std::uint32_t v) -> Vector3d { return mesh.vertices_mm[v].cast<double>(); };
  std::unordered_map<std::uint64_t, std::uint32_t> face_of_edge;
  for (std::uint32_t i = 0; i < hull.size(); ++i)
    for (std::size_t k = 0; k < 3; ++k) face_of_edge[edge_key(hull[i][k], hull[i][(k + 1) % 3])] = i;
  const std::vector<Floor> floors = floors_of(mesh, hull, face_of_edge, centre);
  std::vector<Tipping> tippings;
  for (const auto& [key, face] : face_of_edge) {
    const auto a = static_cast<std::uint32_t>(key >> 32), b = static_cast<std::uint32_t>(key);
    const auto across = face_of_edge.find(edge_key(b, a));
    if (a > b || across == face_of_edge.end()) continue;
    tippings.push_back(
        {top_over_edge(floors[face], floors[across->second], at(a), at(b), centre), face, across->second});
  }
  std::ranges::sort(tippings, [](const Tipping& a, const Tipping& b) {
    return std::tie(a.over_mm, a.from, a.to) < std::tie(b.over_mm, b.from, b.to);
  });

  // Flooding: basins join where the water first runs from one into the other; the shallower one is a resting place
  // only if it was deep enough.
  const double level_mm = 0.5 * barrier_mm;
  std::vector<std::uint32_t> parent(floors.size());
  std::iota(parent.begin(), parent.end(), 0U);
  std::vector<Basin> basins;
  for (std::uint32_t i = 0; i < floors.size(); ++i) basins.push_back({floors[i].height_mm, {i}});
  const auto root = [&](std::uint32_t i) {
    while (parent[i] != i) i = parent[i] = parent[parent[i]];
    return i;
  };
  std::vector<RestingPose> all;
  const auto rests = [&](const Basin& basin, double depth_mm) {
    for (const std::uint32_t f : basin.floors)
      if (floors[f].height_mm <= basin.lowest_mm + level_mm)
        all.push_back({floors[f].down, floors[f].height_mm, depth_mm});
  };
  for (const Tipping& tipping : tippings) {
    std::uint32_t low = root(tipping.from), high = root(tipping.to);
    if (low == high) continue;
    if (basins[high].lowest_mm < basins[low].lowest_mm) std::swap(low, high);
    Basin &keeps = basins[low], &ends = basins[high];
    const double depth_mm = tipping.over_mm - ends.lowest_mm;
    if (depth_mm >= barrier_mm)
      rests(ends, depth_mm);
    else
      for (const std::uint32_t f : ends.floors)
        if (floors[f].height_mm <= keeps.lowest_mm + level_mm) keeps.floors.push_back(f);
    ends.floors.clear();
    parent[high] = low;
  }
  if (!floors.empty()) rests(basins[root(0)], std::numeric_limits<double>::infinity());

  std::ranges::stable_sort(all, [](const RestingPose& a, const RestingPose& b) { return a.height_mm < b.height_mm; });
  return apart(all, symmetry, step_rad);
}

std::vector<RestingPose> apart(const std::vector<RestingPose>& poses, const Symmetry& symmetry, double step_rad) {
  std::vector<RestingPose> distinct;
  for (const RestingPose& pose : poses)
    if (std::ranges::none_of(distinct, [&](const RestingPose& other) {
          return angle_between(pose.down, other.down, symmetry) < step_rad;
        }))
      distinct.push_back(pose);
  return distinct;
}

std::vector<Eigen::Quaterniond> resting_rotations(const std::vector<RestingPose>& poses, const Symmetry& symmetry,
                                                  double turn_rad, double lean_rad) {
  std::vector<Eigen::Quaterniond> rotations;
  for (const RestingPose& pose : poses) {
    const Eigen::Quaterniond flat = Eigen::Quaterniond::FromTwoVectors(pose.down, -Vector3d::UnitZ());
    const double period = period_about(pose.down, symmetry);
    const int turns = std::max(1, static_cast<int>(std::ceil(period / turn_rad - 1e-9)));
    for (int k = 0; k < turns; ++k) {
      const Eigen::Quaterniond turned(Eigen::AngleAxisd(period * k / turns, Vector3d::UnitZ()));
      rotations.push_back(turned * flat);
      for (int side = 0; side < 3 && lean_rad > 0; ++side) {
        const double to = 2 * kPi * side / 3 + k;  // Another way each time.
        rotations.push_back(turned * Eigen::AngleAxisd(lean_rad, Vector3d(std::cos(to), std::sin(to), 0)) * flat);
      }
    }
  }
  return rotations;
}
}  // namespace binpick::vision
