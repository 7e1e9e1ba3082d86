#pragma once

#include <cstddef>

#include "bench/scenes/run.hpp"
#include "vision/reach.hpp"

namespace binpick::bench {
/// The choice of grasps on piles, judged on exact geometry: what the offered grasps hit, which objects could have been
/// taken and were not offered, and how long the choice takes. Prints a row for each of the example parts.
void grasps(const RunOptions& options, const RunSelection& selection, std::size_t scenes,
            const vision::ReachLimits& limits);
}  // namespace binpick::bench
