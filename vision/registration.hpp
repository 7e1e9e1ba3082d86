#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "base/frames.hpp"
#include "base/units.hpp"

namespace binpick::vision {
/// Where a pivot-mounted scanner stands: T_base_scanner = T_base_pivot * Rz(pivot angle) * T_pivot_scanner.
struct ScannerMount {
  Transform<frame::Base, frame::Pivot> T_base_pivot;
  Transform<frame::Pivot, frame::Scanner> T_pivot_scanner;
};
Transform<frame::Base, frame::Scanner> scanner_at(const ScannerMount& mount, Angle pivot);

/// One profile's points in the supply frame, mm. Point i lies at (x_mm[i], 0, z_mm[i]) in the scanner frame; what is
/// not finite, or not in front of the scanner, gives no point.
void register_profile(std::span<const float> x_mm, std::span<const float> z_mm,
                      const Transform<frame::Supply, frame::Scanner>& T_supply_scanner,
                      std::vector<Eigen::Vector3f>& out_supply_mm);
}  // namespace binpick::vision
