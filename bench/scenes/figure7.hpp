#pragma once

#include <string>

#include "bench/scenes/run.hpp"

namespace binpick::bench {
/// The published figure 7 again: hypotheses tested before, and time to, the first valid pose, in scenes of contact
/// bridges. Runs those of the "figure7" split that the folder has not yet, prints the shares beside the published ones,
/// draws both histograms into the folder.
void figure7(const RunOptions& options, std::size_t count, std::size_t shard, std::size_t shards);
}  // namespace binpick::bench
