#include "vision/voting.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "vision/feature.hpp"
#include "vision/scene.hpp"

namespace binpick::vision {
namespace {
constexpr std::int32_t kNobody = -1;
/// Votes are added in steps of 1/16.
constexpr unsigned kWeightShift = 4;

/// Which maximum a vote that points at a pixel means: the nearest within reach.
Grid<std::int32_t> territories(const DepthImage& image, const std::vector<Eigen::Vector3f>& maxima, double reach_mm) {
  Grid<std::int32_t> owner = Grid<std::int32_t>::Constant(image.z_mm.rows(), image.z_mm.cols(), kNobody);
  Grid<float> distance = Grid<float>::Constant(image.z_mm.rows(), image.z_mm.cols(), std::numeric_limits<float>::max());
  const auto rows = static_cast<int>(owner.rows()), cols = static_cast<int>(owner.cols());
  const int reach = std::max(1, static_cast<int>(std::lround(reach_mm / image.pixel_mm)));
  for (std::size_t m = 0; m < maxima.size(); ++m) {
    const auto col = static_cast<int>(std::lround((maxima[m].x() - image.origin_mm.x()) / image.pixel_mm));
    const auto row = static_cast<int>(std::lround((maxima[m].y() - image.origin_mm.y()) / image.pixel_mm));
    for (int r = std::max(0, row - reach); r <= std::min(rows - 1, row + reach); ++r)
      for (int c = std::max(0, col - reach); c <= std::min(cols - 1, col + reach); ++c) {
        const float d = std::hypot(static_cast<float>(r - row), static_cast<float>(c - col));
        if (d > static_cast<float>(reach) + 0.5F || d >= distance(r, c)) continue;
        distance(r, c) = d;
        owner(r, c) = static_cast<std::int32_t>(m);
      }
  }
  return owner;
}
}  // namespace

std::vector<Ballot> vote(const DepthImage& image, const KnowledgeBase::Impl& part,
                         const std::vector<Eigen::Vector3f>& maxima, const VoteOptions& options,
                         const Deadline& deadline) {
  const std::size_t views = part.views.size();
  if (maxima.empty() || views == 0 || part.offsets.size() != kFeatureCount + 1) return {};
  const Grid<std::int32_t> owner = territories(image, maxima, options.reach_mm);
  const std::vector<std::uint32_t> features = features_of(image, {part.feature_tolerance_mm, part.feature_stride});
  const auto rows = static_cast<int>(image.z_mm.rows()), cols = static_cast<int>(image.z_mm.cols());
  const auto quantum = static_cast<float>(part.dz_quantum_mm), height = static_cast<float>(options.height_mm);

  // One table of (maximum, view) per thread, added up afterwards: sums of integers do not depend on the order.
  const auto threads = static_cast<std::size_t>(std::clamp(options.threads, 1, 8));
  std::vector<std::vector<std::uint16_t>> tables(threads);
  share(static_cast<int>(threads), static_cast<std::size_t>(rows), deadline, [&](std::size_t line, int thread) {
    std::vector<std::uint16_t>& table = tables[static_cast<std::size_t>(thread)];
    if (table.empty()) table.resize(maxima.size() * views);
    const auto row = static_cast<int>(line);
    for (int col = 0; col < cols; ++col) {
      const std::uint32_t feature = features[line * static_cast<std::size_t>(cols) + static_cast<std::size_t>(col)];
      if (feature >= kFeatureCount) continue;
      const float z = image.z_mm(row, col);
      for (std::uint32_t k = part.offsets[feature]; k < part.offsets[feature + 1]; ++k) {
        const Vote& v = part.votes[k];
        const int r = row + v.dy, c = col + v.dx;
        if (r < 0 || c < 0 || r >= rows || c >= cols) continue;
        const std::int32_t m = owner(r, c);
        if (m == kNobody) continue;
        const auto maximum = static_cast<std::size_t>(m);
        if (std::abs(z + quantum * static_cast<float>(v.dz) - maxima[maximum].z()) > height) continue;
        std::uint16_t& cell = table[maximum * views + v.rotation];
        cell = static_cast<std::uint16_t>(
            std::min<unsigned>(cell + (v.weight >> kWeightShift), std::numeric_limits<std::uint16_t>::max()));
      }
    }
  });

  // A view with many votes gets many by chance too.
  std::vector<float> expected(views, 0);
  for (const Vote& v : part.votes) expected[v.rotation] += static_cast<float>(v.weight);
  const float mean = 256 * static_cast<float>(part.votes.size()) / static_cast<float>(views) + 1;
  for (float& e : expected) e = 1 / std::sqrt(std::max(e, 0.1F * mean));

  const std::size_t each = std::max<std::size_t>(1, options.ballots_max / maxima.size());
  std::vector<std::vector<Ballot>> chosen(maxima.size());
  share(options.threads, maxima.size(), deadline, [&](std::size_t m, int) {
    std::vector<Ballot> ballots;
    ballots.reserve(views);
    for (std::size_t v = 0; v < views; ++v) {
      if (maxima[m].z() + part.views[v].lowest_mm < options.z_floor_mm) continue;
      unsigned sum = 0;
      for (const auto& table : tables)
        if (!table.empty()) sum += table[m * views + v];
      if (sum > 0)
        ballots.push_back(
            {static_cast<std::uint32_t>(m), static_cast<std::uint16_t>(v), static_cast<float>(sum) * expected[v]});
    }
    const std::size_t keep = std::min(each, ballots.size());
    std::partial_sort(
        ballots.begin(), ballots.begin() + static_cast<std::ptrdiff_t>(keep), ballots.end(),
        [](const Ballot& a, const Ballot& b) { return a.votes != b.votes ? a.votes > b.votes : a.view < b.view; });
    ballots.resize(keep);
    chosen[m] = std::move(ballots);
  });
  std::vector<Ballot> all;
  for (const auto& ballots : chosen) all.insert(all.end(), ballots.begin(), ballots.end());
  return all;
}
}  // namespace binpick::vision
