#include "tests/emulators/world/world.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "tests/emulators/world/shapes.hpp"

namespace binpick::emulators {
namespace {
using Eigen::Vector3d;
using Eigen::Vector3f;

constexpr double kWall_mm = 20;
constexpr double kFloorBeyond_mm = 4000;  // as far as the scanner could see

vision::Mesh cuboid(const Vector3d& low, const Vector3d& high) {
  std::array<Vector3f, 8> corners;
  for (std::size_t i = 0; i < 8; ++i) {
    const bool x = i % 4 == 1 || i % 4 == 2, y = i % 4 >= 2, z = i >= 4;
    corners[i] = Vector3d{x ? high.x() : low.x(), y ? high.y() : low.y(), z ? high.z() : low.z()}.cast<float>();
  }
  return shapes::hexahedron(corners);
}

vision::Mesh supply_and_floor(const Vector3d& size) {
  const double x = size.x() / 2, y = size.y() / 2, z = size.z();
  const double far_x = x + kFloorBeyond_mm, far_y = y + kFloorBeyond_mm;
  vision::Mesh mesh = cuboid({-far_x, -far_y, -kWall_mm}, {far_x, far_y, 0});
  if (z > 0) {
    shapes::append(mesh, cuboid({-x - kWall_mm, -y - kWall_mm, -1}, {-x, y + kWall_mm, z}));
    shapes::append(mesh, cuboid({x, -y - kWall_mm, -1}, {x + kWall_mm, y + kWall_mm, z}));
    shapes::append(mesh, cuboid({-x, -y - kWall_mm, -1}, {x, -y, z}));
    shapes::append(mesh, cuboid({-x, y, -1}, {x, y + kWall_mm, z}));
  }
  return mesh;
}

/// Distance at which the ray enters the box; nothing when it misses it or enters beyond `limit`.
std::optional<float> entry(const Eigen::AlignedBox3f& box, const Vector3f& origin, const Vector3f& inverse,
                           float limit) {
  const Vector3f a = (box.min() - origin).cwiseProduct(inverse), b = (box.max() - origin).cwiseProduct(inverse);
  const float near = std::max(a.cwiseMin(b).maxCoeff(), 0.F);
  if (near > std::min(a.cwiseMax(b).minCoeff(), limit)) return std::nullopt;
  return near;
}
}  // namespace

World::World(const Vector3d& supply_size_mm) : size_mm_{supply_size_mm} {
  surroundings_.part = "supply";
  surroundings_.mesh = std::make_shared<RayMesh>(supply_and_floor(supply_size_mm));
  surroundings_.box = surroundings_.mesh->box();
}

int World::add(std::string_view part, std::shared_ptr<const RayMesh> mesh,
               const Transform<frame::Supply, frame::Object>& T_supply_object, double reflectance) {
  objects_.push_back({next_id_++, std::string{part}, {}, std::move(mesh), reflectance, {}});
  move(objects_.back().id, T_supply_object);
  return objects_.back().id;
}

bool World::move(int id, const Transform<frame::Supply, frame::Object>& T_supply_object) {
  const auto object = std::ranges::find(objects_, id, &Object::id);
  if (object == objects_.end()) return false;
  object->T_supply_object = T_supply_object;
  const Eigen::AlignedBox3f& own = object->mesh->box();
  object->box.setEmpty();
  for (int corner = 0; corner < 8; ++corner)
    object->box.extend(
        Vector3d{T_supply_object * own.corner(static_cast<Eigen::AlignedBox3f::CornerType>(corner)).cast<double>()}
            .cast<float>());
  return true;
}

bool World::remove(int id) {
  return std::erase_if(objects_, [&](const Object& o) { return o.id == id; }) > 0;
}

const World::Object* World::find(int id) const {
  const auto it = std::ranges::find(objects_, id, &Object::id);
  return it == objects_.end() ? nullptr : &*it;
}

std::optional<World::Hit> World::cast(const Vector3d& origin_mm, const Vector3d& direction, double limit_mm) const {
  const Vector3f origin = origin_mm.cast<float>();
  const Vector3f inverse = direction.cast<float>().cwiseInverse();
  std::optional<Hit> best;
  auto limit = static_cast<float>(limit_mm);
  if (const auto hit = surroundings_.mesh->cast(origin, direction.cast<float>(), limit)) {
    limit = hit->distance_mm;
    const Vector3d normal = surroundings_.mesh->normal(hit->triangle).cast<double>();
    best = Hit{limit, 0, std::abs(normal.dot(direction)), surroundings_.reflectance};
  }
  // Nearest box first: what is hit there hides most of the others.
  thread_local std::vector<std::pair<float, const Object*>> met;
  met.clear();
  for (const Object& object : objects_)
    if (const auto distance = entry(object.box, origin, inverse, limit)) met.emplace_back(*distance, &object);
  std::ranges::sort(met, {}, &std::pair<float, const Object*>::first);
  for (const auto& [distance, object] : met) {
    if (distance > limit) break;
    const Eigen::Isometry3d& iso = object->T_supply_object.iso;
    const Vector3d own_direction = iso.linear().transpose() * direction;
    const Vector3d own_origin = iso.linear().transpose() * (origin_mm - iso.translation());
    const auto hit = object->mesh->cast(own_origin.cast<float>(), own_direction.cast<float>(), limit);
    if (!hit) continue;
    limit = hit->distance_mm;
    best = Hit{limit, object->id, std::abs(object->mesh->normal(hit->triangle).cast<double>().dot(own_direction)),
               object->reflectance};
  }
  return best;
}

vision::Mesh box_mesh(const Vector3d& size_mm) { return cuboid(-size_mm / 2, size_mm / 2); }
}  // namespace binpick::emulators
