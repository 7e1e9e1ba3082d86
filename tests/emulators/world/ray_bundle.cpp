#include "tests/emulators/world/ray_bundle.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <limits>

namespace binpick::emulators {
namespace {
using Eigen::Vector3f;
constexpr float kInfinity = std::numeric_limits<float>::infinity();
constexpr std::size_t kLanes = 8;
constexpr std::size_t kDepthMax = 64;

// The compiler makes of these what the processor has: two registers of four or one of eight. All is inlined: no vector
// crosses a call, so that its place in the ABI does not matter.
#pragma GCC diagnostic ignored "-Wpsabi"
typedef float Lanes __attribute__((vector_size(4 * kLanes)));
typedef int Mask __attribute__((vector_size(4 * kLanes)));

inline __attribute__((always_inline)) Lanes lesser(const Lanes& a, const Lanes& b) { return a < b ? a : b; }
inline __attribute__((always_inline)) Lanes greater(const Lanes& a, const Lanes& b) { return a > b ? a : b; }
inline __attribute__((always_inline)) bool any(const Mask& mask) {
  std::array<long long, kLanes / 2> words;
  std::memcpy(words.data(), &mask, sizeof mask);
  return (words[0] | words[1] | words[2] | words[3]) != 0;
}

/// Rays of one packet in one frame.
struct Rays {
  Vector3f origin;
  std::array<Lanes, 3> direction, inverse;
};
struct Nearest {
  Lanes distance;
  Mask triangle;  ///< Of the mesh last asked; -1: none of it.
};

/// A ray along a face of a box must not make nothing times infinity.
inline __attribute__((always_inline)) Lanes inverted(const Lanes& direction) {
  return 1.F / (direction == 0.F ? Lanes{} + 1e-20F : direction);
}

/// Lanes whose rays meet the box before `limit`.
inline __attribute__((always_inline)) Mask meets(const Rays& rays, const float* low, const float* high,
                                                 const Lanes& limit) {
  Lanes near = {}, far = limit;
  for (int k = 0; k < 3; ++k) {
    const auto axis = static_cast<std::size_t>(k);
    const Lanes a = (low[k] - rays.origin[k]) * rays.inverse[axis], b = (high[k] - rays.origin[k]) * rays.inverse[axis];
    near = greater(near, lesser(a, b));
    far = lesser(far, greater(a, b));
  }
  return near <= far;
}

inline __attribute__((always_inline)) void traverse(const RayMesh::View& mesh, const Rays& rays, Nearest& nearest) {
  std::array<std::uint32_t, kDepthMax> stack;
  std::size_t height = 0;
  stack[height++] = 0;
  const Vector3f middle{rays.direction[0][kLanes / 2], rays.direction[1][kLanes / 2], rays.direction[2][kLanes / 2]};
  while (height > 0) {
    const RayMesh::Node& node = mesh.nodes[stack[--height]];
    if (!any(meets(rays, node.low.data(), node.high.data(), nearest.distance))) continue;
    if (node.count == 0) {
      const RayMesh::Node &left = mesh.nodes[node.first], &right = mesh.nodes[node.first + 1];
      const auto towards = (right.low + right.high - left.low - left.high).head<3>().matrix().dot(middle);
      const bool left_first = towards > 0;
      stack[height++] = left_first ? node.first + 1 : node.first;
      stack[height++] = left_first ? node.first : node.first + 1;
      continue;
    }
    for (std::uint32_t i = node.first; i < node.first + node.count; ++i) {
      // Möller and Trumbore, 1997; with one origin most of it is the same for all rays.
      const RayMesh::Triangle& t = mesh.triangles[i];
      const Vector3f s = rays.origin - t.corner, q = s.cross(t.edge1), p = t.edge2.cross(s), n = t.edge2.cross(t.edge1);
      const float along = t.edge2.dot(q);
      const auto& d = rays.direction;
      const Lanes determinant = d[0] * n.x() + d[1] * n.y() + d[2] * n.z();
      const Lanes f = 1.F / determinant;  // infinite where parallel: every comparison below fails or u is not finite
      const Lanes u = f * (d[0] * p.x() + d[1] * p.y() + d[2] * p.z());
      const Lanes v = f * (d[0] * q.x() + d[1] * q.y() + d[2] * q.z());
      const Lanes distance = f * along;
      const Mask hit = (u >= 0.F) & (v >= 0.F) & (u + v <= 1.F) & (distance > 0.F) & (distance < nearest.distance);
      nearest.distance = hit ? distance : nearest.distance;
      nearest.triangle = hit ? static_cast<int>(i) : nearest.triangle;
    }
  }
}

/// What a packet is cast at: meshes with their places. Pointers into the world, valid during one call.
struct Target {
  const World::Object* object;
  Eigen::Matrix3f R_object_supply;
  Vector3f t_object_supply;
};

inline __attribute__((always_inline)) void cast_packet(const std::vector<Target>& targets, const Vector3f& origin,
                                                       const Vector3f* directions, std::size_t count, float limit,
                                                       BundleHit* hits) {
  Rays rays;
  rays.origin = origin;
  for (std::size_t lane = 0; lane < kLanes; ++lane)
    for (int k = 0; k < 3; ++k)
      rays.direction[static_cast<std::size_t>(k)][lane] = directions[std::min(lane, count - 1)][k];
  for (std::size_t k = 0; k < 3; ++k) rays.inverse[k] = inverted(rays.direction[k]);
  Nearest nearest{Lanes{} + limit, Mask{} - 1};
  std::array<const Target*, kLanes> of{};
  for (const Target& target : targets) {
    if (!any(meets(rays, target.object->box.min().data(), target.object->box.max().data(), nearest.distance))) continue;
    Rays own;
    own.origin = target.R_object_supply * origin + target.t_object_supply;
    const Eigen::Matrix3f& R = target.R_object_supply;
    for (int k = 0; k < 3; ++k) {
      const auto axis = static_cast<std::size_t>(k);
      own.direction[axis] = R(k, 0) * rays.direction[0] + R(k, 1) * rays.direction[1] + R(k, 2) * rays.direction[2];
      own.inverse[axis] = inverted(own.direction[axis]);
    }
    Nearest inside{nearest.distance, Mask{} - 1};
    traverse(target.object->mesh->view(), own, inside);
    nearest.distance = inside.distance;
    for (std::size_t lane = 0; lane < kLanes; ++lane)
      if (inside.triangle[lane] >= 0) nearest.triangle[lane] = inside.triangle[lane], of[lane] = &target;
  }
  for (std::size_t lane = 0; lane < count; ++lane) {
    BundleHit& hit = hits[lane];
    hit = {kInfinity, 0, Vector3f::Zero()};
    if (of[lane] == nullptr) continue;
    const RayMesh& mesh = *of[lane]->object->mesh;
    hit.distance_mm = nearest.distance[lane];
    hit.object = of[lane]->object->id;
    hit.normal =
        of[lane]->R_object_supply.transpose() * mesh.normal(static_cast<std::uint32_t>(nearest.triangle[lane]));
  }
}

using Cast = void (*)(const std::vector<Target>&, const Vector3f&, const Vector3f*, std::size_t, float, BundleHit*);
void cast_packet_any(const std::vector<Target>& targets, const Vector3f& origin, const Vector3f* directions,
                     std::size_t count, float limit, BundleHit* hits) {
  cast_packet(targets, origin, directions, count, limit, hits);
}
#ifdef __x86_64__
__attribute__((target("avx2,fma"))) void cast_packet_avx2(const std::vector<Target>& targets, const Vector3f& origin,
                                                          const Vector3f* directions, std::size_t count, float limit,
                                                          BundleHit* hits) {
  cast_packet(targets, origin, directions, count, limit, hits);
}
#endif

Cast fastest() {
#ifdef __x86_64__
  if (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma")) return cast_packet_avx2;
#endif
  return cast_packet_any;
}

Target target_of(const World::Object& object) {
  const Eigen::Isometry3d inverse = object.T_supply_object.iso.inverse();
  return {&object, inverse.linear().cast<float>(), inverse.translation().cast<float>()};
}

void cast_all(const std::vector<Target>& targets, const Vector3f& origin, std::span<const Vector3f> directions,
              float limit, std::vector<BundleHit>& hits) {
  static const Cast cast = fastest();
  hits.resize(directions.size());
  for (std::size_t i = 0; i < directions.size(); i += kLanes)
    cast(targets, origin, &directions[i], std::min(kLanes, directions.size() - i), limit, &hits[i]);
}
}  // namespace

bool BundleHit::met() const { return distance_mm < kInfinity; }

void cast_bundle(const World& world, const Vector3f& origin_mm, std::span<const Vector3f> directions, float limit_mm,
                 std::vector<BundleHit>& hits) {
  // What the whole bundle misses is not asked again for each packet: its box spans the origin and all ends.
  Eigen::AlignedBox3f reach;
  reach.extend(origin_mm);
  for (const Vector3f& direction : directions) reach.extend(Vector3f{origin_mm + limit_mm * direction});
  std::vector<Target> targets;
  for (const World::Object& object : world.objects())
    if (object.box.intersects(reach)) targets.push_back(target_of(object));
  // Nearest first: what is hit there hides most of the others; supply and floor are behind everything.
  std::ranges::sort(targets, {}, [&](const Target& t) { return t.object->box.squaredExteriorDistance(origin_mm); });
  targets.push_back(target_of(world.surroundings()));
  cast_all(targets, origin_mm, directions, limit_mm, hits);
}

void cast_bundle(const World::Object& object, const Vector3f& origin_mm, std::span<const Vector3f> directions,
                 float limit_mm, std::vector<BundleHit>& hits) {
  cast_all({target_of(object)}, origin_mm, directions, limit_mm, hits);
}
}  // namespace binpick::emulators
