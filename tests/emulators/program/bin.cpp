#include "tests/emulators/program/bin.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <limits>
#include <numbers>
#include <set>
#include <stdexcept>

#include "tests/emulators/world/belt.hpp"
#include "tests/emulators/world/example_parts.hpp"
#include "vision/knowledge_base.hpp"

namespace binpick::emulators {
namespace {
/// Of a part without a gripper: within this its object is taken.
constexpr double kGripMm = 15;
constexpr double kGripRad = 10 * std::numbers::pi / 180;
/// Parts whose file names no scanner are of the class for small ones below this, as in training.
constexpr double kSmallMm = 150;

/// A body for the physics of a part that is not ours: the hull of its mesh, by its outermost points in many directions.
ConvexPiece hull_of(const vision::Mesh& mesh) {
  constexpr int kDirections = 200;
  ConvexPiece piece;
  for (int i = 0; i < kDirections; ++i) {
    const double z = 1 - (2.0 * i + 1) / kDirections;
    const double angle = i * std::numbers::pi * (3 - std::sqrt(5.0));
    const double r = std::sqrt(1 - z * z);
    const Eigen::Vector3f direction = Eigen::Vector3d{r * std::cos(angle), r * std::sin(angle), z}.cast<float>();
    piece.points_mm.push_back(*std::ranges::max_element(
        mesh.vertices_mm, {}, [&](const Eigen::Vector3f& vertex) { return vertex.dot(direction); }));
  }
  return piece;
}

ExamplePart body_of(const config::Part& part, const vision::Mesh& mesh) {
  const std::string stem = std::filesystem::path(part.path).stem().string();
  if (std::ranges::find(example_part_names(), stem) != example_part_names().end()) {
    ExamplePart example = example_part(stem);
    if (vision::mesh_hash(example.mesh) == vision::mesh_hash(mesh)) return example;
  }
  ExamplePart own;
  own.name = stem;
  own.mesh = mesh;
  own.pieces = {hull_of(mesh)};
  const auto scanner = part.options.scanner;
  own.scanner =
      (scanner ? *scanner != vision::ScannerClass::Lms400 : mesh.diameter_mm() < kSmallMm) ? "lps36" : "lms400";
  return own;
}

vision::Mesh mesh_of(const config::Part& part) {
  auto mesh = vision::load_mesh(part.mesh_path, part.mesh_unit_mm);
  if (!mesh) throw std::runtime_error(mesh.error().text);
  return std::move(*mesh);
}

vision::Symmetry symmetry_of(const config::Recipe& recipe, const vision::Mesh& mesh) {
  if (const auto knowledge = vision::KnowledgeBase::open(recipe.knowledge_base)) return knowledge->symmetry();
  return vision::symmetry_of(mesh, recipe.part.options);
}
}  // namespace

Bin::Bin(const config::Config& config, const BinOptions& options)
    : supply_{config.supplies.at(options.supply)},
      part_{config.recipes.at(options.recipe).part},
      options_{options},
      mesh_{mesh_of(part_)},
      symmetry_{symmetry_of(config.recipes.at(options.recipe), mesh_)},
      radius_mm_{mesh_.diameter_mm() / 2},
      seed_{options.seed},
      pile_{fill(options.seed)} {}

LivingPile Bin::fill(std::uint64_t seed) const {
  const ExamplePart part = body_of(part_, mesh_);
  if (!is_belt()) return {part, options_.objects, supply_.size_mm, seed};
  const auto lying = lay_apart(part, options_.objects, supply_.size_mm.head<2>(), seed);
  if (lying.empty() && options_.objects > 0)
    throw std::runtime_error("supply.size_mm: no object lies wholly within this window over the belt; make it larger");
  return {part, lying, supply_.size_mm};
}

std::size_t Bin::objects_left() const { return world().objects().size(); }

std::size_t Bin::overlapping() const {
  constexpr double kGridMm = 10;
  constexpr double kAboveMm = 100;  // over the highest wall or object
  const Eigen::Vector3d size = supply_.size_mm;
  double top = size.z();
  for (const World::Object& object : world().objects()) top = std::max(top, double{object.box.max().z()});
  std::set<int> found;
  for (double x = -size.x() / 2; x < size.x() / 2; x += kGridMm)
    for (double y = -size.y() / 2; y < size.y() / 2; y += kGridMm) {
      std::set<int> in_line;
      Eigen::Vector3d from{x, y, top + kAboveMm};
      while (const auto hit = world().cast(from, -Eigen::Vector3d::UnitZ(), from.z() + 1)) {
        if (hit->object == 0) break;
        in_line.insert(hit->object);
        from.z() -= hit->distance_mm + 0.1;
      }
      if (in_line.size() > 1) found.insert(in_line.begin(), in_line.end());
    }
  return found.size();
}

std::optional<Bin::Nearest> Bin::nearest(const Transform<frame::Base, frame::Tcp>& T_base_grasp) const {
  std::optional<Nearest> best;
  double least = std::numeric_limits<double>::max();
  for (const vision::Grasp& grasp : part_.grasps) {
    const auto T_supply_object = supply_.T_base_supply.inverse() * T_base_grasp * grasp.T_object_tcp.inverse();
    for (const World::Object& object : world().objects()) {
      const auto error = vision::pose_distance(T_supply_object.iso, object.T_supply_object.iso, symmetry_, radius_mm_);
      const double apart = error.centroid_mm + radius_mm_ * error.angle_rad;
      if (apart >= least) continue;
      least = apart;
      best = Nearest{object.id, error};
    }
  }
  return best;
}

GripResult Bin::take(const Transform<frame::Base, frame::Tcp>& T_base_approach,
                     const Transform<frame::Base, frame::Tcp>& T_base_grasp,
                     const Transform<frame::Base, frame::Tcp>& T_base_retreat) {
  GripResult result;
  if (part_.gripper) {
    const auto T_supply_base = supply_.T_base_supply.inverse();
    result = grip(pile_, *part_.gripper, part_.grasps, symmetry_,
                  {T_supply_base * T_base_approach, T_supply_base * T_base_grasp, T_supply_base * T_base_retreat},
                  GripRules::of(pile_.part()));
  } else if (const auto found = nearest(T_base_grasp)) {
    result.object = found->object;
    const bool is_near = found->error.centroid_mm <= kGripMm && found->error.angle_rad <= kGripRad;
    if (is_near)
      result.kind = GripResult::Kind::Taken;
    else
      result.what = "every object is too far away";
  }
  if (result.kind == GripResult::Kind::Taken) pile_.take(result.object);
  return result;
}

bool Bin::take_highest() {
  const auto& objects = world().objects();
  if (objects.empty()) return false;
  const auto highest =
      std::ranges::max_element(objects, {}, [](const World::Object& object) { return object.box.max().z(); });
  pile_.take(highest->id);
  return true;
}

void Bin::start_refill() {
  if (refilling()) return;
  ++seed_;
  next_ = std::async(std::launch::async, [this, seed = seed_] { return fill(seed); });
}

bool Bin::poll_refill() {
  if (!refilling() || next_.wait_for(std::chrono::seconds(0)) != std::future_status::ready) return false;
  pile_ = next_.get();
  return true;
}
}  // namespace binpick::emulators
