#include "tests/emulators/world/example_parts.hpp"

#include <array>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <numbers>
#include <sstream>
#include <stdexcept>

#include "base/check.hpp"
#include "base/rotation.hpp"
#include "tests/emulators/world/example_grasps.hpp"
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

ExamplePart gear_shaft() {
  constexpr float z0 = -90;
  const std::vector<shapes::Section> sections{{-50, 15, 0}, {-15, 20, 0}, {30, 30, 4.5F}, {45, 23, 0}, {90, 17.5F, 0}};
  ExamplePart part{.name = "gear_shaft",
                   .scanner = "lms400",
                   .symmetry = "turning about z by 15 degrees (24 teeth); the two ends differ",
                   .mesh = shapes::turn(z0, sections, 96),
                   .pieces = {},
                   .gripper = {},
                   .grasps = {}};
  float z = z0;
  for (const auto& section : sections) {
    part.pieces.push_back(cylinder_piece(section.radius_mm, z, section.z_end_mm, 24));
    z = section.z_end_mm;
  }
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
                   .gripper = {},
                   .grasps = {}};
  // Bores and recess are filled: no corner of a neighbour reaches far into them.
  part.pieces = {chamfered_piece(high_lug, lug_half, chamfer, -25, 25),
                 chamfered_piece(low_lug, lug_half, chamfer, -13, 13), box_piece({-20, -40, -25}, {20, 40, 3})};
  return part;
}

ExamplePart steering_wheel() {
  constexpr float rim = 170, tube = 15;
  ExamplePart part{.name = "steering_wheel",
                   .scanner = "lms400",
                   .symmetry = "turning about z by 120 degrees (three spokes); the hub lies below the rim",
                   .mesh = shapes::torus(rim, tube, 72, 14),
                   .pieces = {},
                   .gripper = {},
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
                   .gripper = {},
                   .grasps = {}};
  part.pieces = {box_piece({-30, -9, 2}, {-8, 9, 6}), box_piece({8, -9, 2}, {30, 9, 6}),
                 box_piece({-8, -5.4F, 2}, {8, 5.4F, 6}), box_piece({-30, -9, -6}, {-18, 9, 2}),
                 box_piece({18, -9, -6}, {30, 9, 2})};
  return part;
}

void write_file(const std::filesystem::path& path, std::string_view content) {
  std::ofstream out{path, std::ios::binary};
  out.write(content.data(), static_cast<std::streamsize>(content.size()));
  if (!out.flush()) throw std::runtime_error{path.string() + ": cannot be written; check folder and free space"};
}
}  // namespace

vision::Grasp ExampleGrasp::grasp() const {
  vision::Grasp grasp;
  grasp.name = name;
  grasp.T_object_tcp.iso.linear() = from_wpr_deg(rpy_deg);
  grasp.T_object_tcp.iso.translation() = xyz_mm;
  grasp.approach_mm = approach_mm;
  grasp.opening_mm = opening_mm;
  grasp.holding_mm = holding_mm;
  grasp.preference = preference;
  return grasp;
}

const std::vector<std::string>& example_part_names() {
  static const std::vector<std::string> names{"gear_shaft", "track_link", "steering_wheel", "contact_bridge"};
  return names;
}

namespace {
ExamplePart body_named(std::string_view name) {
  if (name == "gear_shaft") return gear_shaft();
  if (name == "track_link") return track_link();
  if (name == "steering_wheel") return steering_wheel();
  BINPICK_CHECK(name == "contact_bridge");
  return contact_bridge();
}
}  // namespace

ExamplePart example_part(std::string_view name) {
  ExamplePart part = body_named(name);
  add_gripper(part);
  return part;
}

std::string write_example_part(std::string_view name, const std::string& folder, vision::Picking picking) {
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
  if (picking == vision::Picking::Conveyor) toml << "picking = \"conveyor\"\n";
  const auto list = [](const Vector3d& v) {
    std::ostringstream text;
    text << '[' << v.x() << ", " << v.y() << ", " << v.z() << ']';
    return text.str();
  };
  const vision::Gripper::Jaws& jaws = *part.gripper.jaws;
  toml << "\n[gripper]\nopening_max_mm = " << jaws.opening_max_mm << "\njaw_size_mm = " << list(jaws.size_mm)
       << "\nbeyond_mm = " << jaws.beyond_mm << '\n';
  for (const vision::Gripper::Solid& solid : part.gripper.body)
    toml << "\n[[gripper_body]]\nshape = \"" << (solid.shape == vision::Gripper::Solid::Shape::Box ? "box" : "cylinder")
         << "\"\nsize_mm = " << list(solid.size_mm)
         << "\nT_tcp_solid = { xyz_mm = " << list(solid.T_tcp_solid.translation()) << ", rpy_deg = [0, 0, 0] }\n";
  for (const ExampleGrasp& grasp : part.grasps)
    toml << "\n[[grasp]]\nname = \"" << grasp.name << "\"\nT_object_tcp = { xyz_mm = " << list(grasp.xyz_mm)
         << ", rpy_deg = " << list(grasp.rpy_deg) << " }\napproach_mm = " << grasp.approach_mm
         << "\nopening_mm = " << grasp.opening_mm << "\nholding_mm = " << grasp.holding_mm << '\n';
  const std::string path = base.string() + ".toml";
  write_file(path, toml.str());
  return path;
}
}  // namespace binpick::emulators
