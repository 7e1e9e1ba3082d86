#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>

#include "base/expected.hpp"
#include "vision/mesh.hpp"
#include "vision/symmetry.hpp"

namespace binpick::vision {
/// Device class that will see the part: expected noise and point spacing (datasheet figures, partly from memory; one
/// table in the code, scanner_class_table()).
enum class ScannerClass { Lps36Hi, Lps36, Lms400 };

struct ScannerFigures {
  double noise_mm;           ///< 1 sd at normal incidence.
  double spacing_along_mm;   ///< Between profiles.
  double spacing_across_mm;  ///< Between points of one profile at stand_off_mm.
  double stand_off_mm;
};
const ScannerFigures& figures_of(ScannerClass scanner);

/// How objects lie: in any rotation, or each by itself in one of its resting poses.
enum class Picking { Bin, Conveyor };

/// What a PART.toml says; an absent value has a default derived from the mesh (see resolve in training).
struct PartOptions {
  std::string name;
  std::optional<ScannerClass> scanner;  ///< Default: Lps36 under 150 mm diameter, else Lms400.
  Picking picking = Picking::Bin;
  std::optional<double> pixel_mm;
  std::optional<int> rotations;      ///< Training rotations before the symmetry reduces them.
  std::optional<Symmetry> symmetry;  ///< Default: found from the mesh. Its centre comes from the next option.
  std::optional<Eigen::Vector3d> symmetry_centre_mm;  ///< Default: the surface centroid, which no symmetry moves.
  std::optional<double> symmetry_tolerance_mm;
  std::optional<int> votes_per_feature_max;
  std::uint64_t seed = 1;
};

struct TrainingProgress {
  double fraction;
};
struct TrainingSummary {
  Symmetry symmetry;
  std::size_t triangles = 0;           ///< Of the mesh.
  std::size_t triangles_rendered = 0;  ///< Of the simpler one that stands for it.
  std::size_t resting_poses = 0;       ///< Of a part on a conveyor.
  int rotations = 0;
  std::uint64_t votes = 0;
  double mib = 0;
  double seconds = 0;
};

struct KnowledgeBaseError {
  enum class Kind { CannotOpen, NotAKnowledgeBase, Version, Truncated, Checksum } kind = Kind::CannotOpen;
  std::string text;  ///< What, where, what to do.
};

/// Everything detection needs to know of one part: mesh, symmetry, views, features and votes. Immutable, memory-mapped
/// when it comes from a file, shared freely between threads (cheap copies).
class KnowledgeBase {
 public:
  /// Maps the file and verifies header and index (version, length, their checksum, every offset): milliseconds,
  /// whatever the file's size. Replace the file by renaming (save() does), never write over it, while it is open.
  static Expected<KnowledgeBase, KnowledgeBaseError> open(const std::string& path);
  /// The same for a copy of a file's bytes; `name` stands in the messages.
  static Expected<KnowledgeBase, KnowledgeBaseError> parse(std::span<const std::byte> bytes, const std::string& name);
  /// Verifies everything else: the whole file's checksum and the content of its lists. Done once, however often it is
  /// called; detect() insists on it.
  Expected<void, KnowledgeBaseError> verify() const;
  Expected<void, KnowledgeBaseError> save(const std::string& path) const;

  /// Of the whole file: the same for the same training, whatever its name.
  std::uint64_t checksum() const;
  /// Of the mesh it was trained from, as mesh_hash() has it.
  std::uint64_t mesh_hash() const;
  const std::string& part_name() const;
  const Mesh& mesh() const;
  const Symmetry& symmetry() const;
  ScannerClass scanner() const;
  double pixel_mm() const;
  double noise_mm() const;
  double diameter_mm() const;

  struct Impl;
  explicit KnowledgeBase(std::shared_ptr<const Impl> impl);
  const Impl& impl() const { return *impl_; }  ///< For vision/ itself (knowledge_base_impl.hpp).

 private:
  std::shared_ptr<const Impl> impl_;
};

/// The symmetry that the options give, completed, or the one found from the mesh.
Symmetry symmetry_of(const Mesh& mesh, const PartOptions& options);

/// The first of the part's options that was another one when the knowledge base was trained ("pixel_mm"); empty: none
/// of those that it tells of. What has its default now is compared where that does not take the training itself.
std::string other_option(const KnowledgeBase& trained, const PartOptions& options);

/// Renders the mesh in every training rotation and stores votes (docs/vision.md, training).
/// Deterministic for the same mesh and options. `progress` may be empty.
Expected<KnowledgeBase, MeshError> train(const Mesh& mesh, const PartOptions& options,
                                         const std::function<void(TrainingProgress)>& progress,
                                         TrainingSummary* summary, int threads = 0);
}  // namespace binpick::vision
