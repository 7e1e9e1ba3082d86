#pragma once

#include <Eigen/Geometry>
#include <btBulletDynamicsCommon.h>
#include <cstddef>
#include <map>
#include <memory>
#include <random>
#include <set>
#include <vector>

#include "tests/emulators/world/pile.hpp"

/// Bullet's side of a pile; for pile.cpp and living_pile.cpp.
namespace binpick::emulators {
/// One simulation of bodies of one part in one supply; they are named by their index in the order of adding. Bullet
/// works best with bodies of about one unit: lengths are divided by half the part's size. The same calls give the same
/// poses.
class Physics {
 public:
  using Pose = Transform<frame::Supply, frame::Object>;

  Physics(const ExamplePart& part, const Eigen::Vector3d& supply_size_mm);
  ~Physics();
  Physics(const Physics&) = delete;
  Physics& operator=(const Physics&) = delete;

  /// Drops so many one after the other from above, each turned at random, and waits until they lie still.
  void throw_in(int count, std::uint64_t seed);
  void place(const Pose& T_supply_object);  ///< At rest.
  /// After something was removed: these move, all others stand like walls. All fall asleep then.
  void settle_again(const std::set<std::size_t>& free);
  Pile result();

  void remove(std::size_t body);  ///< Its index stays empty.
  bool holds(std::size_t body) const { return bodies_[body] != nullptr; }
  Pose pose(std::size_t body) const;
  double speed_mm_s(std::size_t body) const;
  /// Bodies that lie still are no longer reckoned with until something that touches them moves.
  void fall_asleep();
  std::vector<std::size_t> touching(std::size_t body);  ///< Within the margin; without the supply.
  /// How deep this body would reach into others if it were there; only of those that it would touch.
  std::map<std::size_t, double> reach_mm(std::size_t body, const Pose& T_supply_object);
  static constexpr std::size_t kSupply = static_cast<std::size_t>(-1);  ///< In the answer of reach_mm().

 private:
  void drop(std::mt19937_64& random);
  void run_for(double seconds);
  bool run_until_still(double seconds_max);
  btScalar units(double mm) const { return static_cast<btScalar>(mm / unit_mm_); }
  void step();
  void add_supply();
  void add_shape(const ExamplePart& part);
  void add_body(const btTransform& T_supply_centre);
  void set_free(std::size_t body, bool free);
  btTransform centre_of(const Pose& T_supply_object) const;
  std::size_t index_of(const btCollisionObject* body) const;

  Eigen::Vector3d size_mm_;
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

/// A throw that ends with bodies in each other (deeper than 0.5 mm) is thrown again with the next seed.
std::unique_ptr<Physics> throw_well(const ExamplePart& part, int count, const Eigen::Vector3d& supply_size_mm,
                                    std::uint64_t seed);
}  // namespace binpick::emulators
