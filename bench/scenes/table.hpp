#pragma once

#include <string>

namespace binpick::bench {
/// Prints what a run's scenes say: the table, stage recall, times, reliability; of the split that it holds.
void print_table(const std::string& folder);
}  // namespace binpick::bench
