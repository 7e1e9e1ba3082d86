#include "tests/emulators/world/ray_mesh.hpp"

#include <algorithm>
#include <array>
#include <limits>
#include <numeric>

namespace binpick::emulators {
namespace {
using Eigen::Array4f;
using Eigen::Vector3f;
constexpr float kInfinity = std::numeric_limits<float>::infinity();
constexpr std::uint32_t kLeafTriangles = 4;
constexpr std::size_t kDepthMax = 64;

/// Distance at which the ray enters the box, or infinity.
float entry(const Array4f& low, const Array4f& high, const Array4f& origin, const Array4f& inverse, float limit) {
  const Array4f a = (low - origin) * inverse, b = (high - origin) * inverse;
  const float near = std::max(a.min(b).maxCoeff(), 0.F), far = std::min(a.max(b).minCoeff(), limit);
  return near <= far ? near : kInfinity;
}

Array4f widened(const Vector3f& v, float fourth) { return {v.x(), v.y(), v.z(), fourth}; }
}  // namespace

RayMesh::RayMesh(const vision::Mesh& mesh) {
  struct Item {
    std::uint32_t triangle;
    Eigen::AlignedBox3f box;
    Vector3f centre;
  };
  std::vector<Item> items;
  for (std::uint32_t i = 0; i < mesh.triangles.size(); ++i) {
    Eigen::AlignedBox3f box;
    for (const std::uint32_t v : mesh.triangles[i]) box.extend(mesh.vertices_mm[v]);
    box_.extend(box);
    items.push_back({i, box, box.center()});
  }
  struct Range {
    std::uint32_t node, begin, end;
  };
  nodes_.emplace_back();
  std::vector<Range> open{{0, 0, static_cast<std::uint32_t>(items.size())}};
  while (!open.empty()) {
    const Range range = open.back();
    open.pop_back();
    Eigen::AlignedBox3f box, centres;
    for (std::uint32_t i = range.begin; i < range.end; ++i) {
      box.extend(items[i].box);
      centres.extend(items[i].centre);
    }
    Node& node = nodes_[range.node];
    node.low = widened(box.min(), -kInfinity);
    node.high = widened(box.max(), kInfinity);
    if (range.end - range.begin <= kLeafTriangles) {
      node.first = range.begin;
      node.count = range.end - range.begin;
      continue;
    }
    // Halves by number keep the depth at the logarithm, whatever the mesh.
    Eigen::Index axis = 0;
    centres.sizes().maxCoeff(&axis);
    const std::uint32_t middle = (range.begin + range.end) / 2;
    std::nth_element(items.begin() + range.begin, items.begin() + middle, items.begin() + range.end,
                     [&](const Item& a, const Item& b) { return a.centre[axis] < b.centre[axis]; });
    const auto child = static_cast<std::uint32_t>(nodes_.size());
    node.first = child;
    nodes_.emplace_back();
    nodes_.emplace_back();
    open.push_back({child, range.begin, middle});
    open.push_back({child + 1, middle, range.end});
  }
  for (const Item& item : items) {
    const auto& [a, b, c] = mesh.triangles[item.triangle];
    const Vector3f corner = mesh.vertices_mm[a], edge1 = mesh.vertices_mm[b] - corner,
                   edge2 = mesh.vertices_mm[c] - corner;
    triangles_.push_back({corner, edge1, edge2, edge1.cross(edge2).normalized()});
  }
}

std::optional<RayMesh::Hit> RayMesh::cast(const Vector3f& origin, const Vector3f& direction, float limit_mm) const {
  // A component of zero gives infinity, which the box test takes rightly.
  const Array4f inverse = widened(direction.cwiseInverse(), 1), from = widened(origin, 0);
  std::optional<Hit> best;
  float limit = limit_mm;
  struct Entry {
    std::uint32_t node;
    float distance;
  };
  std::array<Entry, kDepthMax> stack;
  std::size_t height = 0;
  if (const float d = entry(nodes_[0].low, nodes_[0].high, from, inverse, limit); d < kInfinity)
    stack[height++] = {0, d};
  while (height > 0) {
    const Entry top = stack[--height];
    if (top.distance > limit) continue;
    const Node& node = nodes_[top.node];
    if (node.count == 0) {
      const Node &left = nodes_[node.first], &right = nodes_[node.first + 1];
      Entry a{node.first, entry(left.low, left.high, from, inverse, limit)};
      Entry b{node.first + 1, entry(right.low, right.high, from, inverse, limit)};
      if (a.distance < b.distance) std::swap(a, b);  // the nearer one last: it is taken first
      if (a.distance < kInfinity) stack[height++] = a;
      if (b.distance < kInfinity) stack[height++] = b;
      continue;
    }
    for (std::uint32_t i = node.first; i < node.first + node.count; ++i) {
      // Möller and Trumbore, 1997.
      const Triangle& t = triangles_[i];
      const Vector3f p = direction.cross(t.edge2);
      const float determinant = t.edge1.dot(p);
      if (determinant == 0.F) continue;
      const float f = 1 / determinant;
      const Vector3f s = origin - t.corner;
      const float u = f * s.dot(p);
      if (u < 0 || u > 1) continue;
      const Vector3f q = s.cross(t.edge1);
      const float v = f * direction.dot(q);
      if (v < 0 || u + v > 1) continue;
      const float distance = f * t.edge2.dot(q);
      if (distance > 0 && distance < limit) {
        limit = distance;
        best = Hit{distance, i};
      }
    }
  }
  return best;
}
}  // namespace binpick::emulators
