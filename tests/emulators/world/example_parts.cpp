#include "tests/emulators/world/example_parts.hpp"

#include <array>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <numbers>
#include <sstream>
#include <stdexcept>

#include "base/check.hpp"
#include "tests/emulators/world/shapes.hpp"

namespace binpick::emulators {
using Eigen::Vector2f;
using Eigen::Vector3d;
using Eigen::Vector3f;

namespace {
constexpr float kPi = std::numbers::pi_v<float>;
}  // namespace

ConvexPiece box_piece(const Vector3f& low, const Vector3f& high) {
  ConvexPiece piece;
  for (int i = 0; i < 8; ++i)
    piece.points_mm.push_back({i & 1 ? high.x() : low.x(), i & 2 ? high.y() : low.y(), i & 4 ? high.z() : low.z()});
  return piece;
}

ConvexPiece cylinder_piece(float radius, float z_low, float z_high, int corners) {
  ConvexPiece piece;
  for (int i = 0; i < corners; ++i) {
    const float angle = 2 * kPi * static_cast<float>(i) / static_cast<float>(corners);
    for (const float z : {z_low, z_high})
      piece.points_mm.push_back({radius * std::cos(angle), radius * std::sin(angle), z});
  }
  return piece;
}

namespace {
/// Prism over a rectangle with cut corners.
ConvexPiece chamfered_piece(const Vector2f& centre, const Vector2f& half, float chamfer, float z_low, float z_high) {
  ConvexPiece piece;
  for (const float z : {z_low, z_high})
    for (const float sx : {-1.F, 1.F})
      for (const float sy : {-1.F, 1.F}) {
        piece.points_mm.push_back({centre.x() + sx * (half.x() - chamfer), centre.y() + sy * half.y(), z});
        piece.points_mm.push_back({centre.x() + sx * half.x(), centre.y() + sy * (half.y() - chamfer), z});
      }
  return piece;
}

bool in_chamfered(const Vector2f& p, const Vector2f& centre, const Vector2f& half, float chamfer) {
  const Vector2f d = (p - centre).cwiseAbs();
  return d.x() < half.x() && d.y() < half.y() && d.sum() < half.sum() - chamfer;
}

// Directions of approach as rpy_deg: where the tcp's z points in the object frame.
const Vector3d kDown{180, 0, 0};   // -z
const Vector3d kUp{0, 0, 0};       // +z
const Vector3d kAlongX{0, 90, 0};  // +x
const Vector3d kAgainstX{0, -90, 0};
const Vector3d kAlongY{-90, 0, 0};  // +y
const Vector3d kAgainstY{90, 0, 0};

ExamplePart gear_shaft() {
  constexpr float z0 = -90;
  const std::vector<shapes::Section> sections{{-50, 15, 0}, {-15, 20, 0}, {30, 30, 4.5F}, {45, 23, 0}, {90, 17.5F, 0}};
  ExamplePart part{.name = "gear_shaft",
                   .scanner = "lms400",
                   .symmetry = "turning about z by 15 degrees (24 teeth); the two ends differ",
                   .mesh = shapes::turn(z0, sections, 96),
                   .pieces = {},
                   .grasps = {}};
  float z = z0;
  for (const auto& section : sections) {
    part.pieces.push_back(cylinder_piece(section.radius_mm, z, section.z_end_mm, 24));
    z = section.z_end_mm;
  }
  part.grasps = {{"across", {30, 0, 7.5}, kAgainstX, 120},
                 {"long_end", {0, 0, 90}, kDown, 120},
                 {"short_end", {0, 0, -90}, kUp, 120}};
  return part;
}

ExamplePart track_link() {
  // Two lugs 80 × 80 beside each other, shifted by 40 mm, and a bridge between them. The lugs differ in height at the
  // top and at the bottom: however the link lies, its front is told from its back by 10 mm steps or more.
  const Vector2f lug_half{40, 40}, high_lug{-60, -20}, low_lug{60, 20}, bridge_half{20, 40};
  constexpr float chamfer = 20;
  const std::vector<float> levels{-25, -15, -13, 3, 13, 25};
  const std::array<shapes::Bore, 2> bores{shapes::Bore{high_lug, 22}, shapes::Bore{low_lug, 17}};
  const auto plane = shapes::grid(20, 12, 10, {bores.begin(), bores.end()}, [&](const Vector2f& p) {
    // A cut corner at (+, +) or (-, -) of its lug needs a falling edge.
    const Vector2f d = p - (p.x() < 0 ? high_lug : low_lug);
    return d.x() * d.y() < 0;
  });
  const auto solid = [&](const Vector2f& p, int layer) {
    const float z = 0.5F * (levels[static_cast<std::size_t>(layer)] + levels[static_cast<std::size_t>(layer) + 1]);
    for (const auto& bore : bores)
      if ((p - bore.centre_mm).norm() < 0.9F * bore.radius_mm) return false;
    if (p.x() < -20) return in_chamfered(p, high_lug, lug_half, chamfer);
    if (p.x() > 20) return z > -13 && z < 13 && in_chamfered(p, low_lug, lug_half, chamfer);
    const bool recess = z < -15 && std::abs(p.y()) < 20;
    return z < 3 && std::abs(p.y()) < bridge_half.y() && !recess;
  };
  ExamplePart part{.name = "track_link",
                   .scanner = "lms400",
                   .symmetry = "none",
                   .mesh = shapes::extrude(plane, levels, solid),
                   .pieces = {},
                   .grasps = {}};
  // Bores and recess are filled: no corner of a neighbour reaches far into them.
  part.pieces = {chamfered_piece(high_lug, lug_half, chamfer, -25, 25),
                 chamfered_piece(low_lug, lug_half, chamfer, -13, 13), box_piece({-20, -40, -25}, {20, 40, 3})};
  part.grasps = {{"top", {0, 0, 3}, kDown, 150},
                 {"bottom", {0, 0, -15}, kUp, 150},
                 {"high_end", {-100, -20, 0}, kAlongX, 150},
                 {"low_end", {100, 20, 0}, kAgainstX, 150},
                 {"side_left", {0, -40, -10}, kAlongY, 150},
                 {"side_right", {0, 40, -10}, kAgainstY, 150}};
  return part;
}

ExamplePart steering_wheel() {
  constexpr float rim = 170, tube = 15;
  ExamplePart part{.name = "steering_wheel",
                   .scanner = "lms400",
                   .symmetry = "turning about z by 120 degrees (three spokes); the hub lies below the rim",
                   .mesh = shapes::torus(rim, tube, 72, 14),
                   .pieces = {},
                   .grasps = {}};
  shapes::append(part.mesh, shapes::turn(-62, {{-34, 55, 0}, {-26, 42, 0}}, 36));
  part.pieces = {cylinder_piece(55, -62, -34, 18), cylinder_piece(42, -34, -26, 18)};
  for (int spoke = 0; spoke < 3; ++spoke) {
    const float angle = 2 * kPi * static_cast<float>(spoke) / 3;
    const Vector3f out{std::cos(angle), std::sin(angle), 0}, left{-out.y(), out.x(), 0}, up{0, 0, 1};
    std::array<Vector3f, 8> corners;
    for (std::size_t i = 0; i < 8; ++i) {
      const bool outer = i % 4 == 1 || i % 4 == 2, leftward = i % 4 >= 2, upper = i >= 4;
      corners[i] = out * (outer ? rim : 40.F) + left * (leftward ? 22.5F : -22.5F) +
                   up * ((outer ? 0.F : -46.F) + (upper ? 7.F : -7.F));
    }
    shapes::append(part.mesh, shapes::hexahedron(corners));
    part.pieces.push_back({{corners.begin(), corners.end()}});
  }
  // Straight pieces cut the corners of a round rim: half of the sagitta is given back.
  constexpr int rim_pieces = 24, rings = 8;
  constexpr float outwards = 0.8F;
  for (int piece = 0; piece < rim_pieces; ++piece) {
    ConvexPiece segment;
    for (const int end : {piece, piece + 1}) {
      const float u = 2 * kPi * static_cast<float>(end) / rim_pieces;
      for (int ring = 0; ring < rings; ++ring) {
        const float v = 2 * kPi * static_cast<float>(ring) / rings;
        const float radius = rim + outwards + tube * std::cos(v);
        segment.points_mm.push_back({radius * std::cos(u), radius * std::sin(u), tube * std::sin(v)});
      }
    }
    part.pieces.push_back(std::move(segment));
  }
  part.grasps = {{"hub_top", {0, 0, -26}, kDown, 150}, {"hub_bottom", {0, 0, -62}, kUp, 150}};
  // Standing or leaning wheels are taken at the rim, at a spoke or opposite to one (the symmetry adds the others).
  part.grasps.push_back({"rim_at_spoke", {185, 0, 0}, kAgainstX, 150});
  part.grasps.push_back({"rim_between", {-185, 0, 0}, kAlongX, 150});
  return part;
}

ExamplePart contact_bridge() {
  const std::vector<float> levels{-6, 2, 6};
  const auto plane = shapes::grid(30, 10, 1.8F, {}, [](const Vector2f& p) { return p.x() * p.y() < 0; });
  // The grid's cells are square; x is stretched to 2 mm a cell, 60 mm in all.
  auto stretched = plane;
  for (auto& p : stretched.points_mm) p.x() *= 2.F / 1.8F;
  const auto solid = [](const Vector2f& p, int layer) {
    const float x = std::abs(p.x()), y = std::abs(p.y());
    if (layer == 0) return x > 18 && y < 9;  // contact blocks
    if (x < 8) return y < 5.4F;              // waist
    return x / 2 + y / 1.8F < 15 + 5 - 2;    // bar with cut corners
  };
  ExamplePart part{.name = "contact_bridge",
                   .scanner = "lps36",
                   .symmetry = "turning about z by 180 degrees",
                   .mesh = shapes::extrude(stretched, levels, solid),
                   .pieces = {},
                   .grasps = {}};
  part.pieces = {box_piece({-30, -9, 2}, {-8, 9, 6}), box_piece({8, -9, 2}, {30, 9, 6}),
                 box_piece({-8, -5.4F, 2}, {8, 5.4F, 6}), box_piece({-30, -9, -6}, {-18, 9, 2}),
                 box_piece({18, -9, -6}, {30, 9, 2})};
  part.grasps = {{"top", {0, 0, 6}, kDown, 60},
                 {"bottom", {0, 0, 2}, kUp, 60},
                 {"end", {30, 0, 2}, kAgainstX, 60},
                 {"side_left", {0, -5.4, 4}, kAlongY, 60},
                 {"side_right", {0, 5.4, 4}, kAgainstY, 60}};
  return part;
}

void write_file(const std::filesystem::path& path, std::string_view content) {
  std::ofstream out{path, std::ios::binary};
  out.write(content.data(), static_cast<std::streamsize>(content.size()));
  if (!out.flush()) throw std::runtime_error{path.string() + ": cannot be written; check folder and free space"};
}
}  // namespace

const std::vector<std::string>& example_part_names() {
  static const std::vector<std::string> names{"gear_shaft", "track_link", "steering_wheel", "contact_bridge"};
  return names;
}

ExamplePart example_part(std::string_view name) {
  if (name == "gear_shaft") return gear_shaft();
  if (name == "track_link") return track_link();
  if (name == "steering_wheel") return steering_wheel();
  BINPICK_CHECK(name == "contact_bridge");
  return contact_bridge();
}

std::string write_example_part(std::string_view name, const std::string& folder) {
  const ExamplePart part = example_part(name);
  std::error_code failure;
  std::filesystem::create_directories(folder, failure);
  if (failure) throw std::runtime_error{folder + ": " + failure.message()};
  const std::filesystem::path base = std::filesystem::path{folder} / part.name;
  if (const auto saved = vision::save_stl(part.mesh, base.string() + ".stl"); !saved)
    throw std::runtime_error{saved.error().text};
  std::ostringstream toml;
  toml << "# " << part.name << ", an example part. Symmetry: " << part.symmetry << ".\n"
       << "mesh = \"" << part.name << ".stl\"\nscanner = \"" << part.scanner << "\"\n";
  const auto list = [](const Vector3d& v) {
    std::ostringstream text;
    text << '[' << v.x() << ", " << v.y() << ", " << v.z() << ']';
    return text.str();
  };
  for (const ExampleGrasp& grasp : part.grasps)
    toml << "\n[[grasp]]\nname = \"" << grasp.name << "\"\nT_object_tcp = { xyz_mm = " << list(grasp.xyz_mm)
         << ", rpy_deg = " << list(grasp.rpy_deg) << " }\napproach_mm = " << grasp.approach_mm << '\n';
  const std::string path = base.string() + ".toml";
  write_file(path, toml.str());
  return path;
}
}  // namespace binpick::emulators
