#pragma once

#include <string>

namespace binpick::daemon {
/// docs/cell-sequence.md: the cycle's and the sweep's tables with their diagrams, from the tables that the program runs
/// on.
std::string sequence_markdown();
}  // namespace binpick::daemon
