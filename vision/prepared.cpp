#include "vision/prepared.hpp"

#include <algorithm>

#include "vision/kernels.hpp"

namespace binpick::vision {
namespace {
/// Appends the points by eights.
template <class Points, class PointOf>
void pack(const Points& points, const PointOf& point_of, std::vector<float>& out) {
  if (points.empty()) return;
  const std::size_t groups = std::max<std::size_t>(1, points.size() / kernels::kLanes);
  for (std::size_t g = 0; g < groups; ++g)
    for (Eigen::Index axis = 0; axis < 3; ++axis)
      for (std::size_t k = 0; k < kernels::kLanes; ++k)
        out.push_back(point_of(points[(g * kernels::kLanes + k) % points.size()])[axis]);
}
}  // namespace

Prepared::Prepared(const KnowledgeBase::Impl& part) : rasteriser_{part.mesh} {
  surface_at_.push_back(0);
  edges_at_.push_back(0);
  for (std::size_t v = 0; v < part.views.size(); ++v) {
    const View& view = part.views[v];
    pack(
        view.surface, [](const SurfaceSample& s) -> const Eigen::Vector3f& { return s.p_mm; }, surface_);
    pack(
        view.edges_mm, [](const Eigen::Vector3f& p) -> const Eigen::Vector3f& { return p; }, edges_);
    surface_at_.push_back(surface_.size());
    edges_at_.push_back(edges_.size());
    if (view.surface.empty()) continue;
    for (std::size_t a = 0; a < view.anchors_object_mm.size(); ++a) {
      const Eigen::Vector3f from_first =
          view.R_supply_object * (view.anchors_object_mm[a] - view.anchors_object_mm.front());
      rows_.push_back(
          {static_cast<std::uint16_t>(v), static_cast<std::uint16_t>(a), view.lowest_mm - from_first.z(), from_first});
    }
  }
  std::stable_sort(rows_.begin(), rows_.end(), [](const Row& a, const Row& b) { return a.lowest_mm > b.lowest_mm; });
  for (const Row& row : rows_) {
    const auto& surface = part.views[row.view].surface;
    for (std::size_t k = 0; k < kCoarseSamples; ++k) {
      const Eigen::Vector3f p = surface[k % surface.size()].p_mm - row.from_first;
      coarse_x_mm_.push_back(p.x());
      coarse_y_mm_.push_back(p.y());
      coarse_rise_mm_.push_back(p.z());
    }
  }
}

const Prepared& prepared(const KnowledgeBase::Impl& part) {
  std::call_once(part.prepare_once, [&] { part.prepared = std::make_shared<const Prepared>(part); });
  return *part.prepared;
}
}  // namespace binpick::vision
