#pragma once

#include "vision/mesh.hpp"

namespace binpick::vision {
/// Fewer triangles for the same surface: no point of the one surface is farther than `error_mm` from the other (checked
/// at all vertices and, with the same density, between them). Edges and corners sharper than the error stay. A mesh
/// that does not get smaller so comes back as it is. Method: half-edge collapse, least deviation first, the deviations
/// of a place summed up.
Mesh decimated(const Mesh& mesh, double error_mm);
}  // namespace binpick::vision
