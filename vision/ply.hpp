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
/// What a PLY file holds for us: vertices x y z (float or double) and, when asked for, faces as triangles.
struct Ply {
  std::vector<Eigen::Vector3f> vertices;                ///< As they stand in the file, also those that are not finite.
  std::vector<std::array<std::uint32_t, 3>> triangles;  ///< Faces of more corners as fans; indices are in range.
};
/// ASCII or binary little-endian; other properties and elements are skipped. No count of the file is trusted.
/// Source: Turk, "The PLY Polygon File Format" (1994).
Expected<Ply, std::string> parse_ply(std::span<const std::byte> bytes, bool with_faces);
}  // namespace binpick::vision
