#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <functional>
#include <vector>

#include "vision/mesh.hpp"

/// Small builders of closed triangle meshes, millimetres. Outsides are counter-clockwise.
namespace binpick::emulators::shapes {
/// A triangulated region of the plane.
struct Plane {
  std::vector<Eigen::Vector2f> points_mm;
  std::vector<std::array<std::uint32_t, 3>> triangles;  ///< Counter-clockwise.
};

/// A round hole in the grid: the cells of the square around it are replaced by a ring that fits a 24-gon.
struct Bore {
  Eigen::Vector2f centre_mm;
  float radius_mm = 0;
};

/// A regular grid of `columns` × `rows` cells of edge `cell_mm`, centred. Every cell is cut along one diagonal, so that
/// corners may be chamfered. Around each bore a square of 6 × 6 cells gives way; it must lie on grid lines.
Plane grid(int columns, int rows, float cell_mm, const std::vector<Bore>& bores,
           const std::function<bool(const Eigen::Vector2f& cell_centre_mm)>& rising_diagonal);

/// Solid of layers: layer i lies between levels_mm[i] and [i + 1], and is filled over each triangle for which `solid`
/// says so of the triangle's centroid. One watertight surface without inner faces.
vision::Mesh extrude(const Plane& plane, const std::vector<float>& levels_mm,
                     const std::function<bool(const Eigen::Vector2f& centroid_mm, int layer)>& solid);

/// One section of a turned part: from the end of the one before to `z_end_mm`.
struct Section {
  float z_end_mm = 0;
  float radius_mm = 0;
  float tooth_depth_mm = 0;  ///< 0: round. Else teeth of four segments each: two at the radius, two this much lower.
};
/// Turned part about z, closed at both ends.
vision::Mesh turn(float z_begin_mm, const std::vector<Section>& sections, int segments);

/// Torus about z in the plane z = 0.
vision::Mesh torus(float major_radius_mm, float tube_radius_mm, int segments, int tube_segments);

/// Six faces over eight corners: 0…3 counter-clockwise seen from above at the bottom, 4…7 above them.
vision::Mesh hexahedron(const std::array<Eigen::Vector3f, 8>& corners_mm);

void append(vision::Mesh& mesh, const vision::Mesh& other);
}  // namespace binpick::emulators::shapes
