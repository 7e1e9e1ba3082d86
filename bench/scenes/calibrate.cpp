#include "bench/scenes/calibrate.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <map>
#include <set>
#include <stdexcept>

#include "bench/scenes/alarm_scenes.hpp"
#include "bench/scenes/classes.hpp"
#include "bench/scenes/figures.hpp"
#include "vision/score.hpp"

namespace binpick::bench {
namespace {
constexpr double kRidge = 0.3;
/// A wrong pose where nothing is to be found is worse than one among many right ones.
constexpr double kAlarmWeight = 4;
constexpr int kSteps = 100;
/// No wider: a rival two per cent short of an object that lies open is no coin.
constexpr std::array kRivalScales{0.0005, 0.001, 0.002, 0.003, 0.004, 0.006, 0.008};

struct Example {
  Eigen::VectorXd terms;
  double rival = 0;
  bool right = false;
  double weight = 1;
  double extent = 0;
  std::size_t scene = 0;
};

Example example_of(const vision::Evidence& evidence, bool right) {
  const auto terms = vision::terms_of(evidence);
  return {.terms = Eigen::Map<const Eigen::VectorXd>(terms.data(), vision::kTerms),
          .rival = evidence[vision::Clue::Rival],
          .right = right,
          .extent = evidence[vision::Clue::Extent]};
}

bool overshadowed(const RejectionLine& rejection) {
  return rejection.reason.find("better one") != std::string::npos || rejection.reason.starts_with("reaches through");
}

/// What one scene teaches.
void add_scene(const SceneLine& scene, const Judge& judge, std::size_t number, std::vector<Example>& examples) {
  const std::size_t before = examples.size();
  const Match found = match(judge.judged(scene), -1);
  std::set<int> known;
  for (std::size_t i = 0; i < scene.detections.size(); ++i) {
    const int truth = found.truth[i];
    if (truth >= 0) known.insert(truth);
    examples.push_back(example_of(scene.detections[i].evidence, found.verdict[i] != Verdict::Wrong));
    // Of what cannot be told, the judge is indifferent: it counts for the others.
    if (truth >= 0 && !scene.truths[static_cast<std::size_t>(truth)].told) examples.back().weight = 0;
  }
  for (const RejectionLine& r : scene.rejected) {
    if (overshadowed(r)) continue;
    int nearest = -1;
    double least = judge.threshold_mm();
    for (std::size_t k = 0; k < scene.truths.size(); ++k) {
      const double d =
          judge.measure(scene.truths[k].told).distance_mm(r.T_supply_object, scene.truths[k].T_supply_object);
      if (d < least) least = d, nearest = static_cast<int>(k);
    }
    examples.push_back(example_of(r.evidence, nearest >= 0));
    // Once more what is found already, or what cannot be told.
    if (nearest >= 0 && (known.contains(nearest) || !scene.truths[static_cast<std::size_t>(nearest)].told))
      examples.back().weight = 0;
  }
  for (std::size_t i = before; i < examples.size(); ++i) {
    examples[i].scene = number;
    if (is_alarm_split(scene.split)) examples[i].weight *= kAlarmWeight;
  }
}

struct Fit {
  Eigen::VectorXd weights;
  double rival_scale = 0;
  double loss = 0;  ///< Mean of the weighted -log of the probability of what was so.
};

double by_itself(const Fit& fit, const Example& e) { return 1 / (1 + std::exp(-fit.weights.dot(e.terms))); }

double probability(const Fit& fit, const Example& e) {
  return by_itself(fit, e) * vision::against_rival(e.rival, fit.rival_scale);
}

/// Maximum of the likelihood with a ridge, by scoring: Newton's method with the expected curvature.
Fit fitted(const std::vector<Example>& examples, double rival_scale) {
  Fit fit;
  fit.rival_scale = rival_scale;
  const Eigen::Index terms = examples.front().terms.size();
  fit.weights = Eigen::VectorXd::Zero(terms);
  for (int step = 0; step < kSteps; ++step) {
    Eigen::MatrixXd curvature = kRidge * Eigen::MatrixXd::Identity(terms, terms);
    Eigen::VectorXd gradient = -kRidge * fit.weights;
    for (const Example& e : examples) {
      const double own = by_itself(fit, e), all = probability(fit, e);
      const double slope = all * (1 - own);  // of `all` by the logit
      const double spread = std::max(1e-12, all * (1 - all));
      gradient += e.weight * ((e.right ? 1.0 : 0.0) - all) * slope / spread * e.terms;
      curvature += e.weight * slope * slope / spread * e.terms * e.terms.transpose();
    }
    const Eigen::VectorXd delta = curvature.ldlt().solve(gradient);
    fit.weights += delta;
    if (delta.norm() < 1e-6) break;
  }
  const auto counted =
      static_cast<double>(std::ranges::count_if(examples, [](const Example& e) { return e.weight > 0; }));
  for (const Example& e : examples) {
    const double p = probability(fit, e);
    fit.loss -= e.weight * std::log(std::max(1e-12, e.right ? p : 1 - p)) / counted;
  }
  return fit;
}
/// The same poses as the second step sees them: by themselves, and by what all of their scene explain.
std::vector<Example> among_others(const std::vector<Example>& examples, const Fit& first) {
  std::map<std::size_t, double> known;
  for (const Example& e : examples) known[e.scene] += by_itself(first, e) * e.extent;
  std::vector<Example> second = examples;
  for (Example& e : second) {
    const auto terms = vision::second_terms(by_itself(first, e), known[e.scene]);
    e.terms = Eigen::Map<const Eigen::VectorXd>(terms.data(), static_cast<Eigen::Index>(terms.size()));
  }
  return second;
}

void print(const char* name, const char* size, const Eigen::VectorXd& weights) {
  std::printf("constexpr std::array<double, %s> %s{", size, name);
  for (Eigen::Index k = 0; k < weights.size(); ++k) std::printf("%s%.4g", k == 0 ? "" : ", ", weights[k]);
  std::printf("};\n");
}
}  // namespace

void calibrate(const std::vector<std::string>& folders) {
  std::vector<Example> examples;
  std::size_t scenes = 0;
  std::map<std::string, Judge> judges;
  for (const std::string& folder : folders)
    for (const auto& [key, scene] : read_run(folder).scenes) {
      if (scene.detector != "binpick") continue;
      const auto it = judges.try_emplace(scene.scanner + ' ' + scene.part,
                                         scene_part(find_setting(scene.scanner)->scanner, scene.part));
      add_scene(scene, it.first->second, scenes++, examples);
    }
  if (examples.empty()) throw std::runtime_error{"no scene to learn from"};
  Fit best;
  for (const double scale : kRivalScales)
    if (const Fit fit = fitted(examples, scale); best.rival_scale == 0 || fit.loss < best.loss) best = fit;
  const std::vector<Example> second = among_others(examples, best);
  const Fit last = fitted(second, best.rival_scale);
  std::vector<Believed> believed;
  double right = 0;
  for (const Example& e : second) {
    if (e.weight == 0) continue;
    believed.push_back({probability(last, e), e.right});
    right += e.right;
  }
  std::printf("// %zu poses of %zu scenes, %.0f of them right; log loss %.4f and %.4f, calibration error %.4f.\n",
              believed.size(), scenes, right, best.loss, last.loss, calibration_error(believed));
  std::printf("constexpr double kRivalScale = %g;\n", best.rival_scale);
  print("kWeights", "kTerms", best.weights);
  print("kSecondWeights", "kSecondTerms", last.weights);
}
}  // namespace binpick::bench
