#include "vision/decimation.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <optional>
#include <vector>

#include "vision/surface.hpp"

namespace binpick::vision {
namespace {
using Eigen::Vector3d;
using Triangle = std::array<std::uint32_t, 3>;

struct Collapse {
  double cost_mm;
  std::uint32_t from, to;
};

/// One mesh that loses vertices pass by pass. A pass moves vertices that do not touch each other onto a neighbour each.
/// Every triangle knows the middles of the first mesh's triangles, and those of its vertices that went, which it stands
/// for.
class Collapsing {
 public:
  Collapsing(const Mesh& mesh, double error_mm) : error_mm_{error_mm}, triangles_{mesh.triangles} {
    for (const Eigen::Vector3f& v : mesh.vertices_mm) at_.push_back(v.cast<double>());
    for (const Triangle& t : triangles_) gone_.push_back({(at_[t[0]] + at_[t[1]] + at_[t[2]]) / 3});
    stuck_.assign(at_.size(), 0);
  }

  /// Whether it is worth another pass.
  bool pass() {
    find_neighbours();
    std::vector<Collapse> wanted;
    for (std::uint32_t v = 0; v < at_.size(); ++v)
      if (!stuck_[v])
        if (const auto best = best_of(v)) wanted.push_back(*best);
    std::ranges::sort(wanted, [](const Collapse& a, const Collapse& b) {
      return a.cost_mm != b.cost_mm ? a.cost_mm < b.cost_mm : a.from < b.from;
    });
    std::vector<char> touched(at_.size(), 0);
    for (const Collapse& c : wanted) {
      if (touched[c.from] || touched[c.to]) continue;
      if (!moved(c)) {
        stuck_[c.from] = 1;
        continue;
      }
      for (const std::uint32_t t : faces_of(c.from))
        for (const std::uint32_t v : triangles_[t]) {
          touched[v] = 1;
          stuck_[v] = 0;
        }
      touched[c.from] = 1;
    }
    return drop_vanished();
  }

  Mesh mesh() const {
    Mesh mesh;
    for (const Vector3d& p : at_) mesh.vertices_mm.push_back(p.cast<float>());
    mesh.triangles = triangles_;
    return cleaned(mesh);
  }

 private:
  std::span<const std::uint32_t> faces_of(std::uint32_t v) const {
    return std::span(faces_).subspan(first_[v], first_[v + 1] - first_[v]);
  }

  void find_neighbours() {
    first_.assign(at_.size() + 1, 0);
    for (const Triangle& t : triangles_)
      for (const std::uint32_t v : t) ++first_[v + 1];
    for (std::size_t v = 0; v < at_.size(); ++v) first_[v + 1] += first_[v];
    faces_.resize(3 * triangles_.size());
    std::vector<std::uint32_t> next(first_.begin(), first_.end() - 1);
    for (std::uint32_t t = 0; t < triangles_.size(); ++t)
      for (const std::uint32_t v : triangles_[t]) faces_[next[v]++] = t;
  }

  Vector3d cross_of(const Triangle& t) const { return (at_[t[1]] - at_[t[0]]).cross(at_[t[2]] - at_[t[0]]); }

  /// Moves one vertex, unless something that lay on its faces would come to lie too far from all of them.
  bool moved(const Collapse& c) {
    places_.clear();
    targets_.clear();
    places_.push_back(at_[c.from]);
    for (const std::uint32_t t : faces_of(c.from)) {
      places_.insert(places_.end(), gone_[t].begin(), gone_[t].end());
      Triangle after = triangles_[t];
      if (std::ranges::find(after, c.to) != after.end()) continue;
      std::ranges::replace(after, c.from, c.to);
      targets_.push_back({t, {at_[after[0]], at_[after[1]], at_[after[2]]}});
    }
    if (targets_.empty()) return false;
    homes_.clear();
    for (const Vector3d& p : places_) {
      double best = std::numeric_limits<double>::infinity();
      std::uint32_t home = 0;
      for (const auto& [t, corners] : targets_)
        if (const double d = squared_distance(p, corners); d < best) best = d, home = t;
      if (best > error_mm_ * error_mm_) return false;
      homes_.push_back(home);
    }
    for (const std::uint32_t t : faces_of(c.from)) {
      gone_[t].clear();
      std::ranges::replace(triangles_[t], c.from, c.to);
    }
    for (std::size_t i = 0; i < places_.size(); ++i) gone_[homes_[i]].push_back(places_[i]);
    return true;
  }

  /// Whether more than one in a hundred went.
  bool drop_vanished() {
    std::size_t kept = 0;
    for (std::size_t t = 0; t < triangles_.size(); ++t) {
      const Triangle& now = triangles_[t];
      if (now[0] == now[1] || now[1] == now[2] || now[0] == now[2]) continue;
      triangles_[kept] = now;
      if (kept != t) gone_[kept] = std::move(gone_[t]);
      ++kept;
    }
    const bool worth = (triangles_.size() - kept) * 100 > triangles_.size();
    triangles_.resize(kept);
    gone_.resize(kept);
    return worth;
  }

  /// Distance of p from the segment or line through a and b, the nearer end counting.
  static double from_segment(const Vector3d& p, const Vector3d& a, const Vector3d& b) {
    const Vector3d along = b - a;
    const double squared = along.squaredNorm();
    const double share = squared > 0 ? std::clamp((p - a).dot(along) / squared, 0.0, 1.0) : 0.0;
    return (p - a - share * along).norm();
  }

