#pragma once

#include <string>
#include <vector>

#include "bench/scenes/figures.hpp"
#include "bench/scenes/lines.hpp"

/// From the scenes of a run to figures that can be set side by side.
namespace binpick::bench {
struct ClassFigures {
  std::string name;
  std::vector<PartFigures> parts;

  Estimate mean(Estimate PartFigures::*of) const;  ///< Over the parts.
  std::vector<double> all(std::vector<double> PartFigures::*of) const;
};

/// Of one detector, class by class; the deep supply stands as a class of its own. Scenes where the part is not (alarms)
/// are left out.
std::vector<ClassFigures> collected(const RunFolder& run, const std::string& detector);

RunFolder of_split(const RunFolder& run, const std::string& split);
/// Only the scenes that each of these detectors saw, and only their lines.
RunFolder seen_by_all(const RunFolder& run, const std::vector<std::string>& detectors);

/// Of the same scenes: their draws are of the same piles.
Estimate difference(const Estimate& a, const Estimate& b);

/// "0.953 [0.941, 0.962]"; without draws the value alone.
std::string with_interval(const Estimate& estimate, const char* format);
}  // namespace binpick::bench
