#include "bench/scenes/matching.hpp"

#include <algorithm>
#include <functional>
#include <limits>

namespace binpick::bench {
Match match(const JudgedScene& scene, double score_min) {
  const std::size_t detections = scene.scores.size(), truths = scene.to_find.size();
  Match result;
  result.verdict.assign(detections, Verdict::Neutral);
  result.truth.assign(detections, -1);
  result.to_find = static_cast<int>(std::ranges::count(scene.to_find, true));
  const auto distance = [&](std::size_t i, std::size_t k) {
    return scene.distance_mm(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(k));
  };
  std::vector<std::size_t> nearest_of_truth(truths, detections);
  for (std::size_t k = 0; k < truths; ++k)
    for (std::size_t i = 0; i < detections; ++i)
      if (scene.scores[i] >= score_min &&
          (nearest_of_truth[k] == detections || distance(i, k) < distance(nearest_of_truth[k], k)))
        nearest_of_truth[k] = i;
  for (std::size_t i = 0; i < detections; ++i) {
    if (scene.scores[i] < score_min) continue;
    result.verdict[i] = Verdict::Wrong;
    std::size_t nearest = truths;
    for (std::size_t k = 0; k < truths; ++k)
      if (nearest == truths || distance(i, k) < distance(i, nearest)) nearest = k;
    if (nearest < truths && distance(i, nearest) < scene.threshold_mm && nearest_of_truth[nearest] == i) {
      result.verdict[i] = scene.to_find[nearest] ? Verdict::Right : Verdict::Neutral;
      result.truth[i] = static_cast<int>(nearest);
    }
    result.right += result.verdict[i] == Verdict::Right;
    result.wrong += result.verdict[i] == Verdict::Wrong;
  }
  return result;
}

Curve curve_of(const JudgedScene& scene) {
  Curve curve;
  curve.pile = scene.pile;
  curve.nothing_to_find = std::ranges::count(scene.to_find, true) == 0;
  std::vector<double> scores = scene.scores;
  std::ranges::sort(scores, std::greater{});
  scores.erase(std::unique(scores.begin(), scores.end()), scores.end());
  for (const double score : scores) {
    const Match m = match(scene, score);
    curve.points.push_back({score, m.right + m.wrong > 0 ? static_cast<double>(m.right) / (m.right + m.wrong) : 1,
                            m.to_find > 0 ? static_cast<double>(m.right) / m.to_find : 1});
  }
  return curve;
}
}  // namespace binpick::bench
