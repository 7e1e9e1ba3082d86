#include "daemon/cycle/scan_picture.hpp"

#include "base/overloaded.hpp"
#include "vision/registration.hpp"

namespace binpick::daemon {
namespace {
vision::DepthImageBuilder builder_for(const CellData& cell, std::size_t supply, std::size_t recipe) {
  const Eigen::Vector2d half = cell.config.supplies.at(supply).size_mm.head<2>() / 2;
  return {cell.knowledge_bases.at(recipe).pixel_mm(), -half, half};
}

Transform<frame::Base, frame::Scanner> scanner_at(const config::Config& config,
                                                  const drivers::sweep::CarrierPose& carrier) {
  return std::visit(Overloaded{
                        [&](const Angle& pivot) { return vision::scanner_at(config.mount, pivot); },
                        [&](const Transform<frame::Base, frame::Flange>& T_base_flange) {
                          return T_base_flange * config.T_flange_scanner;
                        },
                    },
                    carrier);
}
}  // namespace

ScanPicture::ScanPicture(std::shared_ptr<const CellData> cell, std::size_t supply, std::size_t recipe)
    : cell_{std::move(cell)}, supply_{supply}, recipe_{recipe}, builder_{builder_for(*cell_, supply, recipe)} {}

void ScanPicture::add(const drivers::sweep::RegisteredProfile& registered) {
  const auto& config = cell_->config;
  const auto T_base_scanner = scanner_at(config, registered.carrier);
  const auto T_supply_scanner = config.supplies[supply_].T_base_supply.inverse() * T_base_scanner;
  points_supply_mm_.clear();
  vision::register_profile(registered.profile.x_mm, registered.profile.z_mm, T_supply_scanner, points_supply_mm_);
  builder_.add(points_supply_mm_);
  if (config.supplies[supply_].locate)
    points_said_mm_.insert(points_said_mm_.end(), points_supply_mm_.begin(), points_supply_mm_.end());
}

DetectRequest ScanPicture::take_request(std::uint64_t cycle_id) {
  DetectRequest request;
  request.cycle_id = cycle_id;
  request.cell = cell_;
  request.supply = supply_;
  request.recipe = recipe_;
  if (cell_->config.supplies[supply_].locate) {
    request.points_said_mm = std::move(points_said_mm_);
  } else {
    request.image = builder_.image();
  }
  return request;
}
}  // namespace binpick::daemon
