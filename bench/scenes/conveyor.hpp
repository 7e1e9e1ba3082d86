#pragma once

#include <cstddef>

#include "bench/scenes/run.hpp"

namespace binpick::bench {
/// Objects that lie by themselves on a belt, in any way in which they rest, before knowledge bases that were trained
/// for `picking = "conveyor"`; how large these are beside those for a bin, and how long it takes to open both. Prints
/// the table.
void conveyor(const RunOptions& options, const RunSelection& selection, std::size_t scenes);
}  // namespace binpick::bench
