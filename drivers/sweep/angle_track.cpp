#include "drivers/sweep/angle_track.hpp"

namespace binpick::drivers::sweep {
namespace {
constexpr std::size_t kSamplesMax = 4096;  // 40 s at 10 ms: longer than any sweep
}  // namespace

AngleTrack::AngleTrack()
    : Track{[](const Angle& from, const Angle& to, double part) { return from + part * (to - from); }, gap_max,
            kSamplesMax} {}
}  // namespace binpick::drivers::sweep
