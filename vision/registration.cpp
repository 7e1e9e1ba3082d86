#include "vision/registration.hpp"

#include <cmath>

#include "base/check.hpp"

namespace binpick::vision {
Transform<frame::Base, frame::Scanner> scanner_at(const ScannerMount& mount, Angle pivot) {
  Eigen::Isometry3d turn = Eigen::Isometry3d::Identity();
  turn.linear() = Eigen::AngleAxisd(pivot.in_rad(), Eigen::Vector3d::UnitZ()).toRotationMatrix();
  return {mount.T_base_pivot.iso * turn * mount.T_pivot_scanner.iso};
}

void register_profile(std::span<const float> x_mm, std::span<const float> z_mm,
                      const Transform<frame::Supply, frame::Scanner>& T_supply_scanner,
                      std::vector<Eigen::Vector3f>& out_supply_mm) {
  BINPICK_CHECK(x_mm.size() == z_mm.size());
  out_supply_mm.reserve(out_supply_mm.size() + x_mm.size());
  for (std::size_t i = 0; i < x_mm.size(); ++i) {
    if (!std::isfinite(x_mm[i]) || !std::isfinite(z_mm[i]) || !(z_mm[i] > 0)) continue;
    out_supply_mm.push_back((T_supply_scanner * Eigen::Vector3d(x_mm[i], 0, z_mm[i])).cast<float>());
  }
}
}  // namespace binpick::vision
