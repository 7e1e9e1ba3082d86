#include "tests/emulators/world/pile.hpp"

#include <algorithm>
#include <btBulletDynamicsCommon.h>
#include <cmath>
#include <memory>
#include <numbers>
#include <random>

#include "base/check.hpp"

namespace binpick::emulators {
namespace {
using Eigen::Vector3d;

constexpr double kStep_s = 1.0 / 240;
constexpr double kDropEvery_s = 0.35;
constexpr double kSettle_s = 8;  // at most, after the last drop
constexpr double kStillSpeed_mm_s = 3, kStillTurn_rad_s = 0.03;
constexpr double kStillFor_s = 0.2;
constexpr double kPenetrationMax_mm = 0.5;
constexpr int kThrowsMax = 8;

/// One simulation. Bullet works best with bodies of about one unit: lengths are divided by half the part's size.
class Simulation {
 public:
  Simulation(const ExamplePart& part, const Vector3d& size_mm) : size_mm_{size_mm} {
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
  ~Simulation() {
    for (auto& body : bodies_) dynamics_.removeRigidBody(body.get());
    for (auto& body : supply_) dynamics_.removeRigidBody(body.get());
  }
  Simulation(const Simulation&) = delete;
  Simulation& operator=(const Simulation&) = delete;

  void drop(std::mt19937_64& random) {
    // Plain arithmetic on the generator's numbers: the library's distributions may differ between machines.
    const auto uniform = [&](double low, double high) {
      return low + (high - low) * static_cast<double>(random() >> 11) * 0x1p-53;
    };
    double top_mm = 0;
    for (const auto& body : bodies_) {
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
    const btTransform start{turn, {units(x), units(y), units(top_mm + 1.2 * radius_mm_)}};
    btRigidBody::btRigidBodyConstructionInfo info{1, nullptr, shape_.get(), inertia_};
    info.m_startWorldTransform = start;
    info.m_friction = 0.5F;
    info.m_restitution = 0.05F;
    info.m_rollingFriction = 0.01F;
    info.m_linearDamping = 0.05F;
    info.m_angularDamping = 0.2F;
    auto& body = bodies_.emplace_back(std::make_unique<btRigidBody>(info));
    body->setSleepingThresholds(units(kStillSpeed_mm_s), static_cast<btScalar>(kStillTurn_rad_s));
    body->setCcdMotionThreshold(units(0.3 * radius_mm_));
    body->setCcdSweptSphereRadius(units(0.1 * radius_mm_));
    dynamics_.addRigidBody(body.get());
  }

  void run_for(double seconds) {
    for (int i = 0, n = static_cast<int>(std::lround(seconds / kStep_s)); i < n; ++i) step();
  }

  void run_until_still(double seconds_max) {
    double still_s = 0;
    for (double t = 0; t < seconds_max && still_s < kStillFor_s; t += kStep_s) {
      step();
      const bool still = std::ranges::all_of(bodies_, [&](const auto& body) {
        return body->getLinearVelocity().length() < units(kStillSpeed_mm_s) &&
               body->getAngularVelocity().length() < static_cast<btScalar>(kStillTurn_rad_s);
      });
      still_s = still ? still_s + kStep_s : 0;
    }
  }

  Pile result() {
    Pile pile;
    for (const auto& body : bodies_) {
      const btTransform& centre = body->getWorldTransform();
      const btTransform object = centre * principal_.inverse();
      const btQuaternion q = object.getRotation();
      const btVector3& t = object.getOrigin();
      auto& T = pile.T_supply_object.emplace_back();
      T.iso.linear() = Eigen::Quaterniond{q.w(), q.x(), q.y(), q.z()}.normalized().toRotationMatrix();
      T.iso.translation() = unit_mm_ * Vector3d{t.x(), t.y(), t.z()};
      pile.speed_max_mm_s =
          std::max(pile.speed_max_mm_s, static_cast<double>(body->getLinearVelocity().length()) * unit_mm_);
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

 private:
  btScalar units(double mm) const { return static_cast<btScalar>(mm / unit_mm_); }
  void step() { dynamics_.stepSimulation(static_cast<btScalar>(kStep_s), 0); }

  /// Walls stand higher than they are seen, so that nothing leaves the supply while it falls.
  void add_supply() {
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
      info.m_friction = 0.4F;
      dynamics_.addRigidBody(supply_.emplace_back(std::make_unique<btRigidBody>(info)).get());
    }
  }

  void add_shape(const ExamplePart& part) {
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

  Vector3d size_mm_;
  double radius_mm_ = 0, unit_mm_ = 1, margin_mm_ = 0;
  btDefaultCollisionConfiguration configuration_;
  btCollisionDispatcher dispatcher_{&configuration_};
  btDbvtBroadphase broadphase_;
  btSequentialImpulseConstraintSolver solver_;
  btDiscreteDynamicsWorld dynamics_{&dispatcher_, &broadphase_, &solver_, &configuration_};
  std::vector<std::unique_ptr<btConvexHullShape>> hulls_;
  std::vector<std::unique_ptr<btBoxShape>> slab_shapes_;
  std::unique_ptr<btCompoundShape> shape_;
  btTransform principal_;  // object ← principal axes
  btVector3 inertia_{0, 0, 0};
  std::vector<std::unique_ptr<btRigidBody>> supply_, bodies_;
};
}  // namespace

Pile settle(const ExamplePart& part, int count, const Vector3d& supply_size_mm, std::uint64_t seed) {
  BINPICK_CHECK(count >= 0 && supply_size_mm.minCoeff() > 0);
  std::mt19937_64 random{seed};
  Simulation simulation{part, supply_size_mm};
  for (int i = 0; i < count; ++i) {
    simulation.drop(random);
    simulation.run_for(kDropEvery_s);
  }
  simulation.run_until_still(kSettle_s);
  return simulation.result();
}

World make_pile(const ExamplePart& part, int count, const Vector3d& supply_size_mm, std::uint64_t seed) {
  Pile pile = settle(part, count, supply_size_mm, seed);
  for (int again = 1; again < kThrowsMax && pile.penetration_max_mm > kPenetrationMax_mm; ++again)
    pile = settle(part, count, supply_size_mm, seed + static_cast<std::uint64_t>(again) * 1'000'003);
  World world{supply_size_mm};
  const auto mesh = std::make_shared<RayMesh>(part.mesh);
  for (const auto& T : pile.T_supply_object) world.add(part.name, mesh, T);
  return world;
}
}  // namespace binpick::emulators
