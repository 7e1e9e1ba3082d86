#pragma once

#include "base/track.hpp"
#include "base/units.hpp"

namespace binpick::drivers::sweep {
/// Where the pivot was, by time: linear between samples.
class AngleTrack : public Track<Angle> {
 public:
  AngleTrack();

  static constexpr Duration gap_max = std::chrono::milliseconds(250);
};
}  // namespace binpick::drivers::sweep
