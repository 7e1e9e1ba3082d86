#include <cmath>
#include <numbers>

#include "base/check.hpp"
#include "bench/scenes/parts.hpp"
#include "tests/emulators/world/shapes.hpp"

namespace binpick::bench {
namespace {
using Eigen::Vector2f;
using emulators::box_piece;
using emulators::cylinder_piece;
using emulators::ExamplePart;
namespace shapes = emulators::shapes;

/// A disc cut by circles and rays, so that a solid may end at each of them.
shapes::Plane disc(const std::vector<float>& radii_mm, std::uint32_t segments) {
  shapes::Plane plane;
  plane.points_mm.push_back(Vector2f::Zero());
  for (const float radius : radii_mm)
    for (std::uint32_t i = 0; i < segments; ++i) {
      const float angle = 2 * std::numbers::pi_v<float> * static_cast<float>(i) / static_cast<float>(segments);
      plane.points_mm.push_back(radius * Vector2f{std::cos(angle), std::sin(angle)});
    }
  const auto at = [&](std::uint32_t ring, std::uint32_t i) { return 1 + ring * segments + i % segments; };
  for (std::uint32_t i = 0; i < segments; ++i) {
    plane.triangles.push_back({0, at(0, i), at(0, i + 1)});
    for (std::uint32_t ring = 1; ring < radii_mm.size(); ++ring) {
      plane.triangles.push_back({at(ring - 1, i), at(ring, i), at(ring, i + 1)});
      plane.triangles.push_back({at(ring - 1, i), at(ring, i + 1), at(ring - 1, i + 1)});
    }
  }
  return plane;
}

std::vector<float> even_levels(float from, float to, int layers) {
  std::vector<float> levels;
  for (int i = 0; i <= layers; ++i)
    levels.push_back(from + (to - from) * static_cast<float>(i) / static_cast<float>(layers));
  return levels;
}

ExamplePart named(std::string_view name, vision::Mesh mesh) {
  ExamplePart part{};
  part.name = name;
  part.mesh = std::move(mesh);
  return part;
}

ExamplePart stamped_plate() {
  const std::vector<float> levels{0, 2.4F, 6, 8.4F};
  const std::vector<shapes::Bore> bores{{{-22, -6}, 4.5F}, {{24, 8}, 3}};
  const auto plane = shapes::grid(36, 20, 2, bores, [](const Vector2f&) { return false; });
  const auto solid = [&](const Vector2f& p, int layer) {
    for (const auto& bore : bores)
      if ((p - bore.centre_mm).norm() < 0.95F * bore.radius_mm) return false;
    if (p.x() + p.y() < -44 || (p.x() < -24 && p.y() > 12)) return false;  // a cut corner and a notch
    if (p.x() > 12 && p.y() < -8) return false;                            // the upper deck is a tongue
    if (p.x() < 4) return layer == 0;
    return p.x() < 8 || layer == 2;  // the joggle's riser, then the upper deck
  };
  ExamplePart part = named("stamped_plate", shapes::extrude(plane, levels, solid));
  part.pieces = {box_piece({-36, -20, 0}, {4, 12, 2.4F}), box_piece({-24, 12, 0}, {4, 20, 2.4F}),
                 box_piece({4, -20, 0}, {8, 20, 8.4F}), box_piece({8, -8, 6}, {36, 20, 8.4F}),
                 box_piece({8, -20, 6}, {12, -8, 8.4F})};
  // The cut corner: six millimetres by six of a box that has none.
  part.pieces[0] = {{{-36, -8, 0},
                     {-24, -20, 0},
                     {4, -20, 0},
                     {4, 12, 0},
                     {-36, 12, 0},
                     {-36, -8, 2.4F},
                     {-24, -20, 2.4F},
                     {4, -20, 2.4F},
                     {4, 12, 2.4F},
                     {-36, 12, 2.4F}}};
  return part;
}

ExamplePart box_section() {
  const auto plane = shapes::grid(25, 20, 2, {}, [](const Vector2f&) { return false; });
  const auto solid = [](const Vector2f& p, int) { return std::abs(p.x()) > 21 || std::abs(p.y()) > 16; };
  ExamplePart part = named("box_section", shapes::extrude(plane, even_levels(-50, 50, 10), solid));
  part.pieces = {box_piece({-25, -20, -50}, {-21, 20, 50}), box_piece({21, -20, -50}, {25, 20, 50}),
                 box_piece({-21, -20, -50}, {21, -16, 50}), box_piece({-21, 16, -50}, {21, 20, 50})};
  return part;
}

ExamplePart nozzle() {
  // Collar, waist, head with a blind bore.
  const std::vector<float> radii{3, 5, 7, 9, 12}, levels{-22, -18, -14, -6, 2, 8, 15, 22};
  const auto solid = [&](const Vector2f& p, int layer) {
    const float r = p.norm(), z = levels[static_cast<std::size_t>(layer)];
    if (z >= 8 && r < 5) return false;
    return r < (z < -14 ? 9.F : z < 2 ? 7.F : z < 15 ? 12.F : 9.F);
  };
  ExamplePart part = named("nozzle", shapes::extrude(disc(radii, 48), levels, solid));
  part.pieces = {cylinder_piece(9, -22, -14, 24), cylinder_piece(7, -14, 2, 24), cylinder_piece(12, 2, 15, 24),
                 cylinder_piece(9, 15, 22, 24)};
  return part;
}

ExamplePart keyed_shaft() {
  const std::vector<float> radii{1.75F, 3.5F, 5.5F, 7};
  const std::vector<float> levels{-28, -22, -14, -6, 2, 10, 16, 22, 28};
  const auto solid = [&](const Vector2f& p, int layer) {
    const float z = levels[static_cast<std::size_t>(layer)];
    const bool keyway = std::abs(std::atan2(p.y(), p.x())) < std::numbers::pi_v<float> / 8 && z >= -22 && z < 10;
    return p.norm() < (keyway ? 3.5F : z < 16 ? 7.F : 5.5F);
  };
  ExamplePart part = named("keyed_shaft", shapes::extrude(disc(radii, 48), levels, solid));
  part.pieces = {cylinder_piece(7, -28, 16, 24), cylinder_piece(5.5F, 16, 28, 24)};
  return part;
}
}  // namespace

ExamplePart own_part(std::string_view name) {
  if (name == "stamped_plate") return stamped_plate();
  if (name == "box_section") return box_section();
  if (name == "nozzle") return nozzle();
  BINPICK_CHECK(name == "keyed_shaft");
  return keyed_shaft();
}
}  // namespace binpick::bench
