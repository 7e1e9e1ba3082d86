#pragma once

#include <cstddef>
#include <span>
#include <string>

#include "base/expected.hpp"
#include "vision/mesh.hpp"

/// Mesh files as they stand: coordinates in the file's unit, vertices neither merged nor checked, indices in range.
/// Errors are texts: what, where in the file, what to do. No count of a file is trusted.
namespace binpick::vision {
/// Binary or ASCII; which of them is told by the length, since binary files may begin with "solid", too.
Expected<Mesh, std::string> read_stl(std::span<const std::byte> bytes);
/// Wavefront OBJ: lines v and f, faces of more corners as fans; everything else is skipped.
Expected<Mesh, std::string> read_obj(std::span<const std::byte> bytes);
Expected<Mesh, std::string> read_ply_mesh(std::span<const std::byte> bytes);
}  // namespace binpick::vision
