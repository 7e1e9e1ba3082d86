#pragma once

#include "bench/scenes/run.hpp"

namespace binpick::bench {
/// What each addition to the method brings: the first `scenes` of each part with all of them, then with one after the
/// other taken away. Runs what the folder has not yet, and prints the table of the scenes that all of them saw. The
/// options' own `without` is left out of all, the base too.
void ablation(const RunOptions& options, RunSelection selection, std::size_t scenes);
}  // namespace binpick::bench
