#include "tests/emulators/world/living_pile.hpp"

#include <algorithm>
#include <limits>
#include <set>

#include "base/check.hpp"
#include "tests/emulators/world/physics.hpp"

namespace binpick::emulators {
namespace {
/// A body that moved more than this in settling frees its neighbours.
constexpr double kStirred_mm = 0.5, kStirred_rad = 0.01;

std::unique_ptr<Physics> placed(const ExamplePart& part, const std::vector<LivingPile::Pose>& T_supply_object,
                                const Eigen::Vector3d& size_mm) {
  auto physics = std::make_unique<Physics>(part, size_mm);
  for (const auto& T : T_supply_object) physics->place(T);
  return physics;
}
}  // namespace

LivingPile::LivingPile(const ExamplePart& part, int count, const Eigen::Vector3d& supply_size_mm, std::uint64_t seed)
    : LivingPile{part, supply_size_mm, throw_well(part, count, supply_size_mm, seed), static_cast<std::size_t>(count)} {
}

LivingPile::LivingPile(const ExamplePart& part, const std::vector<Pose>& T_supply_object,
                       const Eigen::Vector3d& supply_size_mm)
    : LivingPile{part, supply_size_mm, placed(part, T_supply_object, supply_size_mm), T_supply_object.size()} {}

LivingPile::LivingPile(const ExamplePart& part, const Eigen::Vector3d& supply_size_mm, std::unique_ptr<Physics> physics,
                       std::size_t count)
    : part_{part}, world_{supply_size_mm}, physics_{std::move(physics)} {
  const auto mesh = std::make_shared<RayMesh>(part_.mesh);
  for (std::size_t k = 0; k < count; ++k) {
    const int id = world_.add(part_.name, mesh, physics_->pose(k));
    BINPICK_CHECK(body_of(id) == k);
  }
  physics_->fall_asleep();
}

LivingPile::~LivingPile() = default;
LivingPile::LivingPile(LivingPile&&) noexcept = default;
LivingPile& LivingPile::operator=(LivingPile&&) noexcept = default;

double LivingPile::take(int id) {
  const std::size_t taken = body_of(id);
  const auto neighbours = physics_->touching(taken);
  std::set<std::size_t> free{neighbours.begin(), neighbours.end()};
  physics_->remove(taken);
  world_.remove(id);
  // All at once would creep: a solver's contacts give by a hair in every step. What has a still neighbourhood stays
  // where friction holds it, and only what was really moved frees what touches it.
  for (std::size_t before = 0; before != free.size();) {
    before = free.size();
    physics_->settle_again(free);
    for (const std::size_t body : std::set{free})
      if (stirred(body))
        for (const std::size_t other : physics_->touching(body)) free.insert(other);
  }
  double moved_mm = 0;
  for (const std::size_t body : free) {
    const int other = static_cast<int>(body) + 1;
    const Pose now = physics_->pose(body);
    moved_mm =
        std::max(moved_mm, (now.iso.translation() - world_.find(other)->T_supply_object.iso.translation()).norm());
    world_.move(other, now);
  }
  return moved_mm;
}

bool LivingPile::stirred(std::size_t body) const {
  const Eigen::Isometry3d& before = world_.find(static_cast<int>(body) + 1)->T_supply_object.iso;
  const Eigen::Isometry3d now = physics_->pose(body).iso;
  return (now.translation() - before.translation()).norm() > kStirred_mm ||
         Eigen::AngleAxisd{before.linear().transpose() * now.linear()}.angle() > kStirred_rad;
}

double LivingPile::lowest_mm(const Pose& T_supply_object) const {
  const Eigen::RowVector3d up = T_supply_object.iso.linear().row(2);
  double lowest = std::numeric_limits<double>::infinity();
  for (const ConvexPiece& piece : part_.pieces)
    for (const Eigen::Vector3f& p : piece.points_mm) lowest = std::min(lowest, up.dot(p.cast<double>()));
  return lowest + T_supply_object.iso.translation().z();
}

std::optional<LivingPile::Push> LivingPile::first_push(int id, const std::vector<Pose>& T_supply_object,
                                                       double limit_mm) const {
  const std::size_t body = body_of(id);
  std::map<std::size_t, double> at_first;
  for (std::size_t k = 0; k < T_supply_object.size(); ++k) {
    const auto reached = physics_->reach_mm(body, T_supply_object[k]);
    if (k == 0) at_first = reached;
    for (const auto& [other, depth_mm] : reached) {
      // The physics' walls never end; over the real ones nothing is in the way.
      if (other == Physics::kSupply && lowest_mm(T_supply_object[k]) > world_.supply_size_mm().z()) continue;
      const auto before = at_first.find(other);
      const double more_mm = depth_mm - std::max(0.0, before == at_first.end() ? 0.0 : before->second);
      if (more_mm > limit_mm) return Push{k, other == Physics::kSupply ? 0 : static_cast<int>(other) + 1, more_mm};
    }
  }
  return std::nullopt;
}
}  // namespace binpick::emulators
