#include "vision/score.hpp"

#include <algorithm>
#include <cmath>

namespace binpick::vision {
namespace {
#include "vision/score_weights.inc"

template <std::size_t N>
double logistic(const std::array<double, N>& weights, const std::array<double, N>& terms) {
  double logit = 0;
  for (std::size_t k = 0; k < N; ++k) logit += weights[k] * terms[k];
  return 1 / (1 + std::exp(-logit));
}
}  // namespace

Evidence evidence_of(const DenseTest& test) {
  // Of a sparse scan, what a dense one would show: the gaps between its points are left out.
  const auto pixels = static_cast<float>(std::max(1, test.pixels - test.holes));
  const auto seen = static_cast<float>(std::max(1, test.explained + test.contradicted));
  Evidence e;
  e[Clue::Visible] = test.visible_fraction();
  e[Clue::Contradicted] = static_cast<float>(test.contradicted - test.contradicted_border) / seen;
  e[Clue::Border] = static_cast<float>(test.contradicted_border) / seen;
  e[Clue::Missing] = static_cast<float>(test.missing - test.holes) / pixels;
  e[Clue::Holes] = static_cast<float>(test.holes) / static_cast<float>(std::max(1, test.pixels));
  e[Clue::Unseen] = static_cast<float>(test.unseen) / pixels;
  e[Clue::Ends] = static_cast<float>(test.ends) / (4 * std::sqrt(pixels));
  e[Clue::Edges] = test.edge_ratio();
  e[Clue::EdgeLength] = static_cast<float>(test.edges_found + test.edges_missing) / (4 * std::sqrt(pixels));
  e[Clue::Normals] = test.normal_agreement;
  e[Clue::Curvature] = test.bend_agreement;
  e[Clue::Fit] = test.fit;
  e[Clue::Known] = 0.5F;
  e[Clue::Size] = std::log10(static_cast<float>(std::max(1, test.explained)));
  return e;
}

std::array<double, kTerms> terms_of(const Evidence& e) {
  const auto at = [&](Clue clue) { return static_cast<double>(e[clue]); };
  // Few edges say little: as if a tenth of the outline more were half found.
  const double edges = (at(Clue::Edges) * at(Clue::EdgeLength) + 0.05) / (at(Clue::EdgeLength) + 0.1);
  const auto root = [](double x) { return std::sqrt(std::max(0.0, x)); };
  // Where a scan is sparse, what is not there may be between its points.
  const double dense = std::max(0.0, 1 - at(Clue::Holes) / 0.15);
  return {1.0,
          std::min(0.3, at(Clue::Visible)),
          std::max(0.0, at(Clue::Visible) - 0.3),
          at(Clue::Contradicted),
          root(at(Clue::Contradicted)),
          at(Clue::Border),
          at(Clue::Missing),
          at(Clue::Holes),
          dense * root(at(Clue::Unseen)),
          dense * root(at(Clue::Ends)),
          edges,
          edges * edges,
          std::min(1.0, at(Clue::EdgeLength) * at(Clue::Edges)),
          root(at(Clue::EdgeLength) * (1 - at(Clue::Edges))),
          at(Clue::Normals),
          at(Clue::Curvature),
          at(Clue::Fit),
          at(Clue::Size),
          at(Clue::Looseness),
          at(Clue::Claimed)};
}

double against_rival(double rival, double scale) { return 1 / (1 + std::exp((rival - 1) / scale)); }

double score_by_itself(const Evidence& evidence) { return logistic(kWeights, terms_of(evidence)); }

std::array<double, kSecondTerms> second_terms(double by_itself, double known) {
  const auto logit = [](double p, double least) {
    const double q = std::clamp(p, least, 1 - least);
    return std::log(q / (1 - q));
  };
  return {1, logit(by_itself, 1e-6), std::min(logit(known, 0.1), logit(static_cast<double>(kKnownEnough), 0.1))};
}

double score_of(const Evidence& evidence) {
  return against_rival(static_cast<double>(evidence[Clue::Rival]), kRivalScale) *
         logistic(kSecondWeights, second_terms(score_by_itself(evidence), static_cast<double>(evidence[Clue::Known])));
}
}  // namespace binpick::vision
