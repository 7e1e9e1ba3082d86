#pragma once

#include <cstddef>
#include <string>

#include "bench/scenes/run.hpp"

namespace binpick::bench {
/// Settles what a split's runs, its alarms included, will ask for, and keeps it in the folder `piles`: hours that then
/// are not spent beside a measurement. The first `alarm_count` alarms of each kind and class.
void settle(const std::string& piles, const RunSelection& selection, std::size_t alarm_count);
}  // namespace binpick::bench
