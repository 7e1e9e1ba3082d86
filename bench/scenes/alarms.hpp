#pragma once

#include <string>
#include <vector>

#include "bench/scenes/run.hpp"

namespace binpick::bench {
/// Looks for each class's parts where there are none: in the pile of another part of the class, in empty supplies, in
/// piles of foreign bodies. `count` scenes of each kind and class, parts in turn. Prints how many detections had a
/// score above one half.
void print_false_alarms(const RunOptions& options, const std::vector<std::string>& classes, std::size_t count);
}  // namespace binpick::bench
