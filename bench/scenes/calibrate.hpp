#pragma once

#include <string>
#include <vector>

namespace binpick::bench {
/// Fits the weights of the score (vision/score.hpp) to what runs found and prints them as vision/score_weights.inc
/// wants them. Right and hidden truths found count as right; what a better pose of the same place overshadows does not
/// count at all.
void calibrate(const std::vector<std::string>& folders);
}  // namespace binpick::bench
