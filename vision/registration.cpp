#include "vision/registration.hpp"

#include <cmath>

namespace binpick::vision {
Transform<frame::Base, frame::Scanner> scanner_at(const ScannerMount& mount, Angle pivot) {
  Eigen::Isometry3d turn = Eigen::Isometry3d::Identity();
  turn.linear() = Eigen::AngleAxisd(pivot.in_rad(), Eigen::Vector3d::UnitZ()).toRotationMatrix();
  return {mount.T_base_pivot.iso * turn * mount.T_pivot_scanner.iso};
}

void register_profile(std::span<const float> range_mm, Angle first, Angle step,
                      const Transform<frame::Supply, frame::Scanner>& T_supply_scanner,
                      std::vector<Eigen::Vector3f>& out_supply_mm) {
  out_supply_mm.reserve(out_supply_mm.size() + range_mm.size());
  for (std::size_t i = 0; i < range_mm.size(); ++i) {
    const double range = range_mm[i];
    if (!(range > 0) || !std::isfinite(range)) continue;
    const double angle = first.in_rad() + static_cast<double>(i) * step.in_rad();
    const Eigen::Vector3d p_scanner(range * std::cos(angle), 0, range * std::sin(angle));
    out_supply_mm.push_back((T_supply_scanner * p_scanner).cast<float>());
  }
}
}  // namespace binpick::vision
