#include "bench/scenes/judge.hpp"

#include <algorithm>
#include <limits>

namespace binpick::bench {
namespace {
/// Own parts are nearly symmetric about z.
vision::Symmetry near_symmetry(const ScenePart& part, const PoseMeasure& exact) {
  vision::Symmetry symmetry = exact.symmetry();
  if (part.tells) {
    symmetry.kind = vision::Symmetry::Kind::Revolution;
    symmetry.axis = Eigen::Vector3d::UnitZ();
  }
  return symmetry;
}
}  // namespace

Judge::Judge(const ScenePart& part)
    : exact_{part.body.mesh, judged_symmetry(part.body.mesh, vision::figures_of(part.scanner).noise_mm)},
      near_{part.body.mesh, near_symmetry(part, exact_)} {}

JudgedScene Judge::judged(const SceneLine& scene, double threshold_diameters) const {
  JudgedScene judged;
  judged.pile = scene.pile;
  judged.threshold_mm = threshold_diameters * diameter_mm();
  judged.distance_mm.resize(static_cast<Eigen::Index>(scene.detections.size()),
                            static_cast<Eigen::Index>(scene.truths.size()));
  for (const TruthLine& truth : scene.truths) judged.to_find.push_back(truth.visible >= kVisibleMin && truth.told);
  for (std::size_t i = 0; i < scene.detections.size(); ++i) {
    judged.scores.push_back(scene.detections[i].score);
    for (std::size_t k = 0; k < scene.truths.size(); ++k)
      judged.distance_mm(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(k)) =
          measure(scene.truths[k].told)
              .distance_mm(scene.detections[i].T_supply_object, scene.truths[k].T_supply_object);
  }
  return judged;
}

double Judge::nearest_mm(const Eigen::Isometry3d& pose, std::span<const Truth> truths) const {
  double least = std::numeric_limits<double>::infinity();
  for (const Truth& truth : truths)
    least = std::min(least, measure(truth.told).distance_mm(pose, truth.T_supply_object.iso));
  return least;
}
}  // namespace binpick::bench
