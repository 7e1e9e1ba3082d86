#pragma once

#include <Eigen/Geometry>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <mutex>
#include <span>
#include <string>
#include <vector>

#include "vision/file.hpp"
#include "vision/knowledge_base.hpp"

/// The inside of a knowledge base: written by training, read by detection, by nobody else.
namespace binpick::vision {
inline constexpr std::uint32_t kFeatureCount = 531'441;  ///< 3^12, see feature.hpp.

/// One vote: "if this feature belongs to the part in this rotation, its anchor lies there".
struct Vote {
  std::int8_t dx = 0;  ///< Pixels from the feature's pixel to the anchor's.
  std::int8_t dy = 0;
  std::int16_t dz = 0;         ///< Height of the anchor over the pixel, in units of KnowledgeBase::Impl::dz_quantum_mm.
  std::uint16_t rotation = 0;  ///< Index into views.
  std::uint16_t weight = 1;    ///< 256 is one vote.
};

/// A point of the visible surface of one view, relative to the view's first anchor, supply axes.
struct SurfaceSample {
  Eigen::Vector3f p_mm;
  Eigen::Vector3f normal;
};

/// One rotation of the part as seen from above. Its lists lie in the knowledge base's bytes.
struct View {
  Eigen::Quaternionf R_supply_object;
  /// Anchors (mean of the plateau close around the highest point; further separate maxima), best first, object frame.
  /// At least one.
  std::span<const Eigen::Vector3f> anchors_object_mm;
  std::span<const SurfaceSample> surface;  ///< Scattered evenly over the visible surface.
  std::span<const Eigen::Vector3f>
      edges_mm;           ///< On the silhouette and inner depth jumps (upper side), relative to the first anchor.
  float lowest_mm = 0;    ///< Lowest point of the part, relative to the first anchor (negative).
  float area_mm2 = 0;     ///< Of the silhouette.
  float vote_weight = 0;  ///< Sum of its votes' weights, 256 being one vote.
};

/// A view that training has just made; field by field as in View.
struct TrainedView {
  Eigen::Quaternionf R_supply_object;
  std::vector<Eigen::Vector3f> anchors_object_mm;
  std::vector<SurfaceSample> surface;
  std::vector<Eigen::Vector3f> edges_mm;
  float lowest_mm = 0;
  float area_mm2 = 0;
};

class Prepared;

/// What is known of the part as a whole.
struct PartFacts {
  std::string part_name;
  ScannerClass scanner = ScannerClass::Lps36;
  double pixel_mm = 1;
  double noise_mm = 0.5;
  double diameter_mm = 0;
  double dz_quantum_mm = 0.1;
  float feature_tolerance_mm = 1;  ///< Height difference below which two pixels count as equal.
  int feature_stride = 1;          ///< Pixels per unit of the feature's offsets.
  double rotation_gap_rad = 0.1;   ///< How far off the nearest view usually is.
  std::uint64_t mesh_hash = 0;
  Mesh mesh;
  Symmetry symmetry;
};

struct TrainedPart : PartFacts {
  std::vector<TrainedView> views;
  std::vector<std::uint32_t> offsets;  ///< kFeatureCount + 1: votes of feature f are [offsets[f], offsets[f + 1]).
  std::vector<Vote> votes;
};

/// A knowledge base is the bytes of its file, mapped or in memory; what is long is used where it lies. (Most features
/// have no vote: the file names the others, and their offsets are laid out at opening.)
struct KnowledgeBase::Impl : PartFacts {
  std::vector<View> views;
  std::vector<std::uint32_t> offsets;  ///< As in TrainedPart.
  std::span<const Vote> votes;         ///< Their rotations are proven by verify() only.
  FileBytes file;
  std::string name;  ///< For messages.
  mutable std::once_flag verify_once;
  mutable Expected<void, KnowledgeBaseError> verdict;
  mutable std::once_flag prepare_once;
  mutable std::shared_ptr<const Prepared> prepared;  ///< See prepared.hpp.
};

/// KnowledgeBase::open() behind the reading: `name` stands in the messages.
Expected<KnowledgeBase, KnowledgeBaseError> open_knowledge_base(FileBytes file, const std::string& name);
/// The bytes of the file, checksums included.
std::vector<std::byte> encoded(const TrainedPart& part);

/// Where the header holds what; knowledge_base_file.cpp tells the rest of the format.
inline constexpr std::size_t kKnowledgeBaseLengthAt = 16, kKnowledgeBaseChecksumAt = 24, kKnowledgeBaseIndexEndAt = 32,
                             kKnowledgeBaseIndexChecksumAt = 40;
/// Makes length and both checksums of a file's bytes right.
void seal_knowledge_base(std::span<std::byte> file);
}  // namespace binpick::vision
