#include "bench/scenes/precision.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <numeric>

#include "tests/emulators/scanner/phase_shift.hpp"

namespace binpick::bench {
std::vector<MeanPoint> mean_curve(std::span<const Curve> curves, std::span<const double> weights) {
  struct Event {
    double score;
    std::size_t scene, point;
  };
  std::vector<Event> events;
  const auto weight = [&](std::size_t scene) { return weights.empty() ? 1.0 : weights[scene]; };
  double total = 0, precision = 0, recall = 0;
  for (std::size_t s = 0; s < curves.size(); ++s) {
    total += weight(s);
    precision += weight(s);
    recall += curves[s].nothing_to_find ? weight(s) : 0;
    for (std::size_t p = 0; p < curves[s].points.size(); ++p) events.push_back({curves[s].points[p].score, s, p});
  }
  if (!(total > 0)) return {};
  std::ranges::stable_sort(events, [](const Event& a, const Event& b) { return a.score > b.score; });
  std::vector<MeanPoint> mean{{std::numeric_limits<double>::infinity(), 1, recall / total}};
  for (std::size_t e = 0; e < events.size(); ++e) {
    const auto& [score, s, p] = events[e];
    const Curve& curve = curves[s];
    const CurvePoint before = p > 0 ? curve.points[p - 1] : CurvePoint{0, 1, curve.nothing_to_find ? 1.0 : 0.0};
    precision += weight(s) * (curve.points[p].precision - before.precision);
    recall += weight(s) * (curve.points[p].recall - before.recall);
    if (e + 1 == events.size() || events[e + 1].score < score)
      mean.push_back({score, precision / total, recall / total});
  }
  return mean;
}

double step_sum(std::span<const MeanPoint> points) {
  double sum = 0, recall = 0;
  for (const MeanPoint& point : points) {
    sum += point.precision * (point.recall - recall);
    recall = point.recall;
  }
  return sum;
}

PrecisionSummary summarise(std::span<const Curve> curves) {
  PrecisionSummary summary;
  const std::vector<MeanPoint> mean = mean_curve(curves);
  summary.ap = step_sum(mean);
  for (const Curve& curve : curves)
    summary.map += step_sum(mean_curve({&curve, 1})) / static_cast<double>(curves.size());
  constexpr double kRounding = 1e-9;
  for (const MeanPoint& point : mean) {
    if (point.precision + point.recall > 0)
      summary.best_f1 =
          std::max(summary.best_f1, 2 * point.precision * point.recall / (point.precision + point.recall));
    if (point.precision >= 0.99 - kRounding) {
      summary.recall_99 = std::max(summary.recall_99, point.recall);
      summary.score_99 = point.score;
    }
    if (point.precision >= 0.999 - kRounding) summary.recall_999 = std::max(summary.recall_999, point.recall);
  }
  return summary;
}

std::vector<std::vector<double>> pile_draws(std::span<const std::uint64_t> piles, std::uint64_t stream,
                                            std::size_t draws) {
  std::map<std::uint64_t, std::size_t> place;
  for (const std::uint64_t pile : piles) place.try_emplace(pile, 0);
  std::size_t count = 0;
  for (auto& [pile, at] : place) at = count++;
  emulators::Random random{emulators::mixed(20170001, stream)};
  std::vector<std::vector<double>> weights;
  for (std::size_t draw = 0; draw < draws && count > 0; ++draw) {
    std::vector<double> drawn(count);
    for (std::size_t k = 0; k < count; ++k) ++drawn[random.next() % count];
    auto& of_scene = weights.emplace_back();
    for (const std::uint64_t pile : piles) of_scene.push_back(drawn[place[pile]]);
  }
  return weights;
}

double quantile(std::vector<double> values, double q) {
  std::erase_if(values, [](double v) { return std::isnan(v); });
  if (values.empty()) return std::numeric_limits<double>::quiet_NaN();
  std::ranges::sort(values);
  const double at = q * static_cast<double>(values.size() - 1);
  const auto below = static_cast<std::size_t>(at);
  const std::size_t above = std::min(below + 1, values.size() - 1);
  return values[below] + (at - static_cast<double>(below)) * (values[above] - values[below]);
}

Interval interval_95(std::vector<double> values) { return {quantile(values, 0.025), quantile(values, 0.975)}; }
}  // namespace binpick::bench
