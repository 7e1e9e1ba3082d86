#pragma once

#include <string>
#include <vector>

#include "bench/production/figures.hpp"

namespace binpick::bench {
/// One PNG: what became of the picks, and the histograms of hypotheses and time to the first valid pose, in the form of
/// the published figure 7, with its numbers marked. Throws std::runtime_error where it cannot be written.
void draw_production(const std::string& path, const std::vector<ProductionFigures>& parts,
                     const ProductionFigures& all);
}  // namespace binpick::bench