  /// Neighbours of v that lie across an edge which does not have two faces: a border, or where sheets meet.
  void seams_of(std::uint32_t v, std::vector<std::uint32_t>& seams) const {
    std::array<std::pair<std::uint32_t, int>, 64> seen{};
    std::size_t n = 0;
    for (const std::uint32_t t : faces_of(v))
      for (const std::uint32_t other : triangles_[t]) {
        if (other == v) continue;
        std::size_t i = 0;
        while (i < n && seen[i].first != other) ++i;
        if (i == n && n < seen.size()) seen[n++] = {other, 0};
        if (i < seen.size()) ++seen[i].second;
      }
    seams.clear();
    for (std::size_t i = 0; i < n; ++i)
      if (seen[i].second != 2) seams.push_back(seen[i].first);
  }

  /// How bad it would be if v went to `to`: how far that is from the planes of v's faces, which is more than the
  /// surface moves. Nothing when it would fold over.
  std::optional<double> deviation(std::uint32_t v, std::uint32_t to, const std::vector<std::uint32_t>& seams) const {
    const double limit_mm = 30 * error_mm_;
    double most = 0;
    if (!seams.empty()) {
      // A seam may only become a shorter chain of itself.
      if (seams.size() != 2 || (to != seams[0] && to != seams[1])) return std::nullopt;
      const std::uint32_t other = to == seams[0] ? seams[1] : seams[0];
      most = from_segment(at_[v], at_[to], at_[other]);
    }
    for (const std::uint32_t t : faces_of(v)) {
      const Triangle& before = triangles_[t];
      const Vector3d old_cross = cross_of(before);
      const double old_area = old_cross.norm();
      const bool vanishes = std::ranges::find(before, to) != before.end();
      if (old_area > 0) most = std::max(most, std::abs(old_cross.dot(at_[to] - at_[v])) / old_area);
      if (most > limit_mm) return std::nullopt;
      if (vanishes) continue;
      Triangle after = before;
      std::ranges::replace(after, v, to);
      const Vector3d cross = cross_of(after);
      const double area = cross.norm();
      // No folds and no needles: either would make normals wrong though the surface stays near.
      if (!(cross.dot(old_cross) > 0.5 * area * old_area)) return std::nullopt;
      const double longest =
          std::max({(at_[after[1]] - at_[after[0]]).squaredNorm(), (at_[after[2]] - at_[after[1]]).squaredNorm(),
                    (at_[after[0]] - at_[after[2]]).squaredNorm()});
      if (area < 1e-4 * longest) return std::nullopt;
    }
    return most;
  }

  std::optional<Collapse> best_of(std::uint32_t v) {
    const auto faces = faces_of(v);
    if (faces.empty() || faces.size() > 48) return std::nullopt;
    seams_of(v, seams_);
    std::optional<Collapse> best;
    double best_length = std::numeric_limits<double>::infinity();
    for (const std::uint32_t t : faces)
      for (const std::uint32_t to : triangles_[t]) {
        if (to == v || (best && best->to == to)) continue;
        const auto cost = deviation(v, to, seams_);
        if (!cost) continue;
        const double length = (at_[to] - at_[v]).squaredNorm();
        if (best && !(*cost < best->cost_mm - 1e-9 || (*cost < best->cost_mm + 1e-9 && length < best_length))) continue;
        best = Collapse{*cost, v, to};
        best_length = length;
      }
    return best;
  }

  double error_mm_;
  std::vector<Vector3d> at_;
  std::vector<char> stuck_;  ///< Tried in vain; nothing around has changed since.
  std::vector<Triangle> triangles_;
  std::vector<std::vector<Vector3d>> gone_;  ///< Of each triangle.
  std::vector<std::uint32_t> first_, faces_;
  // Only to spare allocations.
  std::vector<std::uint32_t> seams_, homes_;
  std::vector<Vector3d> places_;
  std::vector<std::pair<std::uint32_t, std::array<Vector3d, 3>>> targets_;
};

bool within(const Mesh& mesh, const SurfaceTree& tree, double error_mm) {
  constexpr int kSamples = 20'000;
  const auto near = [&](const Vector3d& p) { return tree.distance_mm(p, 2 * error_mm) <= error_mm; };
  return std::ranges::all_of(mesh.vertices_mm, [&](const Eigen::Vector3f& v) { return near(v.cast<double>()); }) &&
         std::ranges::all_of(sample_surface(mesh, kSamples), near);
}
}  // namespace

Mesh decimated(const Mesh& mesh, double error_mm) {
  constexpr int kPassesMax = 60;
  const Mesh whole = cleaned(mesh);
  // Between these places it may lie farther off than at them; a smaller budget then keeps the promise.
  for (const double share : {0.9, 0.6, 0.3}) {
    const double budget_mm = share * error_mm;
    Collapsing collapsing(whole, budget_mm);
    for (int pass = 0; pass < kPassesMax && collapsing.pass();) ++pass;
    Mesh smaller = collapsing.mesh();
    if (smaller.triangles.size() >= whole.triangles.size()) break;
    const double slack_mm = error_mm + 1e-6 * whole.diameter_mm();
    if (!smaller.triangles.empty() && within(whole, SurfaceTree(smaller), slack_mm) &&
        within(smaller, SurfaceTree(whole), slack_mm))
      return smaller;
  }
  return mesh;
}
}  // namespace binpick::vision
