#include "bench/production/displacement.hpp"

#include <array>
#include <cmath>
#include <cstdio>
#include <random>

namespace binpick::bench {
namespace {
constexpr double kTurn_deg_per_mm = 10.0 / 80.0;
}

Displacement displacement_of(std::uint64_t bin, std::uint64_t seed, double up_to_mm) {
  std::mt19937_64 random{seed * 1'000'003 + bin * 7919};
  const auto to_either_side = [&](double most) {
    return most * (2 * static_cast<double>(random() >> 11U) * 0x1p-53 - 1);
  };
  Displacement by;
  by.x_mm = to_either_side(up_to_mm);
  by.y_mm = to_either_side(up_to_mm);
  by.turn_deg = to_either_side(kTurn_deg_per_mm * up_to_mm);
  return by;
}

double LocatedComparison::by_chance() const {
  const auto variance = [](const ProductionFigures& f) {
    const double right = f.share(f.taken);
    return f.picks > 0 ? right * (100 - right) / f.picks : 0;
  };
  return std::sqrt(variance(displaced) + variance(centred));
}

std::string to_table(const LocatedComparison& c) {
  std::array<char, 400> text{};
  std::snprintf(text.data(), text.size(),
                "| | poses sent | right picks %% | wrong poses sent %% | left over %% |\n|---|---|---|---|---|\n"
                "| displaced | %d | %.2f | %.2f | %.2f |\n| in its place | %d | %.2f | %.2f | %.2f |\n\n"
                "Right picks: %+.2f points (must: not below -1; by chance +-%.2f): %s\n",
                c.displaced.picks, c.displaced.share(c.displaced.taken), c.displaced.share(c.displaced.wrong),
                c.displaced.left_percent(), c.centred.picks, c.centred.share(c.centred.taken),
                c.centred.share(c.centred.wrong), c.centred.left_percent(), c.points(), c.by_chance(),
                c.meets_must() ? "must reached" : "MISSED");
  return text.data();
}
}  // namespace binpick::bench
