#include "vision/exhaustive.hpp"

#include <algorithm>
#include <cmath>
#include <functional>

#include "vision/kernels.hpp"
#include "vision/prepared.hpp"
#include "vision/verification.hpp"

namespace binpick::vision {
namespace {
/// Tested after the first sixteen, before all of them and the edges.
constexpr std::size_t kMoreSamples = 32;
constexpr int kExplainedMin = 4;
constexpr int kContradictedMax = 8;
/// So many pass the first test in all; shared evenly, lest a wide plateau takes the time of all others.
constexpr double kPassedMax = 60'000, kPassedMin = 300;
constexpr std::size_t kBlockRows = 2048;

/// The picture with a frame as wide as the part, so that no sample needs to be asked whether it is inside.
struct Padded {
  Padded(const Scene& scene, int margin) : margin_px{margin}, cols{scene.cols() + 2 * margin} {
    constexpr float kSeenThrough = -1e9F;  // outside of the supply there is no part
    z_mm.assign(static_cast<std::size_t>(cols) * static_cast<std::size_t>(scene.rows() + 2 * margin), kSeenThrough);
    for (int r = 0; r < scene.rows(); ++r)
      for (int c = 0; c < scene.cols(); ++c) z_mm[at(r, c)] = scene.z_mm(r, c);
  }
  std::size_t at(int row, int col) const {
    return static_cast<std::size_t>(row + margin_px) * static_cast<std::size_t>(cols) +
           static_cast<std::size_t>(col + margin_px);
  }

