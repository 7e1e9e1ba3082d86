#include "tests/emulators/scanner/scanner_place.hpp"

namespace binpick::emulators {
WhereScanner on_pivot(const ScannerPlace& place, std::function<Angle(TimePoint)> pivot_angle) {
  return [T_supply_pivot = place.T_base_supply.inverse() * place.T_base_pivot, T_pivot_scanner = place.T_pivot_scanner,
          pivot_angle = std::move(pivot_angle)](TimePoint at) {
    const Transform<frame::Pivot, frame::Pivot> turn{
        Eigen::Isometry3d{Eigen::AngleAxisd{pivot_angle(at).in_rad(), Eigen::Vector3d::UnitZ()}}};
    return T_supply_pivot * turn * T_pivot_scanner;
  };
}

WhereScanner on_flange(const Transform<frame::Base, frame::Supply>& T_base_supply,
                       const Transform<frame::Flange, frame::Scanner>& T_flange_scanner,
                       std::function<Transform<frame::Base, frame::Flange>(TimePoint)> flange) {
  return [T_supply_base = T_base_supply.inverse(), T_flange_scanner, flange = std::move(flange)](TimePoint at) {
    return T_supply_base * flange(at) * T_flange_scanner;
  };
}
}  // namespace binpick::emulators
