#include "bench/scenes/stage_recall.hpp"

#include <algorithm>

#include "vision/knowledge_base_impl.hpp"

namespace binpick::bench {
namespace {
/// Farther away nothing is looked at closely.
constexpr double kNearDiameters = 0.3;
}  // namespace

StageRecall::StageRecall(const Judge& judge, std::span<const Truth> truths, const vision::KnowledgeBase& base)
    : judge_{judge}, truths_{truths}, base_{base} {}

void StageRecall::operator()(const vision::StageSurvivors& alive) {
  std::vector<double>& nearest =
      nearest_.emplace_back(std::string{alive.stage}, std::vector<double>(truths_.size(), kFar)).second;
  const double near_mm = kNearDiameters * judge_.diameter_mm();
  for (std::size_t k = 0; k < truths_.size(); ++k) {
    const Eigen::Isometry3d& truth = truths_[k].T_supply_object.iso;
    const PoseMeasure& measure = judge_.measure(truths_[k].told);
    const Eigen::Vector3d centroid = truth * measure.centroid_mm();
    const auto consider = [&](const Eigen::Isometry3d& T) {
      if ((T * measure.centroid_mm() - centroid).norm() < near_mm)
        nearest[k] = std::min(nearest[k], measure.distance_mm(T, truth) / judge_.diameter_mm());
    };
    for (const auto& T : alive.poses) consider(T.iso);
    // A maximum is a place only: the poses are those of the training views that could stand there.
    if (alive.maxima_mm.empty()) continue;
    for (const vision::View& view : base_.impl().views) {
      Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
      T.linear() = view.R_supply_object.cast<double>().toRotationMatrix();
      T.translation() = centroid - T.linear() * measure.centroid_mm();
      if (measure.distance_mm(T, truth) > 0.15 * judge_.diameter_mm()) continue;
      const Eigen::Vector3d anchor = view.anchors_object_mm.front().cast<double>();
      for (const Eigen::Vector3f& maximum : alive.maxima_mm) {
        T.translation() = maximum.cast<double>() - T.linear() * anchor;
        consider(T);
      }
    }
  }
}
}  // namespace binpick::bench
