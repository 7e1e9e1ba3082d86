#include "vision/exhaustive.hpp"

#include <algorithm>
#include <cmath>
#include <functional>
#include <span>

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
constexpr double kPassedMax = 36'000, kPassedMin = 100;
constexpr std::size_t kBlockRows = 2048;

bool stronger(const Standing& a, const Standing& b) {
  if (a.evidence != b.evidence) return a.evidence > b.evidence;
  return a.view != b.view ? a.view < b.view : a.anchor < b.anchor;
}
}  // namespace

ExhaustiveSearch::ExhaustiveSearch(const Scene& scene, const KnowledgeBase::Impl& part,
                                   const ExhaustiveOptions& options)
    : scene_{scene},
      part_{part},
      options_{options},
      margin_px_{2 + static_cast<int>(std::ceil(part.diameter_mm / scene.pixel_mm))},
      padded_cols_{scene.cols() + 2 * margin_px_} {
  constexpr float kSeenThrough = -1e9F;  // outside of the supply there is no part
  const auto cols = static_cast<std::size_t>(padded_cols_);
  padded_mm_.assign(cols * static_cast<std::size_t>(scene.rows() + 2 * margin_px_), kSeenThrough);
  for (int r = 0; r < scene.rows(); ++r)
    std::copy_n(scene.z_mm.data() + static_cast<std::ptrdiff_t>(r) * scene.cols(), scene.cols(),
                padded_mm_.data() + static_cast<std::size_t>(r + margin_px_) * cols + margin_px_);
  const Prepared& ready = prepared(part);
  const auto per_mm = static_cast<float>(1 / scene.pixel_mm);
  // Far enough from the margin's end; the part is no wider. Adding keeps the cut towards zero a cut downwards.
  const int most = margin_px_ - 1;
  const auto shift = static_cast<float>(margin_px_) + 0.5F;
  offsets_.resize(ready.coarse_x_mm().size());
  for (std::size_t i = 0; i < offsets_.size(); ++i) {
    const int col = static_cast<int>(ready.coarse_x_mm()[i] * per_mm + shift) - margin_px_;
    const int row = static_cast<int>(ready.coarse_y_mm()[i] * per_mm + shift) - margin_px_;
    offsets_[i] = std::clamp(row, -most, most) * padded_cols_ + std::clamp(col, -most, most);
  }
}

ExhaustiveSearch::Place ExhaustiveSearch::place_of(const Eigen::Vector3f& maximum) const {
  const auto to_px = [&](float mm, double origin) {
    return static_cast<int>(std::lround((static_cast<double>(mm) - origin) / scene_.pixel_mm));
  };
  const int col = to_px(maximum.x(), scene_.origin_mm.x()), row = to_px(maximum.y(), scene_.origin_mm.y());
  if (!scene_.inside(row, col)) return {};
  const std::vector<Prepared::Row>& rows = prepared(part_).rows();
  const auto through = std::partition_point(
      rows.begin(), rows.end(), [&](const auto& r) { return maximum.z() + r.lowest_mm >= options_.z_floor_mm; });
  return {padded_mm_.data() + static_cast<std::size_t>(row + margin_px_) * static_cast<std::size_t>(padded_cols_) +
              static_cast<std::size_t>(col + margin_px_),
          static_cast<std::size_t>(through - rows.begin())};
}

/// The best of each neighbourhood of rotations.
void ExhaustiveSearch::thin_out(std::vector<Standing>& found, std::size_t most) const {
  std::sort(found.begin(), found.end(), stronger);
  const auto same = static_cast<float>(std::cos(0.5 * options_.apart_rad));
  std::vector<Standing> kept;
  for (const Standing& s : found) {
    if (kept.size() >= most) break;
    const Eigen::Quaternionf& q = part_.views[s.view].R_supply_object;
    const bool near = std::any_of(kept.begin(), kept.end(), [&](const Standing& other) {
      return std::abs(part_.views[other.view].R_supply_object.dot(q)) > same;
    });
    if (!near) kept.push_back(s);
  }
  found = std::move(kept);
}

