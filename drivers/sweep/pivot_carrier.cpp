#include "drivers/sweep/pivot_carrier.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>

#include "base/overloaded.hpp"

namespace binpick::drivers::sweep {
namespace {
/// The scanner's spin-up may take seconds after a change of frequency; the pivot's drive to the start as well.
constexpr Duration kPrepareMax = std::chrono::seconds(12);
/// Allowed on top of the time that the plan itself takes.
constexpr Duration kSlack = std::chrono::seconds(2);
}  // namespace

std::optional<CarrierNews> PivotCarrier::on(const pivot::Event& event) {
  using Kind = CarrierNews::Kind;
  using News = std::optional<CarrierNews>;
  return std::visit(Overloaded{
                        [](const pivot::Ready&) -> News { return std::nullopt; },
                        [this](const pivot::Sample& sample) -> News {
                          track_.add(sample.at - latency_, sample.angle);
                          return CarrierNews{Kind::Moved, {}};
                        },
                        [](const pivot::MoveDone&) -> News {
                          return CarrierNews{Kind::Arrived, {}};
                        },
                        [this](const pivot::Failed& failed) -> News {
                          track_.clear();
                          return CarrierNews{Kind::Failed, failed.text};
                        },
                    },
                    event);
}

std::optional<std::string> PivotCarrier::plan(const Motion& motion) {
  sweep_ = std::get<PivotSweep>(motion);
  if (const auto newest = track_.newest()) {
    // The way back is as good as the way there: start where the pivot is.
    const Angle here = *track_.at(*newest);
    if (std::abs((here - sweep_.end).in_rad()) < std::abs((here - sweep_.start).in_rad()))
      std::swap(sweep_.start, sweep_.end);
  }
  return beyond_limits();
}

/// A sweep that the module would cut short measures less than the supply, and nobody would know.
std::optional<std::string> PivotCarrier::beyond_limits() const {
  const auto module = pivot_.module();
  if (!module) return std::nullopt;
  const auto [low, high] = std::minmax({sweep_.start.in_deg(), sweep_.end.in_deg()});
  if (low >= module->position_min.in_deg() && high <= module->position_max.in_deg()) return std::nullopt;
  std::array<char, 200> text{};
  std::snprintf(text.data(), text.size(),
                "the sweep from %.1f to %.1f deg leaves the pivot module's limits of %.1f to %.1f deg; correct "
                "sweep_start_deg and sweep_end_deg, or the module's limits",
                low, high, module->position_min.in_deg(), module->position_max.in_deg());
  return text.data();
}

void PivotCarrier::go_to_start(TimePoint now) { pivot_.move_to(sweep_.start, sweep_.positioning_speed_rad_s, now); }
void PivotCarrier::go_to_end(TimePoint now) { pivot_.move_to(sweep_.end, sweep_.speed_rad_s, now); }

Duration PivotCarrier::prepare_max() const { return kPrepareMax; }

Duration PivotCarrier::path_max() const {
  const double seconds = std::abs((sweep_.end - sweep_.start).in_rad()) / sweep_.speed_rad_s;
  return from_s(1.5 * seconds) + kSlack;
}

std::optional<CarrierPose> PivotCarrier::at(TimePoint at) const {
  if (const auto angle = track_.at(at)) return *angle;
  return std::nullopt;
}
}  // namespace binpick::drivers::sweep
