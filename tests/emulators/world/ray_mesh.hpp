#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <optional>
#include <vector>

#include "vision/mesh.hpp"

namespace binpick::emulators {
/// A mesh that rays can be cast at: triangles in a tree of bounding boxes. Immutable; shared by all objects of a part.
class RayMesh {
 public:
  explicit RayMesh(const vision::Mesh& mesh);

  struct Hit {
    float distance_mm = 0;
    std::uint32_t triangle = 0;
  };
  /// First triangle met from either side within (0, limit_mm). `direction` has length 1.
  std::optional<Hit> cast(const Eigen::Vector3f& origin_mm, const Eigen::Vector3f& direction, float limit_mm) const;
  /// Length 1, outwards.
  const Eigen::Vector3f& normal(std::uint32_t triangle) const { return triangles_[triangle].normal; }
  const Eigen::AlignedBox3f& box() const { return box_; }

  struct Triangle {
    Eigen::Vector3f corner, edge1, edge2, normal;
  };
  /// A leaf holds `count` triangles from `first` on; an inner node (count 0) has its children at `first` and the next.
  struct Node {
    Eigen::Array4f low, high;  // x, y, z and a fourth axis without an end, so that one register holds a corner
    std::uint32_t first = 0;
    std::uint32_t count = 0;
  };
  /// The tree itself, for those who cast many rays at once (ray_bundle.hpp). Node 0 is the root.
  struct View {
    const Node* nodes;
    const Triangle* triangles;
  };
  View view() const { return {nodes_.data(), triangles_.data()}; }

 private:
  std::vector<Triangle> triangles_;
  std::vector<Node> nodes_;
  Eigen::AlignedBox3f box_;
};
}  // namespace binpick::emulators
