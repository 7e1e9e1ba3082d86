#include "drivers/sweep/angle_track.hpp"

#include <algorithm>

namespace binpick::drivers::sweep {
void AngleTrack::add(TimePoint at, Angle angle) {
  if (!samples_.empty() && at <= samples_.back().at) return;
  samples_.push_back({at, angle});
  if (samples_.size() > kSamplesMax) samples_.pop_front();
}

std::optional<Angle> AngleTrack::at(TimePoint at) const {
  const auto after = std::lower_bound(samples_.begin(), samples_.end(), at,
                                      [](const Sample& sample, TimePoint t) { return sample.at < t; });
  if (after == samples_.end()) return std::nullopt;
  if (after->at == at) return after->angle;
  if (after == samples_.begin()) return std::nullopt;
  const auto before = std::prev(after);
  if (after->at - before->at > gap_max) return std::nullopt;
  const double part = in_s(at - before->at) / in_s(after->at - before->at);
  return before->angle + part * (after->angle - before->angle);
}

std::optional<TimePoint> AngleTrack::newest() const {
  return samples_.empty() ? std::nullopt : std::optional{samples_.back().at};
}

std::optional<TimePoint> AngleTrack::oldest() const {
  return samples_.empty() ? std::nullopt : std::optional{samples_.front().at};
}
}  // namespace binpick::drivers::sweep
