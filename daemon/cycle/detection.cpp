#include "daemon/cycle/detection.hpp"

#include <algorithm>
#include <exception>

#include "vision/kernels.hpp"

namespace binpick::daemon {
namespace {
/// Less than this share of a part's smallest possible footprint (a square of a tenth of its diameter) is no part.
double smallest_footprint_mm2(const vision::KnowledgeBase& part) {
  const double edge_mm = 0.1 * part.diameter_mm();
  return edge_mm * edge_mm;
}

/// The image of a supply that stands there.
vision::DepthImage image_of(std::span<const Eigen::Vector3f> points_said_mm, const Eigen::Isometry3d& T_said_found,
                            const vision::SupplyBox& box, double pixel_mm) {
  const Eigen::Isometry3f T_found_said = T_said_found.inverse().cast<float>();
  std::vector<Eigen::Vector3f> points;
  points.reserve(points_said_mm.size());
  for (const auto& p : points_said_mm) points.push_back(T_found_said * p);
  const vision::DepthWindow window = vision::window_of(box);
  vision::DepthImageBuilder builder{pixel_mm, window.min_mm, window.max_mm};
  builder.add(points);
  return builder.image();
}

DetectResult look(DetectRequest& request) {
  const auto& config = request.cell->config;
  const auto& supply = config.supplies.at(request.supply);
  const auto& recipe = config.recipes.at(request.recipe);
  const auto& part = request.cell->knowledge_bases.at(request.recipe);
  const vision::SupplyBox box{supply.size_mm};

  vision::DetectorOptions options;
  options.threads = config.detection.threads;
  options.deadline = config.detection.deadline;
  options.search = config.detection.search;

  DetectResult result;
  if (supply.locate) {
    const auto place = vision::find_supply(request.points_said_mm, box, supply.place_limits, part.noise_mm());
    if (!place) {
      result.not_located = place.error();
      return result;
    }
    result.place = *place;
    request.image = image_of(request.points_said_mm, place->T_said_found, box, part.pixel_mm());
  }
  result.loops = vision::kernels::table().name;
  result.report = vision::detect(request.image, box, part, options);
  auto& detections = result.report.detections;
  std::erase_if(detections, [&](const vision::Detection& d) { return d.score < recipe.score_min; });

  vision::ReachLimits limits = config.reach;
  if (recipe.tilt_max_rad) limits.tilt_max_rad = *recipe.tilt_max_rad;
  limits.T_base_supply.iso = supply.T_base_supply.iso * result.place.T_said_found;
  std::optional<vision::GripperScene> scene;
  if (recipe.part.gripper) scene.emplace(request.image, part.mesh(), part.noise_mm(), *recipe.part.gripper);
  result.choice =
      vision::choose_grasps(result.report, part.symmetry(), recipe.part.grasps, box, limits, scene ? &*scene : nullptr);

  Eigen::AlignedBox3f extents;
  for (const auto& vertex : part.mesh().vertices_mm) extents.extend(vertex);
  result.part_width_mm = static_cast<double>(extents.sizes().minCoeff());
  const Eigen::Vector3d centroid_mm = part.mesh().centroid_mm();
  for (const auto& detection : detections) {
    result.footprints.push_back(vision::footprint_of(part.mesh().vertices_mm, detection.T_supply_object.iso));
    result.centres_mm.push_back(detection.T_supply_object * centroid_mm);
  }

  result.fill = vision::fill_level(request.image, box, part.noise_mm());
  result.supply_empty = detections.empty() && result.fill.measured > vision::kMeasuredMin &&
                        result.fill.occupied_mm2 < smallest_footprint_mm2(part);
  return result;
}
}  // namespace

DetectResult run_detection(DetectRequest& request) noexcept {
  DetectResult result;
  try {
    result = look(request);
  } catch (const std::exception& failure) {
    result.error = failure.what();
  } catch (...) {
    result.error = "an unknown exception";
  }
  result.cycle_id = request.cycle_id;
  return result;
}
}  // namespace binpick::daemon
