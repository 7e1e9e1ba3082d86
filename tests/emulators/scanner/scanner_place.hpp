#pragma once

#include <functional>

#include "base/clock.hpp"
#include "base/frames.hpp"
#include "base/units.hpp"

/// Where an emulated scanner stands, and with it what it sees.
namespace binpick::emulators {
/// Where the scanner stands over the supply, at any time.
using WhereScanner = std::function<Transform<frame::Supply, frame::Scanner>(TimePoint)>;

/// Where scanner, pivot and supply stand: T_base_scanner = T_base_pivot · Rz(pivot angle) · T_pivot_scanner.
struct ScannerPlace {
  Transform<frame::Base, frame::Pivot> T_base_pivot;
  Transform<frame::Pivot, frame::Scanner> T_pivot_scanner;
  Transform<frame::Base, frame::Supply> T_base_supply;
};
WhereScanner on_pivot(const ScannerPlace& place, std::function<Angle(TimePoint)> pivot_angle);

/// The robot carries it.
WhereScanner on_flange(const Transform<frame::Base, frame::Supply>& T_base_supply,
                       const Transform<frame::Flange, frame::Scanner>& T_flange_scanner,
                       std::function<Transform<frame::Base, frame::Flange>(TimePoint)> flange);
}  // namespace binpick::emulators
