#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "base/frames.hpp"
#include "tests/emulators/world/example_parts.hpp"
#include "tests/emulators/world/world.hpp"

namespace binpick::emulators {
class Physics;

/// A pile that goes on living: when an object is taken, what lay on it comes to rest again. The same calls give the
/// same poses, bit for bit. What lies still is not reckoned with until something that touches it moves.
class LivingPile {
 public:
  using Pose = Transform<frame::Supply, frame::Object>;

  /// Thrown in and settled, as make_pile() does.
  LivingPile(const ExamplePart& part, int count, const Eigen::Vector3d& supply_size_mm, std::uint64_t seed);
  /// As placed; nothing falls before the first take().
  LivingPile(const ExamplePart& part, const std::vector<Pose>& T_supply_object, const Eigen::Vector3d& supply_size_mm);
  ~LivingPile();
  LivingPile(LivingPile&&) noexcept;
  LivingPile& operator=(LivingPile&&) noexcept;

  const World& world() const { return world_; }
  const ExamplePart& part() const { return part_; }

  /// The object leaves, the others settle. Returns how far the one that moved most did.
  double take(int id);

  /// Where an object that is carried along these poses, while all others stay, first reaches deeper than
  /// `limit_mm` into another one or the supply than it does at the first of them; nothing: nowhere. By the bodies that
  /// the physics uses: convex pieces, bores filled.
  struct Push {
    std::size_t pose = 0;  ///< Index.
    int object = 0;        ///< 0: the supply.
    double depth_mm = 0;   ///< Beyond that of the first pose.
  };
  std::optional<Push> first_push(int id, const std::vector<Pose>& T_supply_object, double limit_mm) const;

 private:
  LivingPile(const ExamplePart& part, const Eigen::Vector3d& supply_size_mm, std::unique_ptr<Physics> physics,
             std::size_t count);
  bool stirred(std::size_t body) const;  ///< Since the last take().
  double lowest_mm(const Pose& T_supply_object) const;
  std::size_t body_of(int id) const { return static_cast<std::size_t>(id) - 1; }

  ExamplePart part_;
  World world_;  // ids: index of the body + 1
  std::unique_ptr<Physics> physics_;
};
}  // namespace binpick::emulators
