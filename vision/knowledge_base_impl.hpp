#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <string>
#include <vector>

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

/// One rotation of the part as seen from above.
struct View {
  Eigen::Quaternionf R_supply_object;
  /// Anchors (mean of the plateau close around the highest point; further separate maxima), best first, object frame.
  std::vector<Eigen::Vector3f> anchors_object_mm;
  std::vector<SurfaceSample> surface;  ///< Scattered evenly over the visible surface.
  std::vector<Eigen::Vector3f>
      edges_mm;         ///< On the silhouette and inner depth jumps (upper side), relative to the first anchor.
  float lowest_mm = 0;  ///< Lowest point of the part, relative to the first anchor (negative).
  float area_mm2 = 0;   ///< Of the silhouette.
};

struct KnowledgeBase::Impl {
  std::string part_name;
  ScannerClass scanner = ScannerClass::Lps36;
  double pixel_mm = 1;
  double noise_mm = 0.5;
  double diameter_mm = 0;
  double dz_quantum_mm = 0.1;
  float feature_tolerance_mm = 1;  ///< Height difference below which two pixels count as equal.
  int feature_stride = 1;          ///< Pixels per unit of the feature's offsets.
  std::uint64_t mesh_hash = 0;
  Mesh mesh;
  Symmetry symmetry;
  std::vector<View> views;
  std::vector<std::uint32_t> offsets;  ///< kFeatureCount + 1: votes of feature f are [offsets[f], offsets[f + 1]).
  std::vector<Vote> votes;
};

/// Length of the file that save() writes.
std::size_t knowledge_base_bytes(const KnowledgeBase::Impl& part);
/// Of a whole file, its own eight bytes left out: any single flipped byte changes it.
std::uint64_t knowledge_base_checksum(std::span<const std::byte> file);
inline constexpr std::size_t kKnowledgeBaseLengthAt = 16, kKnowledgeBaseChecksumAt = 24;
}  // namespace binpick::vision
