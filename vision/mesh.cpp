#include "vision/mesh.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <bit>
#include <cctype>
#include <cmath>
#include <cstring>
#include <numbers>
#include <unordered_map>

#include "vision/file.hpp"
#include "vision/mesh_file.hpp"

namespace binpick::vision {
namespace {
using Triangle = std::array<std::uint32_t, 3>;
constexpr std::size_t kTrianglesMax = 5'000'000;

std::uint64_t mixed(std::uint64_t hash, std::uint32_t word) {
  // FNV-1a, a word at a time.
  return (hash ^ word) * 0x100000001B3ULL;
}

struct PlaceHash {
  std::size_t operator()(const std::array<std::uint32_t, 3>& place) const {
    std::uint64_t hash = 0xCBF29CE484222325ULL;
    for (const std::uint32_t word : place) hash = mixed(hash, word);
    return static_cast<std::size_t>(hash ^ (hash >> 29));
  }
};

std::array<std::uint32_t, 3> place_of(const Eigen::Vector3f& p) {
  // Adding zero makes -0 and 0 the same place.
  return {std::bit_cast<std::uint32_t>(p.x() + 0.0F), std::bit_cast<std::uint32_t>(p.y() + 0.0F),
          std::bit_cast<std::uint32_t>(p.z() + 0.0F)};
}

double twice_area(const Mesh& mesh, const Triangle& t) {
  const Eigen::Vector3d a = mesh.vertices_mm[t[0]].cast<double>();
  return (mesh.vertices_mm[t[1]].cast<double>() - a).cross(mesh.vertices_mm[t[2]].cast<double>() - a).norm();
}

/// The vertices that are farthest in some direction: all that can span the diameter, but for a relative error of 1e-3.
std::vector<Eigen::Vector3f> extreme_points(const std::vector<Eigen::Vector3f>& points) {
  constexpr int kDirections = 2000;
  std::vector<std::size_t> chosen;
  for (int i = 0; i < kDirections; ++i) {
    const double z = 1 - (2 * i + 1.0) / kDirections;
    const double turn = i * std::numbers::pi * (3 - std::sqrt(5.0));
    const double r = std::sqrt(1 - z * z);
    const Eigen::Vector3f direction = Eigen::Vector3d(r * std::cos(turn), r * std::sin(turn), z).cast<float>();
    std::size_t best = 0;
    float most = -std::numeric_limits<float>::infinity();
    for (std::size_t k = 0; k < points.size(); ++k)
      if (const float along = points[k].dot(direction); along > most) most = along, best = k;
    chosen.push_back(best);
  }
  std::ranges::sort(chosen);
  chosen.erase(std::unique(chosen.begin(), chosen.end()), chosen.end());
  std::vector<Eigen::Vector3f> extremes;
  for (const std::size_t k : chosen) extremes.push_back(points[k]);
  return extremes;
}

}  // namespace

double Mesh::diameter_mm() const {
  const std::vector<Eigen::Vector3f> points = vertices_mm.size() > 3000 ? extreme_points(vertices_mm) : vertices_mm;
  double most = 0;
  for (std::size_t i = 0; i < points.size(); ++i)
    for (std::size_t k = i + 1; k < points.size(); ++k)
      most = std::max(most, static_cast<double>((points[i] - points[k]).squaredNorm()));
  return std::sqrt(most);
}

Eigen::Vector3d Mesh::centroid_mm() const {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  double area = 0;
  for (const Triangle& t : triangles) {
    const double a = twice_area(*this, t);
    sum += a / 3 *
           (vertices_mm[t[0]].cast<double>() + vertices_mm[t[1]].cast<double>() + vertices_mm[t[2]].cast<double>());
    area += a;
  }
  return area > 0 ? Eigen::Vector3d(sum / area) : Eigen::Vector3d::Zero();
}

Mesh cleaned(const Mesh& mesh) {
  Mesh merged;
  std::unordered_map<std::array<std::uint32_t, 3>, std::uint32_t, PlaceHash> known;
  std::unordered_map<std::array<std::uint32_t, 3>, bool, PlaceHash> seen;
  const auto index_of = [&](std::uint32_t vertex) {
    const Eigen::Vector3f& p = mesh.vertices_mm[vertex];
    const auto [place, fresh] = known.try_emplace(place_of(p), static_cast<std::uint32_t>(merged.vertices_mm.size()));
    if (fresh) merged.vertices_mm.push_back(p);
    return place->second;
  };
  for (const Triangle& t : mesh.triangles) {
    if (!(twice_area(mesh, t) > 0)) continue;
    Triangle now{index_of(t[0]), index_of(t[1]), index_of(t[2])};
    if (now[0] == now[1] || now[1] == now[2] || now[0] == now[2]) continue;
    std::rotate(now.begin(), std::min_element(now.begin(), now.end()),
                now.end());  // The same triangle has one spelling.
    if (seen.try_emplace(now, true).second) merged.triangles.push_back(now);
  }
  return merged;
}

Expected<Mesh, MeshError> parse_mesh(std::span<const std::byte> bytes, const std::string& format, double unit_mm,
                                     const std::string& name) {
  const auto failed = [&](const std::string& why) { return unexpected(MeshError{"mesh " + name + ": " + why}); };
  if (bytes.empty()) return failed("the file is empty; export the part again");
  auto read = format == "stl" ? read_stl(bytes) : format == "obj" ? read_obj(bytes) : read_ply_mesh(bytes);
  if (!read) return failed(read.error());
  Mesh mesh = std::move(*read);
  for (Eigen::Vector3f& v : mesh.vertices_mm) {
    v = (v.cast<double>() * unit_mm).cast<float>();
    if (!v.allFinite()) return failed("a vertex is not a finite number; repair the mesh and export it again");
  }
  if (mesh.triangles.size() > kTrianglesMax)
    return failed("has " + std::to_string(mesh.triangles.size()) + " triangles, more than " +
                  std::to_string(kTrianglesMax) + "; export it with a coarser tolerance");
  mesh = cleaned(mesh);
  if (mesh.triangles.empty())
    return failed("holds no triangle with an area; export the part as a surface mesh, not as points or lines");
  return mesh;
}

Expected<Mesh, MeshError> load_mesh(const std::string& path, double unit_mm) {
  const std::size_t dot = path.rfind('.');
  std::string format = dot == std::string::npos ? "" : path.substr(dot + 1);
  std::ranges::transform(format, format.begin(), [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  if (format != "stl" && format != "obj" && format != "ply")
    return unexpected(MeshError{"mesh " + path + ": the format is told by the name; use .stl, .obj or .ply"});
  if (!(unit_mm > 0) || !std::isfinite(unit_mm))
    return unexpected(MeshError{"mesh " + path + ": the unit must be a positive length; use 1 for millimetres"});
  const auto bytes = read_file(path);
  if (!bytes) return unexpected(MeshError{"mesh: " + bytes.error()});
  return parse_mesh(*bytes, format, unit_mm, path);
}

Expected<void, MeshError> save_stl(const Mesh& mesh, const std::string& path) {
  static_assert(std::endian::native == std::endian::little);
  std::vector<std::byte> bytes(84 + 50 * mesh.triangles.size());
  constexpr char kTitle[] = "binpick, millimetres";
  std::memcpy(bytes.data(), kTitle, sizeof kTitle);
  const auto count = static_cast<std::uint32_t>(mesh.triangles.size());
  std::memcpy(bytes.data() + 80, &count, 4);
  std::byte* out = bytes.data() + 84;
  for (const Triangle& t : mesh.triangles) {
    const Eigen::Vector3f &a = mesh.vertices_mm[t[0]], &b = mesh.vertices_mm[t[1]], &c = mesh.vertices_mm[t[2]];
    const Eigen::Vector3f normal = (b - a).cross(c - a).normalized();
    for (const Eigen::Vector3f& v : {normal, a, b, c}) {
      std::memcpy(out, v.data(), 12);
      out += 12;
    }
    out += 2;
  }
  if (const auto written = write_file(path, bytes); !written) return unexpected(MeshError{"mesh: " + written.error()});
  return {};
}

std::uint64_t mesh_hash(const Mesh& mesh) {
  std::uint64_t hash = 0xCBF29CE484222325ULL;
  for (const Triangle& t : mesh.triangles)
    for (const std::uint32_t v : t)
      for (const std::uint32_t word : place_of(mesh.vertices_mm[v])) hash = mixed(hash, word);
  return hash;
}
}  // namespace binpick::vision
