#include "tests/emulators/world/pile.hpp"

#include <memory>

#include "tests/emulators/world/physics.hpp"

namespace binpick::emulators {
using Eigen::Vector3d;

namespace {
constexpr double kPenetrationMax_mm = 0.5;
constexpr int kThrowsMax = 8;
}  // namespace

Pile settle(const ExamplePart& part, int count, const Vector3d& supply_size_mm, std::uint64_t seed) {
  Physics physics{part, supply_size_mm};
  physics.throw_in(count, seed);
  return physics.result();
}

std::unique_ptr<Physics> throw_well(const ExamplePart& part, int count, const Vector3d& supply_size_mm,
                                    std::uint64_t seed) {
  std::unique_ptr<Physics> physics;
  for (int again = 0; again < kThrowsMax; ++again) {
    physics = std::make_unique<Physics>(part, supply_size_mm);
    physics->throw_in(count, seed + static_cast<std::uint64_t>(again) * 1'000'003);
    if (physics->result().penetration_max_mm <= kPenetrationMax_mm) break;
  }
  return physics;
}

World make_pile(const ExamplePart& part, int count, const Vector3d& supply_size_mm, std::uint64_t seed) {
  World world{supply_size_mm};
  const auto mesh = std::make_shared<RayMesh>(part.mesh);
  const auto physics = throw_well(part, count, supply_size_mm, seed);
  for (const auto& T : physics->result().T_supply_object) world.add(part.name, mesh, T);
  return world;
}
}  // namespace binpick::emulators
