#pragma once

#include <Eigen/Core>
#include <string>
#include <string_view>
#include <vector>

#include "vision/grasp.hpp"
#include "vision/gripper.hpp"
#include "vision/knowledge_base.hpp"
#include "vision/mesh.hpp"

/// The four parts that demo, tests and benches share, made here so that no mesh file has to be carried around.
namespace binpick::emulators {
/// Corners of a convex body, mm, in the object frame. The pieces of a part cover its mesh; for physics only.
struct ConvexPiece {
  std::vector<Eigen::Vector3f> points_mm;
};

ConvexPiece box_piece(const Eigen::Vector3f& low, const Eigen::Vector3f& high);
/// Prism over a regular polygon, axis z.
ConvexPiece cylinder_piece(float radius, float z_low, float z_high, int corners);

/// As a PART.toml says it: the tcp's z axis points into the part, the way of approach; the jaws move along its x axis.
struct ExampleGrasp {
  std::string name;
  Eigen::Vector3d xyz_mm = Eigen::Vector3d::Zero();
  Eigen::Vector3d rpy_deg = Eigen::Vector3d::Zero();  ///< [W, P, R]: R = Rz(R)·Ry(P)·Rx(W).
  double approach_mm = 100;
  double opening_mm = 0, holding_mm = 0;
  double preference = 0;

  vision::Grasp grasp() const;
};

struct ExamplePart {
  std::string name;
  std::string scanner;   ///< PART.toml's class: "lms400" or "lps36".
  std::string symmetry;  ///< In words, for the file's comment.
  vision::Mesh mesh;     ///< Closed.
  std::vector<ConvexPiece> pieces;
  vision::Gripper gripper;
  std::vector<ExampleGrasp> grasps;  ///< See example_grasps.hpp.
};

/// "gear_shaft", "track_link", "steering_wheel", "contact_bridge".
const std::vector<std::string>& example_part_names();

/// * gear_shaft: 180 long, Ø 60, axis z, stepped, its two ends differ; 24 teeth on the rim, hence turned by 15 degrees
///   it is the same, and to a scanner with 3 mm noise it is a revolution.
/// * track_link: 200 × 120 × 50, S-shaped, two lugs of different height and bore; no symmetry.
/// * steering_wheel: Ø 370, three equal spokes, hub below the rim: turned by 120 degrees it is the same. Rim, hub and
///   spokes are closed bodies that reach into each other; the faces inside are never seen.
/// * contact_bridge: 60 × 18 × 12, turned by 180 degrees about z it is the same.
/// Any other name is a mistake of the caller.
ExamplePart example_part(std::string_view name);

/// Writes `folder`/NAME.stl (binary, mm) and `folder`/NAME.toml (a PART.toml, for picking from a bin or from a belt).
/// Makes the folder. Throws std::runtime_error with path and reason when a file cannot be written. Returns the path of
/// the TOML.
std::string write_example_part(std::string_view name, const std::string& folder,
                               vision::Picking picking = vision::Picking::Bin);
}  // namespace binpick::emulators
