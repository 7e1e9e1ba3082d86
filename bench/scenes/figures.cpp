#include "bench/scenes/figures.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <limits>
#include <numbers>

namespace binpick::bench {
namespace {
constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kDegree = std::numbers::pi / 180;
/// Before refinement a pose is alive when it is as near as refinement can mend.
constexpr double kAliveBefore = 0.15, kAliveAfter = kRightDiameters;

using Weights = std::vector<double>;

Estimate estimate(const std::vector<std::uint64_t>& piles, std::uint64_t stream,
                  const std::function<double(const Weights&)>& figure) {
  Estimate result;
  result.value = figure(Weights(piles.size(), 1));
  for (const Weights& weights : pile_draws(piles, stream)) result.draws.push_back(figure(weights));
  return result;
}

double weighted_mean(const std::vector<double>& values, const Weights& weights) {
  double sum = 0, total = 0;
  for (std::size_t i = 0; i < values.size(); ++i)
    if (!std::isnan(values[i])) sum += weights[i] * values[i], total += weights[i];
  return total > 0 ? sum / total : kNan;
}

double weighted_median(const std::vector<std::vector<double>>& of_scene, const Weights& weights) {
  std::vector<double> all;
  for (std::size_t i = 0; i < of_scene.size(); ++i)
    for (int n = 0; n < static_cast<int>(weights[i]); ++n)
      all.insert(all.end(), of_scene[i].begin(), of_scene[i].end());
  return quantile(std::move(all), 0.5);
}

std::vector<double> joined(const std::vector<std::vector<double>>& of_scene) {
  std::vector<double> all;
  for (const auto& values : of_scene) all.insert(all.end(), values.begin(), values.end());
  return all;
}

/// Share of the truths in a band of visibility that a detection of the whole list is at.
struct Band {
  double low, high;
  int found = 0, all = 0;
  void add(const SceneLine& scene, const Match& m) {
    for (std::size_t k = 0; k < scene.truths.size(); ++k) {
      if (scene.truths[k].visible < low || scene.truths[k].visible >= high) continue;
      ++all;
      found += std::ranges::find(m.truth, static_cast<int>(k)) != m.truth.end();
    }
  }
  double recall() const { return all > 0 ? static_cast<double>(found) / all : kNan; }
};

class Collector {
 public:
  Collector(const ScenePart& part, const std::vector<const SceneLine*>& scenes, std::uint64_t stream)
      : judge_{part}, scenes_{scenes}, stream_{stream} {
    figures_.name = part.body.name;
    figures_.scenes = scenes.size();
  }

  PartFigures collect() {
    std::vector<std::uint64_t> piles;
    std::vector<double> firsts, firsts_3;
    for (const SceneLine* scene : scenes_) {
      judged_.push_back(judge_.judged(*scene));
      figures_.curves.push_back(curve_of(judged_.back()));
      piles.push_back(scene->pile);
    }
    figures_.summary = summarise(figures_.curves);
    figures_.ap_05 = ap_at(0.05);
    figures_.ap_02 = ap_at(0.02);
    std::vector<std::vector<double>> t_mm, r_deg;
    Band easy{0.85, 10}, hard{0.25, kVisibleMin};
    for (std::size_t s = 0; s < scenes_.size(); ++s) {
      const SceneLine& scene = *scenes_[s];
      const Match all = match(judged_[s], -1);
      easy.add(scene, all);
      hard.add(scene, all);
      count(scene, judged_[s], all);
      const auto [first, first_3] = first_answer(scene, all.to_find);
      firsts.push_back(first);
      firsts_3.push_back(first_3);
      const Match sure = match(judged_[s], figures_.summary.score_99);
      t_mm.emplace_back();
      r_deg.emplace_back();
      for (std::size_t i = 0; i < scene.detections.size(); ++i) {
        if (sure.verdict[i] != Verdict::Right) continue;
        const TruthLine& truth = scene.truths[static_cast<std::size_t>(sure.truth[i])];
        const auto& pose = scene.detections[i].T_supply_object;
        const auto error = judge_.measure(true).error(pose, truth.T_supply_object);
        t_mm.back().push_back(error.centroid_mm.norm());
        r_deg.back().push_back(error.angle_rad() / kDegree);
        figures_.normalised_errors.push_back(
            judge_.measure(true).normalised_error_squared(pose, truth.T_supply_object, scene.detections[i].covariance));
      }
    }
    figures_.recall_easy = easy.recall();
    figures_.recall_hard = hard.recall();
    figures_.t_p95_mm = quantile(joined(t_mm), 0.95);
    figures_.r_p95_deg = quantile(joined(r_deg), 0.95);
    figures_.first_within_3 = weighted_mean(firsts_3, Weights(firsts_3.size(), 1));
    figures_.ap = estimate(piles, stream_, [&](const Weights& w) { return step_sum(mean_curve(figures_.curves, w)); });
    figures_.first_right = estimate(piles, stream_, [&](const Weights& w) { return weighted_mean(firsts, w); });
    figures_.t_mm = estimate(piles, stream_, [&](const Weights& w) { return weighted_median(t_mm, w); });
    figures_.r_deg = estimate(piles, stream_, [&](const Weights& w) { return weighted_median(r_deg, w); });
    for (auto& [stage, ms] : figures_.stages_ms) ms /= static_cast<double>(std::max<std::size_t>(1, scenes_.size()));
    return std::move(figures_);
  }

