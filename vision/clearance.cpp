#include "vision/clearance.hpp"

#include <algorithm>
#include <array>
#include <cmath>

namespace binpick::vision {
namespace {
/// A wall is solid below its height and as thick as one likes.
void meet_walls(const Swept& body, double pixel_mm, const SupplyBox& supply, Contact& deepest) {
  if (supply.size_mm.x() <= 0 || supply.size_mm.y() <= 0) return;
  const auto height = static_cast<float>(supply.size_mm.z());
  if (body.along(Eigen::Vector3d::UnitZ()).least >= supply.size_mm.z()) return;
  for (Eigen::Index axis = 0; axis < 2; ++axis) {
    const double wall = 0.5 * supply.size_mm[axis];
    const Swept::Range across = body.along(Eigen::Vector3d::Unit(axis)),
                       beside = body.along(Eigen::Vector3d::Unit(1 - axis));
    for (const double side : {-1.0, 1.0}) {
      const double farthest = side > 0 ? across.greatest : -across.least;
      for (double at = wall; at < farthest; at += pixel_mm)
        for (double along = beside.least; along <= beside.greatest; along += pixel_mm) {
          const auto x = static_cast<float>(axis == 0 ? side * at : along);
          const auto y = static_cast<float>(axis == 0 ? along : side * at);
          const Swept::Span span = body.at(x, y);
          if (span.empty() || span.low >= height) continue;
          if (farthest - wall > deepest.depth_mm) deepest = {Obstacle::Wall, farthest - wall};
          at = farthest;  // this wall is known
          break;
        }
    }
  }
}

void meet_heights(const Swept& body, const Heights& heights, bool holes, Contact& deepest) {
  constexpr int kBlock = Heights::kBlockPx;
  const auto rows = static_cast<int>(heights.z_mm.rows()), cols = static_cast<int>(heights.z_mm.cols());
  if (rows == 0 || cols == 0) return;
  const auto lowest = static_cast<float>(body.along(Eigen::Vector3d::UnitZ()).least);
  const auto index = [&](double mm, Eigen::Index axis, int count) {
    return static_cast<int>(
        std::clamp((mm - heights.origin_mm[axis]) / heights.pixel_mm, 0.0, static_cast<double>(count - 1)));
  };
  const Swept::Range x = body.along(Eigen::Vector3d::UnitX()), y = body.along(Eigen::Vector3d::UnitY());
  const auto half = static_cast<float>(0.5 * kBlock * heights.pixel_mm);
  for (int br = index(y.least, 1, rows) / kBlock; br <= index(y.greatest, 1, rows) / kBlock; ++br)
    for (int bc = index(x.least, 0, cols) / kBlock; bc <= index(x.greatest, 0, cols) / kBlock; ++bc) {
      const float block = heights.block_mm(br, bc);
      if (block <= lowest) continue;
      const int row0 = br * kBlock, col0 = bc * kBlock;
      const auto middle = static_cast<float>(0.5 * (kBlock - 1) * heights.pixel_mm);
      const Swept::Span bound = body.over(heights.x_mm(col0) + middle, heights.y_mm(row0) + middle, half, half);
      if (bound.empty() || block <= bound.low) continue;
      for (int r = row0; r < std::min(rows, row0 + kBlock); ++r)
        for (int c = col0; c < std::min(cols, col0 + kBlock); ++c) {
          const float z = heights.z_mm(r, c);
          if (z <= lowest || (!holes && heights.kind(r, c) == Heights::Kind::Hole)) continue;
          const Swept::Span span = body.at(heights.x_mm(c), heights.y_mm(r));
          if (span.empty() || z <= span.low || static_cast<double>(z - span.low) <= deepest.depth_mm) continue;
          deepest = {heights.kind(r, c) == Heights::Kind::Hole ? Obstacle::Unmeasured : Obstacle::Neighbour,
                     static_cast<double>(z - span.low)};
        }
    }
}
}  // namespace

const char* to_string(Obstacle obstacle) {
  switch (obstacle) {
    case Obstacle::None:
      return "free";
    case Obstacle::NoGrasp:
      return "no grasp";
    case Obstacle::Tilt:
      return "too steep";
    case Obstacle::Reach:
      return "out of the robot's reach";
    case Obstacle::Wall:
      return "wall";
    case Obstacle::Itself:
      return "gripper hits the part itself";
    case Obstacle::Covered:
      return "another object lies on it";
    case Obstacle::Floor:
      return "floor";
    case Obstacle::Neighbour:
      return "collision with a neighbour";
    case Obstacle::Unmeasured:
      return "nothing was measured beside it";
  }
  return "?";
}

std::vector<Gripper::Solid> sweepers_of(const Gripper& gripper, const Grasp& grasp) {
  std::vector<Gripper::Solid> sweepers;
  if (gripper.jaws) {
    const double open = grasp.opening_mm.value_or(gripper.jaws->opening_max_mm);
    const double held = grasp.holding_mm.value_or(open);
    for (const double side : {-1.0, 1.0}) {
      // From the inner face where it is nearest to the tcp to the outer face where it is farthest away.
      const double inner = 0.5 * std::min(open, held), outer = 0.5 * std::max(open, held) + gripper.jaws->size_mm.x();
      Gripper::Solid& jaw = sweepers.emplace_back();
      jaw.size_mm = {outer - inner, gripper.jaws->size_mm.y(), gripper.jaws->size_mm.z()};
      jaw.T_tcp_solid.translation() =
          Eigen::Vector3d{side * 0.5 * (inner + outer), 0, gripper.jaws->beyond_mm - 0.5 * gripper.jaws->size_mm.z()};
    }
  }
  sweepers.insert(sweepers.end(), gripper.body.begin(), gripper.body.end());
  return sweepers;
}

std::vector<Swept> room_of(const Gripper& gripper, const Grasp& grasp, const Eigen::Isometry3d& T_a_tcp,
                           double grown_mm) {
  const Eigen::Vector3d way = -grasp.approach_mm * T_a_tcp.linear().col(2);
  std::vector<Swept> room;
  for (const Gripper::Solid& solid : sweepers_of(gripper, grasp)) room.emplace_back(solid, T_a_tcp, way, grown_mm);
  return room;
}

bool meets(const Swept& body, const Mesh& part) {
  Eigen::AlignedBox3d reach;
  for (Eigen::Index axis = 0; axis < 3; ++axis) {
    const Swept::Range range = body.along(Eigen::Vector3d::Unit(axis));
    reach.min()[axis] = range.least;
    reach.max()[axis] = range.greatest;
  }
  return std::ranges::any_of(part.triangles, [&](const auto& corners) {
    std::array<Eigen::Vector3d, 3> triangle;
    Eigen::AlignedBox3d box;
    for (std::size_t k = 0; k < 3; ++k) box.extend(triangle[k] = part.vertices_mm[corners[k]].template cast<double>());
    return reach.intersects(box) && body.meets(triangle);
  });
}

bool hits_part(const Gripper& gripper, const Grasp& grasp, const Mesh& part, double slack_mm) {
  Grasp coming = grasp;
  coming.holding_mm = grasp.opening_mm;
  return std::ranges::any_of(room_of(gripper, coming, grasp.T_object_tcp.iso, -slack_mm),
                             [&](const Swept& body) { return meets(body, part); });
}

Contact contact(const Swept& body, const Heights& heights, const SupplyBox& supply, bool holes) {
  Contact deepest;
  const double below = -body.along(Eigen::Vector3d::UnitZ()).least;
  if (below > 0) deepest = {Obstacle::Floor, below};
  meet_walls(body, heights.pixel_mm, supply, deepest);
  if (deepest.with == Obstacle::None) meet_heights(body, heights, holes, deepest);
  return deepest;
}

Contact contact(const std::vector<Swept>& room, const Heights& heights, const SupplyBox& supply) {
  for (const Swept& body : room)
    if (const Contact found = contact(body, heights, supply); found.with != Obstacle::None) return found;
  return {};
}

Contact contact_of_part(const Template& lower_side, const Eigen::Vector2d& origin_mm, const Eigen::Vector3d& up,
                        double way_mm, double slack_mm, const Heights& heights, const SupplyBox& supply) {
  Contact deepest;
  const double aside_mm = way_mm * up.head<2>().norm();
  const auto steps = static_cast<int>(std::ceil(std::min(1e5, aside_mm / heights.pixel_mm)));
  if (steps == 0 || lower_side.rows == 0) return deepest;
  const bool walled = supply.size_mm.x() > 0 && supply.size_mm.y() > 0;
  const float highest = heights.block_mm.size() > 0 ? heights.block_mm.maxCoeff() : 0.0F;
  const auto slack = static_cast<float>(slack_mm);
  // The place of the template's pixel (0, 0) in the window.
  const Eigen::Vector2d place = (origin_mm - heights.origin_mm) / heights.pixel_mm;
  for (int step = 1; step <= steps; ++step) {
    const Eigen::Vector3d moved = up * (way_mm * step / steps);
    const auto rise = static_cast<float>(moved.z()) + slack;
    const int row0 = lower_side.row0 + static_cast<int>(std::lround(place.y() + moved.y() / heights.pixel_mm));
    const int col0 = lower_side.col0 + static_cast<int>(std::lround(place.x() + moved.x() / heights.pixel_mm));
    bool low = false;  // somewhere below what stands around
    for (int r = 0; r < lower_side.rows; ++r)
      for (int c = 0; c < lower_side.cols; ++c) {
        const float bottom = lower_side.top_mm[lower_side.at(r, c)] + rise;
        if (std::isnan(bottom)) continue;
        const int row = r + row0, col = c + col0;
        const double beyond =
            walled ? std::max(std::abs(static_cast<double>(heights.x_mm(col))) - 0.5 * supply.size_mm.x(),
                              std::abs(static_cast<double>(heights.y_mm(row))) - 0.5 * supply.size_mm.y())
                   : 0.0;
        if (beyond > slack_mm && bottom < static_cast<float>(supply.size_mm.z())) {
          if (beyond > deepest.depth_mm) deepest = {Obstacle::Wall, beyond};
          continue;
        }
        low = low || bottom < highest || (walled && bottom < static_cast<float>(supply.size_mm.z()));
        if (row < 0 || col < 0 || row >= heights.z_mm.rows() || col >= heights.z_mm.cols()) continue;
        if (heights.kind(row, col) != Heights::Kind::Known) continue;
        const auto depth = static_cast<double>(heights.z_mm(row, col) - bottom);
        if (depth > deepest.depth_mm) deepest = {Obstacle::Neighbour, depth};
      }
    if (!low || deepest.with != Obstacle::None) break;
  }
  return deepest;
}
}  // namespace binpick::vision
