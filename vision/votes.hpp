#pragma once

#include <cstdint>
#include <vector>

#include "vision/feature.hpp"
#include "vision/knowledge_base_impl.hpp"

namespace binpick::vision {
/// A vote before the table is built: of one view, with the feature it belongs to.
struct RawVote {
  std::uint32_t feature = 0;
  Vote vote;  ///< weight: the share of the view's looks in which it was seen, 256 = all.
};

/// What a view is looked at with.
struct LookOptions {
  FeatureRule rule;
  double noise_mm = 0.5;
  double dz_quantum_mm = 0.1;
  int looks = 4;           ///< Noisy images of one view.
  int looks_min = 2;       ///< A vote seen in fewer of them is chance.
  int pixels_max = 700;    ///< Of one look; a larger view gives an even share of its pixels.
  std::uint64_t seed = 1;  ///< Of this view.
};

/// Votes of one view for its first anchor. Each look adds noise, a random background (nothing, a floor, clutter beside
/// the part) and now and then something that lies on it; only features that stay under these are kept.
/// `renders` are noise-free pictures of the same rotation, their origins at the object's; looks take them in turn.
std::vector<RawVote> look_at(const std::vector<DepthImage>& renders, const TrainedView& view,
                             const LookOptions& options);

struct VoteTable {
  std::vector<std::uint32_t> offsets;
  std::vector<Vote> votes;
};
/// Sorts the votes of all views by feature. A feature of more than `per_feature_max` votes is dropped: what is seen in
/// every view tells nothing. 0: the largest cap with which a scene costs no more than a few million votes.
/// A vote's weight grows with its feature's rarity; of each view the `per_view_max` heaviest stay.
VoteTable build_votes(const std::vector<std::vector<RawVote>>& of_view, std::uint32_t per_feature_max,
                      std::size_t per_view_max);
}  // namespace binpick::vision
