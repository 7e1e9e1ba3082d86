#pragma once

#include <Eigen/Geometry>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/frames.hpp"
#include "tests/emulators/world/ray_mesh.hpp"
#include "vision/mesh.hpp"

namespace binpick::emulators {
/// What stands in the emulated cell: one supply with its walls on a wide floor, and the objects in it.
class World {
 public:
  struct Object {
    int id = 0;
    std::string part;
    Transform<frame::Supply, frame::Object> T_supply_object;
    std::shared_ptr<const RayMesh> mesh;
    double reflectance = 0.9;  ///< 0 … 1, diffuse. 0.9: white paint; 0.1: dark steel.
    Eigen::AlignedBox3f box;   ///< In the supply frame, mm.
  };

  /// Inner size x, y and wall height, mm. Walls are 20 mm thick; a height of 0 leaves the bare floor.
  explicit World(const Eigen::Vector3d& supply_size_mm);

  const Eigen::Vector3d& supply_size_mm() const { return size_mm_; }
  /// Ids count from 1 and are never used twice.
  int add(std::string_view part, std::shared_ptr<const RayMesh> mesh,
          const Transform<frame::Supply, frame::Object>& T_supply_object, double reflectance = 0.9);
  bool remove(int id);  ///< False: no such object. Nothing else moves.
  bool move(int id, const Transform<frame::Supply, frame::Object>& T_supply_object);  ///< False: no such object.
  const std::vector<Object>& objects() const { return objects_; }
  const Object* find(int id) const;
  /// Supply and floor, with id 0.
  const Object& surroundings() const { return surroundings_; }

  struct Hit {
    double distance_mm = 0;
    int object = 0;            ///< 0: supply or floor.
    double cos_incidence = 1;  ///< 1: head on, 0: grazing.
    double reflectance = 0.9;
  };
  /// First thing met along the ray within `limit_mm`. Supply frame; `direction` has length 1. Safe from several
  /// threads while nothing is added or removed.
  std::optional<Hit> cast(const Eigen::Vector3d& origin_mm, const Eigen::Vector3d& direction, double limit_mm) const;

 private:
  Eigen::Vector3d size_mm_;
  std::vector<Object> objects_;
  Object surroundings_;  // supply and floor
  int next_id_ = 1;
};

/// Box with its middle at the origin.
vision::Mesh box_mesh(const Eigen::Vector3d& size_mm);
}  // namespace binpick::emulators
