#include "vision/votes.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <numeric>

namespace binpick::vision {
namespace {
/// SplitMix64 (Steele, Lea, Flood, 2014): a stream of its own for every view, so that the number of threads changes
/// nothing.
class Random {
 public:
  explicit Random(std::uint64_t seed) : state_{seed} {}
  std::uint64_t next() {
    std::uint64_t z = (state_ += 0x9E3779B97F4A7C15ULL);
    z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9ULL;
    z = (z ^ (z >> 27)) * 0x94D049BB133111EBULL;
    return z ^ (z >> 31);
  }
  double uniform(double low, double high) { return low + (high - low) * static_cast<double>(next() >> 11) * 0x1p-53; }
  /// Sum of four uniforms of 16 bits, unit variance: normal enough up to 3 sd.
  float normal() {
    const std::uint64_t bits = next();
    const auto sum =
        static_cast<float>((bits & 0xFFFF) + ((bits >> 16) & 0xFFFF) + ((bits >> 32) & 0xFFFF) + (bits >> 48));
    return (sum - 131070.0F) * (1.7320508F / 65536.0F);
  }

 private:
  std::uint64_t state_;
};

struct Heights {
  float low, high;
};
Heights heights_of(const DepthImage& image) {
  Heights heights{std::numeric_limits<float>::infinity(), -std::numeric_limits<float>::infinity()};
  for (Eigen::Index i = 0; i < image.z_mm.size(); ++i) {
    const float z = image.z_mm.data()[i];
    if (std::isnan(z)) continue;
    heights.low = std::min(heights.low, z);
    heights.high = std::max(heights.high, z);
  }
  return heights;
}

/// A plane over the image: height at (row, col).
struct Plane {
  float level, per_row, per_col;
  float at(int row, int col) const {
    return level + per_row * static_cast<float>(row) + per_col * static_cast<float>(col);
  }
};

/// One look: the render with a background, something on top perhaps, and noise. `own` marks pixels of the part.
DepthImage disturbed(const DepthImage& render, const LookOptions& options, int look, Random& random,
                     std::vector<char>& own) {
  DepthImage image = render;
  const auto rows = static_cast<int>(image.z_mm.rows()), cols = static_cast<int>(image.z_mm.cols());
  const Heights heights = heights_of(render);
  const float tall = std::max(heights.high - heights.low, static_cast<float>(8 * options.noise_mm));
  // Background: nothing; the floor under the part; clutter somewhere between floor and top.
  const int kind = look % 4;
  Plane ground{heights.low - static_cast<float>(random.uniform(0, 0.3)) * tall, 0, 0};
  if (kind == 2) {
    ground.level = heights.low + static_cast<float>(random.uniform(0, 0.6)) * tall;
    ground.per_row = static_cast<float>(random.uniform(-0.4, 0.4) * image.pixel_mm);
    ground.per_col = static_cast<float>(random.uniform(-0.4, 0.4) * image.pixel_mm);
  }
  // Something higher over a part of it, beyond a line.
  const double turn = random.uniform(0, 6.283185307179586);
  const auto nx = static_cast<float>(std::cos(turn)), ny = static_cast<float>(std::sin(turn));
  const float half = 0.5F * (std::abs(nx) * static_cast<float>(cols) + std::abs(ny) * static_cast<float>(rows));
  const bool covered = look % 2 == 1;
  const float line = covered ? half * static_cast<float>(random.uniform(0.3, 1.0)) : 2 * half;
  const float cover = heights.high + static_cast<float>(random.uniform(0.05, 0.4)) * tall;
  own.assign(static_cast<std::size_t>(image.z_mm.size()), 0);
  for (int row = 0; row < rows; ++row)
    for (int col = 0; col < cols; ++col) {
      float& z = image.z_mm(row, col);
      const float along = nx * (static_cast<float>(col) - 0.5F * static_cast<float>(cols)) +
                          ny * (static_cast<float>(row) - 0.5F * static_cast<float>(rows));
      const auto index = static_cast<std::size_t>(row) * static_cast<std::size_t>(cols) + static_cast<std::size_t>(col);
      if (along > line)
        z = cover;
      else if (!std::isnan(z))
        own[index] = 1;
      else if (kind != 0)
        z = ground.at(row, col);
      z += static_cast<float>(options.noise_mm) * random.normal();
    }
  return image;
}

struct Sighting {
  std::uint32_t feature;
  std::int16_t dx, dy, dz;
  std::uint8_t look;
};

/// Votes of one feature within a pixel of each other are the same one.
void merge(std::vector<Sighting>& sightings, const LookOptions& options, std::vector<RawVote>& votes) {
  std::ranges::sort(sightings, [](const Sighting& a, const Sighting& b) {
    return std::tie(a.feature, a.dy, a.dx, a.look, a.dz) < std::tie(b.feature, b.dy, b.dx, b.look, b.dz);
  });
  for (std::size_t begin = 0; begin < sightings.size();) {
    std::size_t end = begin;
    while (end < sightings.size() && sightings[end].feature == sightings[begin].feature) ++end;
    for (std::size_t i = begin; i < end; ++i) {
      if (sightings[i].look == 0xFF) continue;
      unsigned looks = 0;
      int n = 0, sx = 0, sy = 0, sz = 0;
      const Sighting seed = sightings[i];
      for (std::size_t k = i; k < end && sightings[k].dy - seed.dy <= 1; ++k) {
        if (sightings[k].look == 0xFF || std::abs(sightings[k].dx - seed.dx) > 1) continue;
        looks |= 1U << sightings[k].look;
        sx += sightings[k].dx;
        sy += sightings[k].dy;
        sz += sightings[k].dz;
        ++n;
        sightings[k].look = 0xFF;
      }
      const int seen = std::popcount(looks);
      if (seen < options.looks_min) continue;
      RawVote raw;
      raw.feature = seed.feature;
      const auto mean = [&](int sum) { return static_cast<int>(std::lround(static_cast<double>(sum) / n)); };
      raw.vote.dx = static_cast<std::int8_t>(mean(sx));
      raw.vote.dy = static_cast<std::int8_t>(mean(sy));
      raw.vote.dz = static_cast<std::int16_t>(mean(sz));
      raw.vote.weight = static_cast<std::uint16_t>(256 * seen / options.looks);
      votes.push_back(raw);
    }
    begin = end;
  }
}
}  // namespace

std::vector<RawVote> look_at(const std::vector<DepthImage>& renders, const TrainedView& view,
                             const LookOptions& options) {
  std::vector<RawVote> votes;
  if (renders.empty() || view.anchors_object_mm.empty()) return votes;
  const Eigen::Vector3f anchor = view.R_supply_object * view.anchors_object_mm.front();
  Random random(options.seed);
  std::vector<Sighting> sightings;
  std::vector<char> own;
  for (int look = 0; look < options.looks; ++look) {
    const DepthImage& render = renders[static_cast<std::size_t>(look) % renders.size()];
    const auto jump = smoothing_jump_mm(options.noise_mm, render.pixel_mm);
    const DepthImage seen = smoothed(disturbed(render, options, look, random, own), jump);
    const auto features = features_of(seen, options.rule);
    const auto covered = static_cast<double>(std::ranges::count(own, 1));
    const double share = std::min(1.0, options.pixels_max / std::max(1.0, covered));
    const double col_anchor = (double{anchor.x()} - render.origin_mm.x()) / render.pixel_mm;
    const double row_anchor = (double{anchor.y()} - render.origin_mm.y()) / render.pixel_mm;
    const auto cols = static_cast<int>(seen.z_mm.cols());
    for (std::size_t i = 0; i < features.size(); ++i) {
      if (!own[i] || features[i] == kNoFeature || features[i] == kPlaneFeature) continue;
      const int row = static_cast<int>(i) / cols, col = static_cast<int>(i) % cols;
      const auto dx = std::lround(col_anchor - col), dy = std::lround(row_anchor - row);
      if (std::max(std::abs(dx), std::abs(dy)) > 127) continue;
      // The same places in every look: which of them stay is drawn by place, in blocks that hide the grid's shift.
      if (share < 1) {
        const std::uint64_t place = static_cast<std::uint64_t>((dx + 128) / 2 * 256 + (dy + 128) / 2);
        if (Random(options.seed ^ (place * 0xD1342543DE82EF95ULL)).uniform(0, 1) > share) continue;
      }
      const double dz = (double{anchor.z()} - double{seen.z_mm.data()[i]}) / options.dz_quantum_mm;
      if (std::abs(dz) > 32000) continue;
      sightings.push_back({features[i], static_cast<std::int16_t>(dx), static_cast<std::int16_t>(dy),
                           static_cast<std::int16_t>(std::lround(dz)), static_cast<std::uint8_t>(look)});
    }
  }
  merge(sightings, options, votes);
  return votes;
}

VoteTable build_votes(const std::vector<std::vector<RawVote>>& of_view, std::uint32_t per_feature_max,
                      std::size_t per_view_max) {
  // Pixels of a full supply, and what one detection may spend on their votes.
  constexpr double kScenePixels = 30'000, kSceneVotesMax = 12e6;
  std::vector<std::uint32_t> length(kFeatureCount, 0);
  double total = 0;
  for (const auto& votes : of_view)
    for (const RawVote& raw : votes) ++length[raw.feature], ++total;
  if (per_feature_max == 0) {
    // A feature is met about as often as it was seen in training, and each time all its votes are paid.
    std::vector<std::uint32_t> sorted;
    std::ranges::copy_if(length, std::back_inserter(sorted), [](std::uint32_t n) { return n > 0; });
    std::ranges::sort(sorted);
    double cost = 0;
    for (const std::uint32_t n : sorted) {
      cost += kScenePixels * n / total * n;
      if (cost > kSceneVotesMax && per_feature_max > 0) break;
      per_feature_max = n;
    }
  }

  std::vector<std::vector<RawVote>> kept(of_view.size());
  std::vector<std::uint32_t> count(kFeatureCount, 0);
  for (std::size_t view = 0; view < of_view.size(); ++view) {
    auto& votes = kept[view];
    for (RawVote raw : of_view[view]) {
      if (length[raw.feature] > per_feature_max) continue;
      // Inverse frequency: bits that the feature tells of the view, 10 bits being one vote.
      const double bits = std::log2(static_cast<double>(of_view.size()) * 8 / length[raw.feature] + 1);
      raw.vote.weight = static_cast<std::uint16_t>(std::clamp(raw.vote.weight * bits / 10, 1.0, 65535.0));
      raw.vote.rotation = static_cast<std::uint16_t>(view);
      votes.push_back(raw);
    }
    if (votes.size() > per_view_max) {
      std::ranges::stable_sort(votes, [](const RawVote& a, const RawVote& b) { return a.vote.weight > b.vote.weight; });
      votes.resize(per_view_max);
    }
    for (const RawVote& raw : votes) ++count[raw.feature];
  }
  VoteTable table;
  table.offsets.assign(kFeatureCount + 1, 0);
  for (std::size_t f = 0; f < kFeatureCount; ++f) table.offsets[f + 1] = table.offsets[f] + count[f];
  table.votes.resize(table.offsets.back());
  std::vector<std::uint32_t> next(table.offsets.begin(), table.offsets.end() - 1);
  for (const auto& votes : kept)
    for (const RawVote& raw : votes) table.votes[next[raw.feature]++] = raw.vote;
  return table;
}
}  // namespace binpick::vision
