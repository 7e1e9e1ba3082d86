#pragma once

#include "bench/scenes/run.hpp"

namespace binpick::bench {
/// Votes beside the exhaustive search: the first `scenes` of each part, and of the deep supply, by both. Runs what the
/// folder has not yet, with the inner loops that this program runs with (lines bear their name, so that a second run
/// with BINPICK_LOOPS=portable adds its own to the same folder), and prints the table of what the folder holds.
void search(RunOptions options, RunSelection selection, std::size_t scenes);
}  // namespace binpick::bench
