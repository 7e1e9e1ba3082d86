#include "tests/emulators/world/example_grasps.hpp"

#include <cmath>
#include <numbers>

#include "base/check.hpp"
#include "base/rotation.hpp"

namespace binpick::emulators {
namespace {
using Eigen::Matrix3d;
using Eigen::Vector3d;
using Solid = vision::Gripper::Solid;

constexpr double kDegree = std::numbers::pi / 180;
const Vector3d kX = Vector3d::UnitX(), kY = Vector3d::UnitY(), kZ = Vector3d::UnitZ();

/// Behind the jaws: the palm, a box as wide as they open; a stem that is longer than walls are high; the arm's last
/// axis.
vision::Gripper gripper(double opening_max_mm, const Vector3d& jaw_mm, double palm_y_mm, double scale) {
  vision::Gripper gripper;
  gripper.jaws = vision::Gripper::Jaws{opening_max_mm, jaw_mm, 0};
  double back = -jaw_mm.z();
  const auto add = [&](Solid::Shape shape, const Vector3d& size_mm) {
    Solid solid{shape, size_mm, Eigen::Isometry3d::Identity()};
    solid.T_tcp_solid.translation().z() = back - size_mm.z() / 2;
    gripper.body.push_back(solid);
    back -= size_mm.z();
  };
  add(Solid::Shape::Box, {opening_max_mm + 2 * jaw_mm.x(), palm_y_mm, 50 * scale});
  add(Solid::Shape::Cylinder, {63 * scale, 63 * scale, 200 * scale});
  add(Solid::Shape::Cylinder, {100 * scale, 100 * scale, 200 * scale});
  return gripper;
}

/// The jaws' tips at `tips`; they come along `way` and move along `jaws`, which is made perpendicular to it.
ExampleGrasp grasp(const std::string& name, const Vector3d& tips, const Vector3d& way, const Vector3d& jaws,
                   double opening_mm, double holding_mm, double approach_mm) {
  Matrix3d R;
  R.col(2) = way.normalized();
  R.col(0) = (jaws - jaws.dot(R.col(2)) * R.col(2)).normalized();
  R.col(1) = R.col(2).cross(R.col(0));
  const auto rounded = [](Vector3d v, double step) {
    for (Eigen::Index i = 0; i < 3; ++i) v[i] = std::round(v[i] / step) * step + 0.0;
    return v;
  };
  return {name, rounded(tips, 1e-3), rounded(to_wpr_deg(R), 1e-4), approach_mm, opening_mm, holding_mm, 0};
}

std::string degrees(double angle) { return std::to_string(std::lround(angle)); }

/// Taken across its round sections, with the tips behind the axis; from the side, obliquely from the ends, and from the
/// ends.
void gear_shaft(ExamplePart& part) {
  constexpr double kBehind = 7, kGap = 7, kBack = 50;
  part.gripper = gripper(54, {6, 16, 110}, 40, 1);
  struct Place {
    const char* name;
    double z, radius;
    std::vector<double> leans;  ///< The next section is thicker: not over it.
  };
  for (const Place& place : {Place{"short_end", -78, 15, {0, 25, -25}}, Place{"short_inner", -62, 15, {0, 25}},
                             Place{"middle", -32, 20, {0, 25}}, Place{"long_inner", 58, 17.5, {0, -25}},
                             Place{"long_end", 78, 17.5, {0, 25, -25}}})
    for (const double lean : place.leans) {
      const Vector3d way = -std::cos(lean * kDegree) * kX + std::sin(lean * kDegree) * kZ;
      part.grasps.push_back(grasp(place.name + (lean == 0 ? "" : "_" + degrees(lean)), place.z * kZ + kBehind * way,
                                  way, kY, 2 * place.radius + 2 * kGap, 2 * place.radius, kBack));
    }
  for (const double end : {-1.0, 1.0}) {
    const double radius = end < 0 ? 15 : 17.5;
    const std::string name = end < 0 ? "short" : "long";
    part.grasps.push_back(
        grasp(name + "_axial", end * 62 * kZ, -end * kZ, kY, 2 * radius + 2 * kGap, 2 * radius, kBack));
    for (const double lean : {50.0, 70.0}) {
      const Vector3d way = -std::cos(lean * kDegree) * kX - end * std::sin(lean * kDegree) * kZ;
      part.grasps.push_back(grasp(name + "_oblique_" + degrees(lean), end * 72 * kZ + 8 * way, way, kY,
                                  2 * radius + 2 * kGap, 2 * radius, kBack));
    }
  }
}

/// Taken in its bores from within, over the thickness of its lugs from their edges, and across the bridge.
void track_link(ExamplePart& part) {
  constexpr double kGap = 8, kBack = 50, kBackFromBore = 28;
  const Vector3d kJaw{7, 14, 110};
  part.gripper = gripper(96, kJaw, 40, 1);
  struct Lug {
    const char* name;
    Vector3d middle;
    double half_mm, bore_mm, outwards;
    std::vector<double> leans;  ///< As far as the jaws have room in the bore.
  };
  for (const Lug& lug : {Lug{"high", {-60, -20, 0}, 25, 22, -1, {0, 15, -15, 30, -30}},
                         Lug{"low", {60, 20, 0}, 13, 17, 1, {0, 15, -15}}}) {
    const double thick = 2 * lug.half_mm;
    // In the bore, 20 mm deep; also a little slanted, so that the tool stands upright where the link does not quite
    // lie.
    for (const double side : {1.0, -1.0})
      for (const double turn : {0.0, 60.0, 120.0})
        for (const double lean : lug.leans) {
          const Vector3d jaws = std::cos(turn * kDegree) * kX + std::sin(turn * kDegree) * kY;
          const Vector3d way = -side * std::cos(lean * kDegree) * kZ + std::sin(lean * kDegree) * kZ.cross(jaws);
          // A flat jaw touches the round wall with its corners, 10 mm above and below its middle.
          const double slant = std::abs(lean) * kDegree;
          const double beside = kJaw.y() / 2 * std::cos(slant) + 10 * std::sin(slant);
          const double holding = 2 * (std::sqrt(lug.bore_mm * lug.bore_mm - beside * beside) - kJaw.x());
          part.grasps.push_back(grasp(std::string{lug.name} + (side > 0 ? "_bore_top_" : "_bore_bottom_") +
                                          degrees(turn) + (lean == 0 ? "" : "_" + degrees(lean)),
                                      lug.middle + side * (lug.half_mm - 10) * kZ + 10 * way, way, jaws, 3,
                                      std::round(holding * 10) / 10, kBackFromBore));
        }
    // Over the edge, between two cut corners or across one of them; not where the bridge is.
    for (const double turn : {-90.0, -45.0, 0.0, 45.0, 90.0}) {
      const Vector3d out = lug.outwards * (std::cos(turn * kDegree) * kX + std::sin(turn * kDegree) * kY);
      const double edge = std::abs(turn) == 45 ? (40 + 40 - 20) / std::numbers::sqrt2 : 40;
      part.grasps.push_back(grasp(std::string{lug.name} + "_edge_" + degrees(turn), lug.middle + (edge - 17) * out,
                                  -out, kZ, thick + 2 * kGap, thick, kBack));
    }
  }
  // Over two cut corners of the high lug, above the bridge, from either side; a link that stands along a wall is taken
  // so, the tool leaning into the supply.
  for (const double side : {1.0, -1.0})
    for (const double lean : {0.0, 20.0}) {
      const Vector3d in = side * (kX - kY).normalized();
      const Vector3d way = std::cos(lean * kDegree) * in - std::sin(lean * kDegree) * kZ;
      const double across = std::round((40 + 40 - 20) * std::numbers::sqrt2 * 10) / 10;
      part.grasps.push_back(
          grasp(std::string{side > 0 ? "high_corner_out" : "high_corner_in"} + (lean == 0 ? "" : "_" + degrees(lean)),
                -60 * kX - 20 * kY + 15 * kZ + 8 * way, way, kX + kY, across + 11, across, kBack));
    }
  part.grasps.push_back(grasp("bridge_top", -14 * kZ, -kZ, kY, 95, 80, kBack));
  part.grasps.push_back(grasp("bridge_bottom", -3 * kZ, kZ, kY, 95, 80, kBack));
}

/// Taken at the rim, between the spokes: from above, from below and from without.
void steering_wheel(ExamplePart& part) {
  constexpr double kRim = 170, kTube = 15, kBehind = 8, kGap = 10, kBack = 50;
  part.gripper = gripper(52, {8, 18, 110}, 40, 1);
  for (const double at : {22.0, 60.0, 98.0}) {
    const Vector3d out = std::cos(at * kDegree) * kX + std::sin(at * kDegree) * kY;
    for (const double lean : {0.0, 30.0, 60.0, 90.0, 120.0, 150.0, 180.0}) {
      const Vector3d way = -std::sin(lean * kDegree) * out - std::cos(lean * kDegree) * kZ;
      part.grasps.push_back(grasp("rim_" + degrees(at) + "_" + degrees(lean), kRim * out + kBehind * way, way,
                                  way.cross(out.cross(kZ)), 2 * kTube + 2 * kGap, 2 * kTube, kBack));
    }
  }
}

/// Taken at its waist, at the contact blocks from above, below, the sides and the ends, and over its whole length.
/// Where the jaws lie along the part, the tool may lean across it: beside a wall it leans into the supply.
void contact_bridge(ExamplePart& part) {
  constexpr double kGap = 2.5, kLean = 25 * kDegree;
  part.gripper = gripper(66, {2.5, 6, 50}, 18, 0.4);
  const auto add = [&](const std::string& name, const Vector3d& tips, const Vector3d& way, const Vector3d& jaws,
                       double width) {
    part.grasps.push_back(grasp(name, tips, way, jaws, width + 2 * kGap, width, 20));
  };
  /// Jaws along x: upright, and the tool leaning towards each of these.
  const auto add_along = [&](const std::string& name, const Vector3d& tips, const Vector3d& way,
                             const std::vector<Vector3d>& leans, double width) {
    add(name, tips, way, kX, width);
    const char* suffix = "_25";
    for (const Vector3d& lean : leans) {
      add(name + suffix, tips, std::cos(kLean) * way - std::sin(kLean) * lean, kX, width);
      suffix = "_-25";
    }
  };
  // The waist is a plate from z = 2 to 6; the floor may be right behind it.
  add("waist_top", 0.5 * kZ, -kZ, kY, 10.8);
  add("waist_bottom", 5.2 * kZ, kZ, kY, 10.8);
  add_along("length_top", -1 * kZ, -kZ, {kY, -kY}, 60);
  add_along("length_bottom", 2 * kZ, kZ, {kY, -kY}, 60);
  add_along("length_below", 2 * kY, kY, {kZ, -kZ}, 60);
  add_along("length_above", -2 * kY, -kY, {kZ, -kZ}, 60);
  for (const double end : {-1.0, 1.0}) {
    const Vector3d block = 24 * end * kX;
    const std::string name = end < 0 ? "left" : "right";
    add(name + "_top", block - 2 * kZ, -kZ, kY, 18);
    add(name + "_bottom", block + 2 * kZ, kZ, kY, 18);
    add_along(name + "_bottom_in", block - 0.5 * kZ, kZ, {kY, -kY}, 12);
    for (const double side : {-1.0, 1.0}) {
      add(name + (side < 0 ? "_below" : "_above"), block + side * 1.5 * kY, -side * kY, kZ, 12);
      add_along(name + (side < 0 ? "_below_in" : "_above_in"), block + side * 1.5 * kY - 2 * kZ, -side * kY, {-kZ},
                12);  // on the other side is the bar
    }
    add(name + "_end_flat", 22 * end * kX, -end * kX, kZ, 12);
    add(name + "_end_wide", 22 * end * kX, -end * kX, kY, 18);
    for (const double lean : {-45.0, 45.0}) {
      const Vector3d way = -std::cos(lean * kDegree) * end * kX - std::sin(lean * kDegree) * kZ;
      add(name + "_end_" + degrees(lean), block + 1.5 * way, way, kY, 18);
      const Vector3d across = -std::cos(lean * kDegree) * end * kX - std::sin(lean * kDegree) * kY;
      add(name + "_corner_" + degrees(lean), block + 2 * across, across, kZ, 12);
    }
  }
}
}  // namespace

void add_gripper(ExamplePart& part) {
  if (part.name == "gear_shaft") return gear_shaft(part);
  if (part.name == "track_link") return track_link(part);
  if (part.name == "steering_wheel") return steering_wheel(part);
  BINPICK_CHECK(part.name == "contact_bridge");
  contact_bridge(part);
}
}  // namespace binpick::emulators
