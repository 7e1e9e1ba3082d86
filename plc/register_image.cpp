#include "plc/register_image.hpp"

#include <algorithm>
#include <array>

#include "base/rotation.hpp"

namespace binpick::plc {
namespace {
/// x y z and three angles as the PLC's robot writes them (docs/plc-registers.md, pose conventions).
std::array<double, 6> pose_numbers(const Eigen::Isometry3d& T, PoseConvention convention) {
  const Eigen::Matrix3d R = T.linear();
  Eigen::Vector3d p = T.translation();
  Eigen::Vector3d angles = Eigen::Vector3d::Zero();
  switch (convention) {
    case PoseConvention::UniversalRobots:
      p *= 1e-3;
      angles = to_rotation_vector(R);
      break;
    case PoseConvention::Fanuc:
      angles = to_wpr_deg(R);
      break;
    case PoseConvention::Kawasaki:
      angles = to_oat_deg(R);
      break;
  }
  return {p.x(), p.y(), p.z(), angles.x(), angles.y(), angles.z()};
}
}  // namespace

void RegisterImage::clear_result() { std::ranges::fill(words_.subspan(kResultFirst, kResultLength), std::uint16_t{0}); }

void RegisterImage::put_result(const PickRequest& request, const PickResult& result, PoseConvention convention) {
  clear_result();
  put(at("result_code"), static_cast<std::uint16_t>(result.code));
  put(at("pick_id"), result.pick_id);
  put(at("result_part_id"), result.part_id);
  put(at("result_supply_id"), request.supply_id);
  put(at("objects_left"), result.objects_left);
  put(at("fill_level"), result.fill_level_percent);
  put(at("unreachable_reason"), static_cast<std::uint16_t>(result.unreachable));
  put_long(at("score"), static_cast<float>(result.score));
  if (result.code == ResultCode::PickFound) {
    const auto approach = pose_numbers(result.T_base_approach.iso, convention);
    const auto grasp = pose_numbers(result.T_base_grasp.iso, convention);
    const auto retreat = pose_numbers(result.T_base_retreat.iso, convention);
    for (std::uint16_t i = 0; i < 6; ++i) {
      put_long(static_cast<std::uint16_t>(at("approach_x") + 2 * i), static_cast<float>(approach[i]));
      put_long(static_cast<std::uint16_t>(at("grasp_x") + 2 * i), static_cast<float>(grasp[i]));
    }
    for (std::uint16_t i = 0; i < 3; ++i)
      put_long(static_cast<std::uint16_t>(at("retreat_x") + 2 * i), static_cast<float>(retreat[i]));
  }
  put(at("sweep_ms"), result.figures.sweep_ms);
  put(at("profiles"), result.figures.profiles);
  put_long(at("points"), result.figures.points);
  put_long(at("hypotheses"), result.figures.hypotheses);
  put(at("detection_ms"), result.figures.detection_ms);
  put(at("result_sequence"), request.sequence);
  put(at("result_sequence_tail"), request.sequence);
}
}  // namespace binpick::plc
