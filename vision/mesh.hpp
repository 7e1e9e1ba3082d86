#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "base/expected.hpp"

namespace binpick::vision {
/// A triangle mesh in its own (object) frame, millimetres. Degenerate triangles are gone, vertices are merged.
struct Mesh {
  std::vector<Eigen::Vector3f> vertices_mm;
  std::vector<std::array<std::uint32_t, 3>> triangles;  ///< Counter-clockwise from outside.

  double diameter_mm() const;           ///< Largest distance of two vertices.
  Eigen::Vector3d centroid_mm() const;  ///< Of the surface, by area.
};

struct MeshError {
  std::string text;  ///< What, where, what to do.
};

/// Reads STL, OBJ or PLY. `unit_mm` is the length of one file unit. No triangles, non-finite vertices or an
/// unreadable file are errors.
Expected<Mesh, MeshError> load_mesh(const std::string& path, double unit_mm);
/// The same for a file's bytes; `format` is "stl", "obj" or "ply", `name` stands in the messages.
Expected<Mesh, MeshError> parse_mesh(std::span<const std::byte> bytes, const std::string& format, double unit_mm,
                                     const std::string& name);
/// Merges vertices of equal place, drops degenerate and duplicate triangles and vertices that nobody uses.
Mesh cleaned(const Mesh& mesh);
/// Binary STL, millimetres.
Expected<void, MeshError> save_stl(const Mesh& mesh, const std::string& path);
/// Of the triangles' coordinates, in order: a knowledge base names the mesh it was trained from by this.
std::uint64_t mesh_hash(const Mesh& mesh);
}  // namespace binpick::vision
