#pragma once

#include <cstdint>
#include <future>
#include <optional>
#include <string>

#include "config/config.hpp"
#include "tests/emulators/world/grip.hpp"
#include "tests/emulators/world/living_pile.hpp"
#include "vision/symmetry.hpp"

/// The emulated supply with its objects, and the truth about them. A supply without walls is the window over a belt:
/// objects lie there by themselves.
namespace binpick::emulators {
struct BinOptions {
  std::size_t recipe = 0;  ///< Index in the cell file's recipes.
  std::size_t supply = 0;
  int objects = 14;
  std::uint64_t seed = 1;
};

class Bin {
 public:
  /// Drops the objects and lets them settle: takes seconds. A belt bears as many as there is room for (belt.hpp).
  /// Throws std::runtime_error (a mesh that cannot be read).
  Bin(const config::Config& config, const BinOptions& options);

  const World& world() const { return pile_.world(); }
  bool is_belt() const { return supply_.size_mm.z() <= 0; }
  std::size_t objects_left() const;
  /// Objects that lie over or under another one, seen from above.
  std::size_t overlapping() const;
  std::uint64_t seed() const { return seed_; }

  /// How far the object that a grasp pose stands for lies from the nearest true one, symmetry-aware. The pose belongs
  /// to one of the part's grasps: the one that fits best is taken.
  struct Nearest {
    int object = 0;  ///< Its id in the world.
    vision::PoseDistance error;
  };
  std::optional<Nearest> nearest(const Transform<frame::Base, frame::Tcp>& T_base_grasp) const;
  /// What comes of sending the gripper there by way of the approach pose, and out by way of the retreat pose
  /// (grip.hpp). A part file without a gripper says too little for that: its objects are taken within 15 mm and 10
  /// degrees. A taken object leaves the bin, and the others settle again.
  GripResult take(const Transform<frame::Base, frame::Tcp>& T_base_approach,
                  const Transform<frame::Base, frame::Tcp>& T_base_grasp,
                  const Transform<frame::Base, frame::Tcp>& T_base_retreat);
  /// The highest object goes. False when the bin is empty.
  bool take_highest();

  /// Fills a new bin with the next seed, or moves the belt on, in a thread of its own; it is in place when
  /// poll_refill() says so.
  void start_refill();
  bool refilling() const { return next_.valid(); }
  bool poll_refill();  ///< True once, when the new objects are in.

 private:
  LivingPile fill(std::uint64_t seed) const;

  const config::Supply& supply_;
  const config::Part& part_;
  BinOptions options_;
  vision::Mesh mesh_;
  vision::Symmetry symmetry_;
  double radius_mm_ = 0;
  std::uint64_t seed_;
  LivingPile pile_;
  std::future<LivingPile> next_;
};
}  // namespace binpick::emulators