  int margin_px, cols;
  std::vector<float> z_mm;
};

/// Where the samples of all rows lie in the padded picture, from their anchor.
std::vector<std::int32_t> offsets_in(const Padded& padded, const Prepared& part, double pixel_mm) {
  const auto per_mm = static_cast<float>(1 / pixel_mm);
  // Far enough from the margin's end; the part is no wider. Adding keeps the cut towards zero a cut downwards.
  const int most = padded.margin_px - 1;
  const auto shift = static_cast<float>(padded.margin_px) + 0.5F;
  std::vector<std::int32_t> offsets(part.coarse_x_mm().size());
  for (std::size_t i = 0; i < offsets.size(); ++i) {
    const int col = static_cast<int>(part.coarse_x_mm()[i] * per_mm + shift) - padded.margin_px;
    const int row = static_cast<int>(part.coarse_y_mm()[i] * per_mm + shift) - padded.margin_px;
    offsets[i] = std::clamp(row, -most, most) * padded.cols + std::clamp(col, -most, most);
  }
  return offsets;
}

bool stronger(const Standing& a, const Standing& b) {
  if (a.evidence != b.evidence) return a.evidence > b.evidence;
  return a.view != b.view ? a.view < b.view : a.anchor < b.anchor;
}

/// The best of each neighbourhood of rotations.
void thin_out(const KnowledgeBase::Impl& part, const ExhaustiveOptions& options, std::vector<Standing>& found) {
  std::sort(found.begin(), found.end(), stronger);
  const auto same = static_cast<float>(std::cos(0.5 * options.apart_rad));
  std::vector<Standing> kept;
  for (const Standing& s : found) {
    if (kept.size() >= options.per_maximum) break;
    const Eigen::Quaternionf& q = part.views[s.view].R_supply_object;
    const bool near = std::any_of(kept.begin(), kept.end(), [&](const Standing& other) {
      return std::abs(part.views[other.view].R_supply_object.dot(q)) > same;
    });
    if (!near) kept.push_back(s);
  }
  found = std::move(kept);
}
}  // namespace

std::vector<Standing> search_all(const Scene& scene, const KnowledgeBase::Impl& part,
                                 const std::vector<Eigen::Vector3f>& maxima, const ExhaustiveOptions& options,
                                 const Deadline& deadline, std::size_t& tested) {
  tested = 0;
  if (maxima.empty() || part.views.empty()) return {};
  const Padded padded(scene, 2 + static_cast<int>(std::ceil(part.diameter_mm / scene.pixel_mm)));
  const Prepared& ready = prepared(part);
  const std::vector<Prepared::Row>& rows = ready.rows();
  const std::vector<std::int32_t> offsets = offsets_in(padded, ready, scene.pixel_mm);
  const kernels::Picture picture = picture_of(scene, false);
  const double share_of_one = std::max(kPassedMin, kPassedMax / static_cast<double>(maxima.size()));
  const auto budget = static_cast<std::size_t>(options.effort * share_of_one);
  struct Place {
    const float* at = nullptr;  ///< In the padded picture; nothing: outside.
    std::size_t rows = 0;       ///< Those that do not reach through the floor.
  };
  std::vector<Place> places(maxima.size());
  for (std::size_t m = 0; m < maxima.size(); ++m) {
    const auto to_px = [&](float mm, double origin) {
      return static_cast<int>(std::lround((static_cast<double>(mm) - origin) / scene.pixel_mm));
    };
    const int col = to_px(maxima[m].x(), scene.origin_mm.x()), row = to_px(maxima[m].y(), scene.origin_mm.y());
    if (!scene.inside(row, col)) continue;
    const auto through = std::partition_point(
        rows.begin(), rows.end(), [&](const auto& r) { return maxima[m].z() + r.lowest_mm >= options.z_floor_mm; });
    places[m] = {padded.z_mm.data() + padded.at(row, col), static_cast<std::size_t>(through - rows.begin())};
  }
  // A block of rows stays in the cache while all maxima are tried.
  const std::size_t blocks = (rows.size() + kBlockRows - 1) / kBlockRows;
  std::vector<std::vector<std::uint32_t>> passed(blocks * maxima.size());
  share(options.threads, blocks, deadline, [&](std::size_t b, int) {
    std::vector<std::uint32_t> here(kBlockRows);
    for (std::size_t m = 0; m < maxima.size(); ++m) {
      const std::size_t first = b * kBlockRows, last = std::min(first + kBlockRows, places[m].rows);
      if (first >= last) continue;
      const std::size_t n =
          kernels::table().coarse(places[m].at, offsets.data(), ready.coarse_rise_mm().data(), first, last,
                                  maxima[m].z(), options.tolerance_mm, kExplainedMin, kContradictedMax, here.data());
      passed[m * blocks + b].assign(here.begin(), here.begin() + static_cast<std::ptrdiff_t>(n));
    }
  });
  std::vector<std::vector<Standing>> all(maxima.size());
  std::vector<std::size_t> counts(maxima.size(), 0);
  share(options.threads, maxima.size(), deadline, [&](std::size_t m, int) {
    const Eigen::Vector3f& anchor = maxima[m];
    std::vector<std::uint32_t> best;
    for (std::size_t b = 0; b < blocks; ++b)
      best.insert(best.end(), passed[m * blocks + b].begin(), passed[m * blocks + b].end());
    if (best.size() > budget) {
      std::nth_element(best.begin(), best.begin() + static_cast<std::ptrdiff_t>(budget), best.end(), std::greater<>{});
      best.resize(budget);
    }
    counts[m] = best.size();
    std::vector<Standing>& found = all[m];
    for (const std::uint32_t rank : best) {
      const std::uint32_t i = kernels::view_of(rank);
      if (rows[i].anchor > 0 && !options.all_anchors) continue;
      const std::span<const float> points = ready.surface(rows[i].view);
      const std::size_t n = std::min(kMoreSamples, points.size() / 3);
      kernels::SparseSum sum;
      kernels::table().sparse(picture, motion_of(Eigen::Matrix3f::Identity(), anchor - rows[i].from_first),
                              points.data(), n, options.tolerance_mm, sum);
      if (sum.evidence > 0)
        found.push_back({static_cast<std::uint32_t>(m), rows[i].view, rows[i].anchor, sum.evidence});
    }
    const std::size_t most = std::min(found.size(), 3 * options.per_maximum);
    std::nth_element(found.begin(), found.begin() + static_cast<std::ptrdiff_t>(most), found.end(), stronger);
    found.resize(most);
    for (Standing& s : found) {
      const View& view = part.views[s.view];
      const Eigen::Vector3f first =
          anchor - view.R_supply_object * (view.anchors_object_mm[s.anchor] - view.anchors_object_mm.front());
      s.evidence = sparse_evidence(scene, part, s.view, first, options.tolerance_mm);
    }
    std::erase_if(found, [](const Standing& s) { return s.evidence <= 0; });
    thin_out(part, options, all[m]);
  });
  std::vector<Standing> found;
  for (std::size_t m = 0; m < maxima.size(); ++m) {
    found.insert(found.end(), all[m].begin(), all[m].end());
    tested += counts[m];
  }
  return found;
}
}  // namespace binpick::vision
