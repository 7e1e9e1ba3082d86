#include "tests/emulators/world/shapes.hpp"

#include <cmath>
#include <map>
#include <numbers>
#include <utility>

namespace binpick::emulators::shapes {
namespace {
using Index = std::uint32_t;
using Eigen::Vector2f;
using Eigen::Vector3f;

/// Gives equal points one index; a tenth of a micrometre counts as equal.
class PointIndex {
 public:
  explicit PointIndex(std::vector<Vector2f>& points) : points_{points} {}
  Index operator()(const Vector2f& p) {
    const auto key = std::pair{std::lround(p.x() * 1e4F), std::lround(p.y() * 1e4F)};
    const auto [it, fresh] = index_.try_emplace(key, static_cast<Index>(points_.size()));
    if (fresh) points_.push_back(p);
    return it->second;
  }

 private:
  std::vector<Vector2f>& points_;
  std::map<std::pair<long, long>, Index> index_;
};

constexpr int kBoreCells = 6;  // edge of the square around a bore, in cells

void add_bore(Plane& plane, PointIndex& index, const Bore& bore, float cell_mm) {
  constexpr int n = 4 * kBoreCells;
  const float half = 0.5F * kBoreCells * cell_mm;
  std::array<Index, n> outer{}, inner{};
  for (int i = 0; i < n; ++i) {
    const float along = -half + static_cast<float>(i % kBoreCells) * cell_mm;
    const std::array<Vector2f, 4> side{Vector2f{along, -half}, Vector2f{half, along}, Vector2f{-along, half},
                                       Vector2f{-half, -along}};
    outer[static_cast<std::size_t>(i)] = index(bore.centre_mm + side[static_cast<std::size_t>(i / kBoreCells)]);
    const float angle = std::numbers::pi_v<float> * (-0.75F + 2.F * static_cast<float>(i) / n);
    inner[static_cast<std::size_t>(i)] =
        index(bore.centre_mm + bore.radius_mm * Vector2f{std::cos(angle), std::sin(angle)});
  }
  const Index centre = index(bore.centre_mm);
  for (std::size_t i = 0; i < n; ++i) {
    const std::size_t j = (i + 1) % n;
    plane.triangles.push_back({outer[i], outer[j], inner[j]});
    plane.triangles.push_back({outer[i], inner[j], inner[i]});
    plane.triangles.push_back({centre, inner[i], inner[j]});
  }
}
}  // namespace

Plane grid(int columns, int rows, float cell_mm, const std::vector<Bore>& bores,
           const std::function<bool(const Vector2f&)>& rising_diagonal) {
  Plane plane;
  PointIndex index{plane.points_mm};
  const Vector2f corner{-0.5F * static_cast<float>(columns) * cell_mm, -0.5F * static_cast<float>(rows) * cell_mm};
  for (int row = 0; row < rows; ++row) {
    for (int column = 0; column < columns; ++column) {
      const Vector2f low = corner + cell_mm * Vector2f{static_cast<float>(column), static_cast<float>(row)};
      const Vector2f middle = low + Vector2f::Constant(0.5F * cell_mm);
      bool in_bore_square = false;
      for (const Bore& bore : bores)
        in_bore_square |= (middle - bore.centre_mm).cwiseAbs().maxCoeff() < 0.5F * kBoreCells * cell_mm;
      if (in_bore_square) continue;
      const Index a = index(low), b = index(low + Vector2f{cell_mm, 0}), c = index(low + Vector2f{cell_mm, cell_mm}),
                  d = index(low + Vector2f{0, cell_mm});
      if (rising_diagonal(middle)) {
        plane.triangles.push_back({a, b, c});
        plane.triangles.push_back({a, c, d});
      } else {
        plane.triangles.push_back({a, b, d});
        plane.triangles.push_back({b, c, d});
      }
    }
  }
  for (const Bore& bore : bores) add_bore(plane, index, bore, cell_mm);
  return plane;
}

vision::Mesh extrude(const Plane& plane, const std::vector<float>& levels_mm,
                     const std::function<bool(const Vector2f&, int)>& solid) {
  vision::Mesh mesh;
  std::map<std::pair<Index, std::size_t>, Index> vertex_index;
  const auto vertex = [&](Index point, std::size_t level) {
    const auto [it, fresh] = vertex_index.try_emplace({point, level}, static_cast<Index>(mesh.vertices_mm.size()));
    if (fresh) mesh.vertices_mm.push_back({plane.points_mm[point].x(), plane.points_mm[point].y(), levels_mm[level]});
    return it->second;
  };
  const std::size_t layers = levels_mm.size() - 1;
  std::vector<std::vector<bool>> filled(plane.triangles.size(), std::vector<bool>(layers));
  std::map<std::pair<Index, Index>, std::size_t> triangle_of_edge;
  for (std::size_t t = 0; t < plane.triangles.size(); ++t) {
    const auto& [a, b, c] = plane.triangles[t];
    const Vector2f centroid = (plane.points_mm[a] + plane.points_mm[b] + plane.points_mm[c]) / 3;
    for (std::size_t l = 0; l < layers; ++l) filled[t][l] = solid(centroid, static_cast<int>(l));
    triangle_of_edge[{a, b}] = t;
    triangle_of_edge[{b, c}] = t;
    triangle_of_edge[{c, a}] = t;
  }
  for (std::size_t t = 0; t < plane.triangles.size(); ++t) {
    const auto& corners = plane.triangles[t];
    for (std::size_t level = 0; level <= layers; ++level) {
      const bool below = level > 0 && filled[t][level - 1];
      const bool above = level < layers && filled[t][level];
      if (below == above) continue;
      const Index a = vertex(corners[0], level), b = vertex(corners[1], level), c = vertex(corners[2], level);
      if (below)
        mesh.triangles.push_back({a, b, c});
      else
        mesh.triangles.push_back({a, c, b});
    }
    for (std::size_t edge = 0; edge < 3; ++edge) {
      const Index a = corners[edge], b = corners[(edge + 1) % 3];
      const auto beyond = triangle_of_edge.find({b, a});
      for (std::size_t l = 0; l < layers; ++l) {
        if (!filled[t][l] || (beyond != triangle_of_edge.end() && filled[beyond->second][l])) continue;
        const Index al = vertex(a, l), bl = vertex(b, l), bu = vertex(b, l + 1), au = vertex(a, l + 1);
        mesh.triangles.push_back({al, bl, bu});
        mesh.triangles.push_back({al, bu, au});
      }
    }
  }
  return mesh;
}

vision::Mesh turn(float z_begin_mm, const std::vector<Section>& sections, int segments) {
  vision::Mesh mesh;
  const auto n = static_cast<Index>(segments);
  const auto add_ring = [&](float z, const Section& section) {
    for (Index i = 0; i < n; ++i) {
      const float angle = 2 * std::numbers::pi_v<float> * static_cast<float>(i) / static_cast<float>(n);
      const float radius = section.radius_mm - (i % 4 < 2 ? 0.F : section.tooth_depth_mm);
      mesh.vertices_mm.push_back({radius * std::cos(angle), radius * std::sin(angle), z});
    }
  };
  float z = z_begin_mm;
  for (const Section& section : sections) {
    add_ring(z, section);
    z = section.z_end_mm;
    add_ring(z, section);
  }
  const auto rings = static_cast<Index>(2 * sections.size());
  for (Index ring = 0; ring + 1 < rings; ++ring) {
    for (Index i = 0; i < n; ++i) {
      const Index a = ring * n + i, b = ring * n + (i + 1) % n;
      mesh.triangles.push_back({a, b, b + n});
      mesh.triangles.push_back({a, b + n, a + n});
    }
  }
  const auto bottom = static_cast<Index>(mesh.vertices_mm.size());
  mesh.vertices_mm.push_back({0, 0, z_begin_mm});
  mesh.vertices_mm.push_back({0, 0, z});
  for (Index i = 0; i < n; ++i) {
    const Index j = (i + 1) % n;
    mesh.triangles.push_back({bottom, j, i});
    mesh.triangles.push_back({bottom + 1, (rings - 1) * n + i, (rings - 1) * n + j});
  }
  return mesh;
}

vision::Mesh torus(float major_radius_mm, float tube_radius_mm, int segments, int tube_segments) {
  vision::Mesh mesh;
  const auto n = static_cast<Index>(segments), m = static_cast<Index>(tube_segments);
  for (Index i = 0; i < n; ++i) {
    const float u = 2 * std::numbers::pi_v<float> * static_cast<float>(i) / static_cast<float>(n);
    for (Index j = 0; j < m; ++j) {
      const float v = 2 * std::numbers::pi_v<float> * static_cast<float>(j) / static_cast<float>(m);
      const float radius = major_radius_mm + tube_radius_mm * std::cos(v);
      mesh.vertices_mm.push_back({radius * std::cos(u), radius * std::sin(u), tube_radius_mm * std::sin(v)});
    }
  }
  for (Index i = 0; i < n; ++i) {
    for (Index j = 0; j < m; ++j) {
      const Index a = i * m + j, b = ((i + 1) % n) * m + j, c = ((i + 1) % n) * m + (j + 1) % m,
                  d = i * m + (j + 1) % m;
      mesh.triangles.push_back({a, b, c});
      mesh.triangles.push_back({a, c, d});
    }
  }
  return mesh;
}

vision::Mesh hexahedron(const std::array<Vector3f, 8>& corners_mm) {
  vision::Mesh mesh;
  mesh.vertices_mm.assign(corners_mm.begin(), corners_mm.end());
  constexpr std::array<std::array<Index, 4>, 6> faces{
      {{0, 3, 2, 1}, {4, 5, 6, 7}, {0, 1, 5, 4}, {1, 2, 6, 5}, {2, 3, 7, 6}, {3, 0, 4, 7}}};
  for (const auto& [a, b, c, d] : faces) {
    mesh.triangles.push_back({a, b, c});
    mesh.triangles.push_back({a, c, d});
  }
  return mesh;
}

void append(vision::Mesh& mesh, const vision::Mesh& other) {
  const auto offset = static_cast<Index>(mesh.vertices_mm.size());
  mesh.vertices_mm.insert(mesh.vertices_mm.end(), other.vertices_mm.begin(), other.vertices_mm.end());
  for (const auto& [a, b, c] : other.triangles) mesh.triangles.push_back({a + offset, b + offset, c + offset});
}
}  // namespace binpick::emulators::shapes