/// Of the rows that passed the first samples, as kernels::ranked, what more of them leave.
std::vector<Standing> ExhaustiveSearch::standing_at(const Eigen::Vector3f& maximum, std::uint32_t index,
                                                    const std::vector<std::uint32_t>& passed, std::size_t most) const {
  const Prepared& ready = prepared(part_);
  const std::vector<Prepared::Row>& rows = ready.rows();
  const kernels::Picture picture = picture_of(scene_, false);
  std::vector<Standing> found;
  for (const std::uint32_t rank : passed) {
    const std::uint32_t i = kernels::view_of(rank);
    if (rows[i].anchor > 0 && !options_.all_anchors) continue;
    const std::span<const float> points = ready.surface(rows[i].view);
    const std::size_t n = std::min(kMoreSamples, points.size() / 3);
    kernels::SparseSum sum;
    kernels::table().sparse(picture, motion_of(Eigen::Matrix3f::Identity(), maximum - rows[i].from_first),
                            points.data(), n, options_.tolerance_mm, sum);
    if (sum.evidence > 0) found.push_back({index, rows[i].view, rows[i].anchor, sum.evidence});
  }
  const std::size_t looked_at = std::min(found.size(), 3 * most);
  std::nth_element(found.begin(), found.begin() + static_cast<std::ptrdiff_t>(looked_at), found.end(), stronger);
  found.resize(looked_at);
  for (Standing& s : found) {
    const View& view = part_.views[s.view];
    const Eigen::Vector3f first =
        maximum - view.R_supply_object * (view.anchors_object_mm[s.anchor] - view.anchors_object_mm.front());
    s.evidence = sparse_evidence(scene_, part_, s.view, first, options_.tolerance_mm);
  }
  std::erase_if(found, [](const Standing& s) { return s.evidence <= 0; });
  thin_out(found, most);
  return found;
}

std::vector<Standing> ExhaustiveSearch::at(const std::vector<Eigen::Vector3f>& maxima, const Deadline& deadline,
                                           std::size_t& tested) const {
  if (maxima.empty() || part_.views.empty()) return {};
  const Prepared& ready = prepared(part_);
  const double share_of_one = std::max(kPassedMin, kPassedMax / static_cast<double>(maxima.size()));
  const auto budget = static_cast<std::size_t>(options_.effort * share_of_one);
  const auto most = std::clamp(static_cast<std::size_t>(options_.in_all / static_cast<double>(maxima.size())),
                               options_.per_maximum_min, options_.per_maximum_max);
  std::vector<Place> places;
  for (const Eigen::Vector3f& m : maxima) places.push_back(place_of(m));
  // A block of rows stays in the cache while all maxima are tried.
  const std::size_t blocks = (ready.rows().size() + kBlockRows - 1) / kBlockRows;
  std::vector<std::vector<std::uint32_t>> passed(blocks * maxima.size());
  share(options_.threads, blocks, deadline, [&](std::size_t b, int) {
    std::vector<std::uint32_t> here(kBlockRows);
    for (std::size_t m = 0; m < maxima.size(); ++m) {
      const std::size_t first = b * kBlockRows, last = std::min(first + kBlockRows, places[m].rows);
      if (first >= last) continue;
      const std::size_t n =
          kernels::table().coarse(places[m].at, offsets_.data(), ready.coarse_rise_mm().data(), first, last,
                                  maxima[m].z(), options_.tolerance_mm, kExplainedMin, kContradictedMax, here.data());
      passed[m * blocks + b].assign(here.begin(), here.begin() + static_cast<std::ptrdiff_t>(n));
    }
  });
  std::vector<std::vector<Standing>> all(maxima.size());
  std::vector<std::size_t> counts(maxima.size(), 0);
  share(options_.threads, maxima.size(), deadline, [&](std::size_t m, int) {
    std::vector<std::uint32_t> best;
    for (std::size_t b = 0; b < blocks; ++b)
      best.insert(best.end(), passed[m * blocks + b].begin(), passed[m * blocks + b].end());
    if (best.size() > budget) {
      std::nth_element(best.begin(), best.begin() + static_cast<std::ptrdiff_t>(budget), best.end(), std::greater<>{});
      best.resize(budget);
    }
    counts[m] = best.size();
    all[m] = standing_at(maxima[m], static_cast<std::uint32_t>(m), best, most);
  });
  std::vector<Standing> found;
  for (std::size_t m = 0; m < maxima.size(); ++m) {
    found.insert(found.end(), all[m].begin(), all[m].end());
    tested += counts[m];
  }
  return found;
}
}  // namespace binpick::vision