 private:
  double ap_at(double diameters) const {
    std::vector<Curve> curves;
    for (const SceneLine* scene : scenes_) curves.push_back(curve_of(judge_.judged(*scene, diameters)));
    return step_sum(mean_curve(curves));
  }

  /// Right or not, and within 3 mm and 3 degrees or not; NaN where nothing is to find. No answer is no right one.
  std::pair<double, double> first_answer(const SceneLine& scene, int to_find) const {
    if (to_find == 0) return {kNan, kNan};
    const auto best = std::ranges::max_element(scene.detections, {}, &DetectionLine::score);
    if (best == scene.detections.end()) return {0, 0};
    double right = 0, within = 0;
    for (const TruthLine& truth : scene.truths) {
      const PoseMeasure& measure = judge_.measure(truth.told);
      if (measure.distance_mm(best->T_supply_object, truth.T_supply_object) < judge_.threshold_mm()) right = 1;
      const auto error = measure.error(best->T_supply_object, truth.T_supply_object);
      if (error.centroid_mm.norm() <= 3 && error.angle_rad() <= 3 * kDegree) within = 1;
    }
    return {right, within};
  }

  void count(const SceneLine& scene, const JudgedScene& judged, const Match& all) {
    figures_.right += all.right;
    figures_.wrong += all.wrong;
    figures_.to_find += all.to_find;
    const Match half = match(judged, 0.5);
    figures_.right_half += half.right;
    figures_.wrong_half += half.wrong;
    for (std::size_t i = 0; i < scene.detections.size(); ++i)
      if (all.verdict[i] != Verdict::Neutral)
        figures_.believed.push_back({scene.detections[i].score, all.verdict[i] == Verdict::Right});
    figures_.time_ms.push_back(scene.time_ms);
    figures_.image_ms.push_back(scene.image_ms);
    if (scene.first) {
      figures_.first_ms.push_back(scene.first->time_ms);
      figures_.first_hypotheses.push_back(static_cast<double>(scene.first->hypotheses));
    }
    for (const auto& [stage, ms] : scene.stages_ms) figures_.stages_ms[stage] += ms;
    for (const auto& [stage, nearest] : scene.alive) {
      auto it = std::ranges::find(figures_.stages, stage, &StageCount::stage);
      if (it == figures_.stages.end()) it = figures_.stages.insert(it, {stage, 0});  // at the end
      const bool refined = stage == "rendered test" || stage == "selection";
      for (std::size_t k = 0; k < nearest.size(); ++k)
        it->alive += judged.to_find[k] && nearest[k] < (refined ? kAliveAfter : kAliveBefore);
    }
  }

  Judge judge_;
  const std::vector<const SceneLine*>& scenes_;
  std::uint64_t stream_;
  std::vector<JudgedScene> judged_;
  PartFigures figures_;
};
}  // namespace

Estimate mean_of(const std::vector<const Estimate*>& parts) {
  Estimate mean;
  const auto n = static_cast<double>(parts.size());
  for (const Estimate* part : parts) {
    mean.value += part->value / n;
    mean.draws.resize(part->draws.size());
    for (std::size_t d = 0; d < part->draws.size(); ++d) mean.draws[d] += part->draws[d] / n;
  }
  return mean;
}

std::array<ScoreBin, 10> score_bins(const std::vector<Believed>& believed) {
  std::array<ScoreBin, 10> bins{};
  for (const Believed& b : believed) {
    ScoreBin& bin = bins[static_cast<std::size_t>(std::clamp(b.score * 10, 0.0, 9.0))];
    bin.score += b.score;
    bin.right += b.right;
    ++bin.count;
  }
  return bins;
}

double calibration_error(const std::vector<Believed>& believed) {
  double error = 0;
  for (const ScoreBin& bin : score_bins(believed)) error += std::abs(bin.right - bin.score);
  return believed.empty() ? 0 : error / static_cast<double>(believed.size());
}

PartFigures figures_of_part(const ScenePart& part, const std::vector<const SceneLine*>& scenes, std::uint64_t stream) {
  return Collector{part, scenes, stream}.collect();
}
}  // namespace binpick::bench
