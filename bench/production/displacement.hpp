#pragma once

#include <cstdint>
#include <string>

#include "bench/production/figures.hpp"

namespace binpick::bench {
/// How far from where the cell file says the forklift has put a bin.
struct Displacement {
  double x_mm = 0, y_mm = 0, turn_deg = 0;
};

/// Up to so much along x and y, evenly; turned by up to 10 degrees where that is 80 mm. The same for bin and seed.
Displacement displacement_of(std::uint64_t bin, std::uint64_t seed, double up_to_mm);

/// Right picks of bins that stand off and of the same bins in their places.
struct LocatedComparison {
  ProductionFigures displaced, centred;
  double points() const { return displaced.share(displaced.taken) - centred.share(centred.taken); }
  /// Standard deviation that such a difference has by chance.
  double by_chance() const;
  bool meets_must() const { return points() >= -1; }
};
/// Markdown.
std::string to_table(const LocatedComparison& comparison);
}  // namespace binpick::bench
