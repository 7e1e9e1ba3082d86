#pragma once

#include "bench/scenes/alarm_scenes.hpp"
#include "bench/scenes/run.hpp"

namespace binpick::bench {
/// Looks for each class's parts where there are none: in the pile of another part of the class, in empty supplies, in
/// piles of foreign bodies; `count` scenes of each kind and class. Runs those that the folder has not yet, and prints
/// what all of the folder say. The selection's split is "tune" or "report", which becomes the lines' "alarms-tune" or
/// "alarms-report": a score that is fitted to the ones can be judged by the others.
void alarms(const RunOptions& options, const RunSelection& selection, std::size_t count);

void print_alarms(const RunFolder& run, const std::string& split);
}  // namespace binpick::bench
