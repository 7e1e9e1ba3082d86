#pragma once

#include "drivers/pivot/session.hpp"
#include "drivers/sweep/angle_track.hpp"
#include "drivers/sweep/carrier.hpp"

namespace binpick::drivers::sweep {
/// The PR 70 as the carrier of a sweep.
class PivotCarrier final : public Carrier {
 public:
  /// `latency`: a position sample is this much older than it says.
  explicit PivotCarrier(pivot::Session& pivot) : pivot_{pivot} {}
  void set_latency(Duration latency) { latency_ = latency; }

  /// Of every event of the pivot, in a sweep or not; nothing when it does not concern a sweep.
  std::optional<CarrierNews> on(const pivot::Event& event);

  /// Starts from the end that the pivot is nearer to.
  std::optional<std::string> plan(const Motion& motion) override;
  void go_to_start(TimePoint now) override;
  void go_to_end(TimePoint now) override;
  void stop(TimePoint now) override { pivot_.stop(now); }
  Duration prepare_max() const override;
  Duration path_max() const override;
  std::string overdue() const override { return "the sweep did not come to its end in time"; }
  std::optional<TimePoint> newest() const override { return track_.newest(); }
  std::optional<CarrierPose> at(TimePoint at) const override;

 private:
  std::optional<std::string> beyond_limits() const;

  pivot::Session& pivot_;
  Duration latency_{0};
  PivotSweep sweep_;
  AngleTrack track_;
};
}  // namespace binpick::drivers::sweep
