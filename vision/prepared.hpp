#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "vision/knowledge_base_impl.hpp"
#include "vision/rasteriser.hpp"

/// What detection makes of a knowledge base once, at its first use: the same for every scene.
namespace binpick::vision {
class Prepared {
 public:
  static constexpr std::size_t kCoarseSamples = 16;

  explicit Prepared(const KnowledgeBase::Impl& part);

  /// One anchor of one view, with the first samples of the view from there.
  struct Row {
    std::uint16_t view, anchor;
    float lowest_mm;             ///< Lowest point of the part from the anchor (negative).
    Eigen::Vector3f from_first;  ///< The anchor from the view's first one, supply axes.
  };
  const std::vector<Row>& rows() const { return rows_; }  ///< Those that reach least far down first.
  /// Of row i: kCoarseSamples values from [i * kCoarseSamples].
  std::span<const float> coarse_x_mm() const { return coarse_x_mm_; }
  std::span<const float> coarse_y_mm() const { return coarse_y_mm_; }
  std::span<const float> coarse_rise_mm() const { return coarse_rise_mm_; }

  /// A view's surface samples, and its edges, from its first anchor, as the inner loops want them (kernels.hpp): x, y,
  /// z by eights. What would not fill up eight is left out, or, with less than eight, filled up with the first ones
  /// again.
  std::span<const float> surface(std::size_t view) const { return part_of(surface_, surface_at_, view); }
  std::span<const float> edges(std::size_t view) const { return part_of(edges_, edges_at_, view); }

  const Rasteriser& rasteriser() const { return rasteriser_; }

 private:
  static std::span<const float> part_of(const std::vector<float>& all, const std::vector<std::size_t>& at,
                                        std::size_t view) {
    return {all.data() + at[view], at[view + 1] - at[view]};
  }

  Rasteriser rasteriser_;
  std::vector<Row> rows_;
  std::vector<float> coarse_x_mm_, coarse_y_mm_, coarse_rise_mm_;
  std::vector<float> surface_, edges_;
  std::vector<std::size_t> surface_at_, edges_at_;
};

/// Of this knowledge base; made by whoever asks first.
const Prepared& prepared(const KnowledgeBase::Impl& part);
}  // namespace binpick::vision
