#pragma once

#include <algorithm>
#include <deque>
#include <optional>

#include "base/clock.hpp"

namespace binpick {
/// Where something that moves was, by time: samples in, interpolated values out. Bounded: the oldest samples go.
template <class Value>
class Track {
 public:
  /// The value at `part` (0 … 1) of the way from one to the other.
  using Between = Value (*)(const Value& from, const Value& to, double part);
  /// Across a gap longer than gap_max nothing is known: what moves may have done anything in it.
  Track(Between between, Duration gap_max, std::size_t samples_max)
      : between_{between}, gap_max_{gap_max}, samples_max_{samples_max} {}

  /// `at` must not go back; a sample that does is ignored.
  void add(TimePoint at, const Value& value) {
    if (!samples_.empty() && at <= samples_.back().at) return;
    samples_.push_back({at, value});
    if (samples_.size() > samples_max_) samples_.pop_front();
  }
  /// Between the two samples around `at`; nothing before the first or after the last sample, or across a gap.
  std::optional<Value> at(TimePoint at) const {
    const auto after = std::lower_bound(samples_.begin(), samples_.end(), at,
                                        [](const Sample& sample, TimePoint t) { return sample.at < t; });
    if (after == samples_.end()) return std::nullopt;
    if (after->at == at) return after->value;
    if (after == samples_.begin()) return std::nullopt;
    const auto before = std::prev(after);
    if (after->at - before->at > gap_max_) return std::nullopt;
    return between_(before->value, after->value, in_s(at - before->at) / in_s(after->at - before->at));
  }
  std::optional<TimePoint> newest() const {
    return samples_.empty() ? std::nullopt : std::optional{samples_.back().at};
  }
  std::optional<TimePoint> oldest() const {
    return samples_.empty() ? std::nullopt : std::optional{samples_.front().at};
  }
  void clear() { samples_.clear(); }

 private:
  struct Sample {
    TimePoint at;
    Value value;
  };
  Between between_;
  Duration gap_max_;
  std::size_t samples_max_;
  std::deque<Sample> samples_;
};
}  // namespace binpick
