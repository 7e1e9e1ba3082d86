#include "tests/emulators/world/physics.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "base/check.hpp"

namespace binpick::emulators {
using Eigen::Vector3d;

namespace {
constexpr double kStep_s = 1.0 / 240;
constexpr double kStillSpeed_mm_s = 3, kStillTurn_rad_s = 0.03;
constexpr double kStillFor_s = 0.2;
constexpr double kDropEvery_s = 0.35;
constexpr double kSettle_s = 8;  // at most, after the last drop
constexpr double kFriction = 0.5, kSupplyFriction = 0.4;
constexpr btScalar kLinearDamping = 0.05F, kAngularDamping = 0.2F;
/// Speed that is lost in a second, until so long after a body was taken.
struct Brake {
  double until_s, damping;
};
constexpr Brake kBrakes[] = {{0.8, 0.2}, {1.4, 0.99}, {2, 0.9999}};

/// Deepest contact of two bodies.
struct Deepest : btCollisionWorld::ContactResultCallback {
  bool met = false;
  btScalar distance = 0;
  btScalar addSingleResult(btManifoldPoint& point, const btCollisionObjectWrapper*, int, int,
                           const btCollisionObjectWrapper*, int, int) override {
    if (!met || point.getDistance() < distance) distance = point.getDistance();
    met = true;
    return 0;
  }
};
}  // namespace

Physics::Physics(const ExamplePart& part, const Vector3d& supply_size_mm) : size_mm_{supply_size_mm} {
  Eigen::AlignedBox3f box;
  for (const auto& v : part.mesh.vertices_mm) box.extend(v);
  radius_mm_ = box.sizes().norm() / 2;
  unit_mm_ = radius_mm_;
  margin_mm_ = 0.004 * radius_mm_;
  dynamics_.setGravity({0, 0, units(-9810)});
  dynamics_.getSolverInfo().m_numIterations = 20;
  add_supply();
  add_shape(part);
}

Physics::~Physics() {
  for (auto& body : bodies_)
    if (body) dynamics_.removeRigidBody(body.get());
  for (auto& body : supply_) dynamics_.removeRigidBody(body.get());
}

void Physics::step() { dynamics_.stepSimulation(static_cast<btScalar>(kStep_s), 0); }

void Physics::throw_in(int count, std::uint64_t seed) {
  BINPICK_CHECK(count >= 0 && size_mm_.minCoeff() > 0);
  std::mt19937_64 random{seed};
  for (int i = 0; i < count; ++i) {
    drop(random);
    run_for(kDropEvery_s);
  }
  run_until_still(kSettle_s);
}

void Physics::drop(std::mt19937_64& random) {
  // Plain arithmetic on the generator's numbers: the library's distributions may differ between machines.
  const auto uniform = [&](double low, double high) {
    return low + (high - low) * static_cast<double>(random() >> 11) * 0x1p-53;
  };
  double top_mm = 0;
  for (const auto& body : bodies_) {
    if (!body) continue;
    btVector3 low, high;
    body->getAabb(low, high);
    top_mm = std::max(top_mm, static_cast<double>(high.z()) * unit_mm_);
  }
  const auto side = [&](double width_mm) {
    const double free_mm = std::max(0.0, width_mm / 2 - radius_mm_);
    return uniform(-free_mm, free_mm);
  };
  // Shoemake's uniform rotation.
  const double u = uniform(0, 1), v = 2 * std::numbers::pi * uniform(0, 1), w = 2 * std::numbers::pi * uniform(0, 1);
  const btQuaternion turn{
      static_cast<btScalar>(std::sqrt(1 - u) * std::sin(v)), static_cast<btScalar>(std::sqrt(1 - u) * std::cos(v)),
      static_cast<btScalar>(std::sqrt(u) * std::sin(w)), static_cast<btScalar>(std::sqrt(u) * std::cos(w))};
  const double x = side(size_mm_.x()), y = side(size_mm_.y());
  add_body(btTransform{turn, {units(x), units(y), units(top_mm + 1.2 * radius_mm_)}});
}

void Physics::place(const Pose& T_supply_object) { add_body(centre_of(T_supply_object)); }

void Physics::add_body(const btTransform& T_supply_centre) {
  btRigidBody::btRigidBodyConstructionInfo info{1, nullptr, shape_.get(), inertia_};
  info.m_startWorldTransform = T_supply_centre;
  info.m_friction = static_cast<btScalar>(kFriction);
  info.m_restitution = 0.05F;
  info.m_rollingFriction = 0.01F;
  info.m_linearDamping = kLinearDamping;
  info.m_angularDamping = kAngularDamping;
  auto& body = bodies_.emplace_back(std::make_unique<btRigidBody>(info));
  body->setUserIndex(static_cast<int>(bodies_.size()) - 1);
  body->setSleepingThresholds(units(kStillSpeed_mm_s), static_cast<btScalar>(kStillTurn_rad_s));
  body->setCcdMotionThreshold(units(0.3 * radius_mm_));
  body->setCcdSweptSphereRadius(units(0.1 * radius_mm_));
  dynamics_.addRigidBody(body.get());
}

void Physics::run_for(double seconds) {
  for (int i = 0, n = static_cast<int>(std::lround(seconds / kStep_s)); i < n; ++i) step();
}

bool Physics::run_until_still(double seconds_max) {
  double still_s = 0;
  for (double t = 0; t < seconds_max && still_s < kStillFor_s; t += kStep_s) {
    step();
    const bool still = std::ranges::all_of(bodies_, [&](const auto& body) {
      return !body || (body->getLinearVelocity().length() < units(kStillSpeed_mm_s) &&
                       body->getAngularVelocity().length() < static_cast<btScalar>(kStillTurn_rad_s));
    });
    still_s = still ? still_s + kStep_s : 0;
  }
  return still_s >= kStillFor_s;
}

Pile Physics::result() {
  Pile pile;
  for (std::size_t k = 0; k < bodies_.size(); ++k) {
    if (!bodies_[k]) continue;
    pile.T_supply_object.push_back(pose(k));
    pile.speed_max_mm_s = std::max(pile.speed_max_mm_s, speed_mm_s(k));
  }
  dynamics_.performDiscreteCollisionDetection();
  for (int i = 0; i < dispatcher_.getNumManifolds(); ++i) {
    const btPersistentManifold* manifold = dispatcher_.getManifoldByIndexInternal(i);
    for (int k = 0; k < manifold->getNumContacts(); ++k) {
      // Bodies are surrounded by their margin: contact begins twice that before they touch.
      const double gap_mm = static_cast<double>(manifold->getContactPoint(k).getDistance()) * unit_mm_ + margin_mm_;
      pile.penetration_max_mm = std::max(pile.penetration_max_mm, -gap_mm);
    }
  }
  return pile;
}

void Physics::remove(std::size_t body) {
  BINPICK_CHECK(holds(body));
  dynamics_.removeRigidBody(bodies_[body].get());
  bodies_[body].reset();
}

Physics::Pose Physics::pose(std::size_t body) const {
  const btTransform object = bodies_[body]->getWorldTransform() * principal_.inverse();
  const btQuaternion q = object.getRotation();
  const btVector3& t = object.getOrigin();
  Pose T;
  T.iso.linear() = Eigen::Quaterniond{q.w(), q.x(), q.y(), q.z()}.normalized().toRotationMatrix();
  T.iso.translation() = unit_mm_ * Vector3d{t.x(), t.y(), t.z()};
  return T;
}

btTransform Physics::centre_of(const Pose& T_supply_object) const {
  const Eigen::Quaterniond q{T_supply_object.iso.linear()};
  const Vector3d& t = T_supply_object.iso.translation();
  const btTransform object{btQuaternion{static_cast<btScalar>(q.x()), static_cast<btScalar>(q.y()),
                                        static_cast<btScalar>(q.z()), static_cast<btScalar>(q.w())},
                           {units(t.x()), units(t.y()), units(t.z())}};
  return object * principal_;
}

double Physics::speed_mm_s(std::size_t body) const {
  return static_cast<double>(bodies_[body]->getLinearVelocity().length()) * unit_mm_;
}

/// Bullet sorts bodies by whether they can move when they are added.
void Physics::set_free(std::size_t body, bool free) {
  btRigidBody& b = *bodies_[body];
  if (b.isStaticObject() != free) return;
  dynamics_.removeRigidBody(&b);
  b.setMassProps(free ? 1 : 0, free ? inertia_ : btVector3{0, 0, 0});
  b.updateInertiaTensor();
  dynamics_.addRigidBody(&b);
}

void Physics::settle_again(const std::set<std::size_t>& free) {
  for (std::size_t k = 0; k < bodies_.size(); ++k)
    if (bodies_[k]) set_free(k, free.contains(k));
  for (const std::size_t k : free) bodies_[k]->activate(true);
  // What rolls or rattles for seconds is braked more and more; it still falls.
  double seconds = 0;
  for (const Brake& brake : kBrakes) {
    for (auto& body : bodies_)
      if (body) body->setDamping(static_cast<btScalar>(brake.damping), static_cast<btScalar>(brake.damping));
    if (run_until_still(brake.until_s - seconds)) break;
    seconds = brake.until_s;
  }
  for (auto& body : bodies_)
    if (body) body->setDamping(kLinearDamping, kAngularDamping);
  fall_asleep();
}

void Physics::fall_asleep() {
  for (auto& body : bodies_) {
    if (!body) continue;
    body->setLinearVelocity({0, 0, 0});
    body->setAngularVelocity({0, 0, 0});
    body->setActivationState(ISLAND_SLEEPING);
  }
}

std::size_t Physics::index_of(const btCollisionObject* body) const {
  const int index = body->getUserIndex();
  return index < 0 ? kSupply : static_cast<std::size_t>(index);
}

std::vector<std::size_t> Physics::touching(std::size_t body) {
  std::vector<std::size_t> others;
  for (const auto& [other, depth_mm] : reach_mm(body, pose(body)))
    if (other != kSupply) others.push_back(other);
  return others;
}

std::map<std::size_t, double> Physics::reach_mm(std::size_t body, const Pose& T_supply_object) {
  btCollisionObject probe;
  probe.setCollisionShape(shape_.get());
  probe.setWorldTransform(centre_of(T_supply_object));
  btVector3 low, high;
  shape_->getAabb(probe.getWorldTransform(), low, high);
  std::map<std::size_t, double> reached;
  const auto test = [&](std::size_t index, btRigidBody& other) {
    btVector3 other_low, other_high;
    other.getAabb(other_low, other_high);
    if (!TestAabbAgainstAabb2(low, high, other_low, other_high)) return;
    Deepest deepest;
    dynamics_.contactPairTest(&probe, &other, deepest);
    if (!deepest.met) return;
    // Both are surrounded by their margin.
    const double depth_mm = -static_cast<double>(deepest.distance) * unit_mm_ - 2 * margin_mm_;
    const auto [it, first] = reached.emplace(index, depth_mm);
    if (!first) it->second = std::max(it->second, depth_mm);
  };
  for (std::size_t k = 0; k < bodies_.size(); ++k)
    if (k != body && bodies_[k]) test(k, *bodies_[k]);
  for (auto& slab : supply_) test(kSupply, *slab);
  return reached;
}

/// Walls stand higher than they are seen, so that nothing leaves the supply while it falls.
void Physics::add_supply() {
  const double thick = 4 * radius_mm_, high = size_mm_.z() + 40 * radius_mm_;
  const double x = size_mm_.x() / 2, y = size_mm_.y() / 2;
  struct Slab {
    Vector3d half, middle;
  };
  const Slab slabs[] = {{{x + thick, y + thick, thick}, {0, 0, -thick}},
                        {{thick, y + thick, high}, {-x - thick, 0, high}},
                        {{thick, y + thick, high}, {x + thick, 0, high}},
                        {{x, thick, high}, {0, -y - thick, high}},
                        {{x, thick, high}, {0, y + thick, high}}};
  for (const Slab& slab : slabs) {
    auto& shape = slab_shapes_.emplace_back(
        std::make_unique<btBoxShape>(btVector3{units(slab.half.x()), units(slab.half.y()), units(slab.half.z())}));
    shape->setMargin(units(margin_mm_));
    btRigidBody::btRigidBodyConstructionInfo info{0, nullptr, shape.get()};
    info.m_startWorldTransform.setOrigin({units(slab.middle.x()), units(slab.middle.y()), units(slab.middle.z())});
    info.m_friction = static_cast<btScalar>(kSupplyFriction);
    auto& body = supply_.emplace_back(std::make_unique<btRigidBody>(info));
    body->setUserIndex(-1);
    dynamics_.addRigidBody(body.get());
  }
}

void Physics::add_shape(const ExamplePart& part) {
  // First about the object's frame, to learn the masses; then again about the principal axes, where Bullet wants
  // them.
  btCompoundShape about_object;
  std::vector<btScalar> masses;
  for (const ConvexPiece& piece : part.pieces) {
    auto& hull = hulls_.emplace_back(std::make_unique<btConvexHullShape>());
    Eigen::AlignedBox3f box;
    for (const auto& p : piece.points_mm) box.extend(p);
    const Eigen::Vector3f middle = box.center();
    for (const auto& p : piece.points_mm) {
      const Eigen::Vector3f q = p - middle;
      hull->addPoint({units(q.x()), units(q.y()), units(q.z())}, false);
    }
    hull->recalcLocalAabb();
    hull->setMargin(units(margin_mm_));
    btTransform place;
    place.setIdentity();
    place.setOrigin({units(middle.x()), units(middle.y()), units(middle.z())});
    about_object.addChildShape(place, hull.get());
    masses.push_back(box.volume());
  }
  btScalar sum = 0;
  for (const btScalar mass : masses) sum += mass;
  for (btScalar& mass : masses) mass /= sum;
  about_object.calculatePrincipalAxisTransform(masses.data(), principal_, inertia_);
  shape_ = std::make_unique<btCompoundShape>();
  for (int i = 0; i < about_object.getNumChildShapes(); ++i)
    shape_->addChildShape(principal_.inverse() * about_object.getChildTransform(i), about_object.getChildShape(i));
  shape_->setMargin(units(margin_mm_));
}

}  // namespace binpick::emulators
