#include "bench/scenes/must.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>

#include "base/check.hpp"

namespace binpick::bench {
namespace {
struct FigureName {
  Figure figure;
  const char* name;
  bool more_is_better;
  const char* format;
};
constexpr std::array kNames{FigureName{Figure::ApMean, "AP, mean over parts", true, "%.3f"},
                            FigureName{Figure::ApWorst, "AP, worst part", true, "%.3f"},
                            FigureName{Figure::FirstRight, "first answer right", true, "%.4f"},
                            FigureName{Figure::Error_mm, "median error of right ones, mm", false, "%.2f"},
                            FigureName{Figure::Error_deg, "median error of right ones, deg", false, "%.2f"},
                            FigureName{Figure::PrecisionHalf, "precision at score >= .5", true, "%.3f"},
                            FigureName{Figure::RecallHalf, "recall at score >= .5", true, "%.3f"},
                            FigureName{Figure::Calibration, "calibration error of the score", false, "%.3f"},
                            FigureName{Figure::NormalisedError, "normalised error squared, median", false, "%.2f"},
                            FigureName{Figure::TimeP50, "ms, whole list, p50", false, "%.0f"},
                            FigureName{Figure::TimeP99, "ms, whole list, p99", false, "%.0f"},
                            FigureName{Figure::FirstP50, "ms, first valid pose, p50", false, "%.0f"},
                            FigureName{Figure::PeerSpeed, "times as fast as OpenCV's surface_matching", true, "%.0f"},
                            FigureName{Figure::PeerError, "1 - AP over OpenCV's", false, "%.2f"},
                            FigureName{Figure::Alarms, "scenes without the part, detection above .5", false, "%.0f"}};

constexpr std::array kDemands{Demand{Figure::ApMean, "lps36hi", .95, .985},
                              Demand{Figure::ApMean, "lps36", .92, .97},
                              Demand{Figure::ApMean, "lms400", .94, .98},
                              Demand{Figure::ApWorst, "lps36hi", .88, {}},
                              Demand{Figure::ApWorst, "lps36", .85, {}},
                              Demand{Figure::ApWorst, "lms400", .88, {}},
                              Demand{Figure::FirstRight, "lps36hi", .99, .998},
                              Demand{Figure::FirstRight, "lps36", .985, .998},
                              Demand{Figure::FirstRight, "lms400", .98, .995},
                              Demand{Figure::Error_mm, "lps36hi", .2, .08},
                              Demand{Figure::Error_mm, "lps36", .4, .25},
                              Demand{Figure::Error_mm, "lms400", 1.4, .8},
                              Demand{Figure::Error_deg, "lps36hi", .6, .25},
                              Demand{Figure::Error_deg, "lps36", 1.2, .6},
                              Demand{Figure::Error_deg, "lms400", .7, .4},
                              Demand{Figure::PrecisionHalf, "lps36hi", .98, {}},
                              Demand{Figure::RecallHalf, "lps36hi", .92, {}},
                              Demand{Figure::Calibration, "all", .04, {}},
                              Demand{Figure::NormalisedError, "all", 2, {}, .5},
                              Demand{Figure::TimeP50, "all", 60, 20},
                              Demand{Figure::TimeP99, "all", 150, 60},
                              Demand{Figure::FirstP50, "all", 30, 8},
                              Demand{Figure::PeerSpeed, "all", 50, {}},
                              Demand{Figure::PeerError, "all", 1.0 / 3, {}},
                              Demand{Figure::Alarms, "all", 0, {}}};

const FigureName& named(Figure figure) {
  const auto it = std::ranges::find(kNames, figure, &FigureName::figure);
  BINPICK_CHECK(it != kNames.end());
  return *it;
}

std::vector<double> joined(const std::vector<ClassFigures>& classes, std::vector<double> PartFigures::*of) {
  std::vector<double> all;
  for (const ClassFigures& figures : classes) {
    const std::vector<double> own = figures.all(of);
    all.insert(all.end(), own.begin(), own.end());
  }
  return all;
}

/// Each class counts the same, whatever the number of its parts.
double mean_ap(const std::vector<ClassFigures>& classes) {
  double sum = 0;
  for (const ClassFigures& figures : classes) sum += figures.mean(&PartFigures::ap).value;
  return sum / static_cast<double>(classes.size());
}

Estimate worst_ap(const std::vector<ClassFigures>& classes) {
  const PartFigures* worst = nullptr;
  for (const ClassFigures& figures : classes)
    for (const PartFigures& part : figures.parts)
      if (worst == nullptr || part.ap.value < worst->ap.value) worst = &part;
  return worst->ap;
}

double share_at_half(const std::vector<ClassFigures>& classes, bool precision) {
  int right = 0, wrong = 0, to_find = 0;
  for (const ClassFigures& figures : classes)
    for (const PartFigures& part : figures.parts)
      right += part.right_half, wrong += part.wrong_half, to_find += part.to_find;
  return static_cast<double>(right) / std::max(1, precision ? right + wrong : to_find);
}

std::optional<Estimate> of_peer(Figure figure, const Evidence& evidence) {
  if (evidence.peer.empty()) return {};
  if (figure == Figure::PeerError)
    return Estimate{(1 - mean_ap(evidence.beside_peer)) / std::max(1e-9, 1 - mean_ap(evidence.peer)), {}};
  return Estimate{quantile(joined(evidence.peer, &PartFigures::time_ms), 0.5) /
                      quantile(joined(evidence.beside_peer, &PartFigures::time_ms), 0.5),
                  {}};
}

std::optional<Estimate> of_alarms(const Evidence& evidence) {
  if (evidence.alarms.empty()) return {};
  double with = 0;
  for (const auto& [scanner, parts] : evidence.alarms)
    for (const auto& [part, kinds] : parts)
      for (const AlarmCount& count : kinds) with += count.scenes_with;
  return Estimate{with, {}};
}

std::optional<Estimate> measured(const Demand& demand, const Evidence& evidence) {
  if (demand.figure == Figure::Alarms) return of_alarms(evidence);
  if (demand.figure == Figure::PeerSpeed || demand.figure == Figure::PeerError) return of_peer(demand.figure, evidence);
  std::vector<ClassFigures> classes;
  for (const ClassFigures& figures : evidence.classes)
    if (demand.where == "all" || demand.where == figures.name) classes.push_back(figures);
  if (classes.empty()) return {};
  const auto at = [&](std::vector<double> PartFigures::*of, double q) {
    return Estimate{quantile(joined(classes, of), q), {}};
  };
  switch (demand.figure) {
    case Figure::ApMean:
      return classes.front().mean(&PartFigures::ap);
    case Figure::ApWorst:
      return worst_ap(classes);
    case Figure::FirstRight:
      return classes.front().mean(&PartFigures::first_right);
    case Figure::Error_mm:
      return classes.front().mean(&PartFigures::t_mm);
    case Figure::Error_deg:
      return classes.front().mean(&PartFigures::r_deg);
    case Figure::PrecisionHalf:
      return Estimate{share_at_half(classes, true), {}};
    case Figure::RecallHalf:
      return Estimate{share_at_half(classes, false), {}};
    case Figure::NormalisedError:
      return at(&PartFigures::normalised_errors, 0.5);
    case Figure::TimeP50:
      return at(&PartFigures::time_ms, 0.5);
    case Figure::TimeP99:
      return at(&PartFigures::time_ms, 0.99);
    case Figure::FirstP50:
      return at(&PartFigures::first_ms, 0.5);
    default:
      break;
  }
  std::vector<Believed> believed;
  for (const ClassFigures& figures : classes)
    for (const PartFigures& part : figures.parts)
      believed.insert(believed.end(), part.believed.begin(), part.believed.end());
  return Estimate{calibration_error(believed), {}};
}
}  // namespace

std::vector<Standing> standings(const Evidence& evidence) {
  std::vector<Standing> all;
  for (const Demand& demand : kDemands) {
    Standing standing{demand, measured(demand, evidence)};
    const auto stands = [&](double bound) {
      const double here = standing.here->value;  // a figure of nothing is NaN, and passes nothing
      return named(demand.figure).more_is_better ? here >= bound : here <= bound && here >= demand.least;
    };
    if (standing.here) {
      standing.must = stands(demand.must);
      standing.aim = demand.aim && stands(*demand.aim);
    }
    all.push_back(std::move(standing));
  }
  return all;
}

void print_standings(const std::vector<Standing>& standings) {
  int measured = 0, passed = 0;
  std::printf("\n| | class | here | must | aim | |\n|---|---|---|---|---|---|\n");
  for (const Standing& s : standings) {
    const FigureName& name = named(s.demand.figure);
    const auto bound = [&](double value) { return with_interval({value, {}}, name.format); };
    const std::string least = s.demand.least > 0 ? bound(s.demand.least) + " to " : name.more_is_better ? ">= " : "<= ";
    std::printf("| %s | %s | %s | %s%s | %s | %s |\n", name.name, s.demand.where.data(),
                s.here ? with_interval(*s.here, name.format).c_str() : "not measured", least.c_str(),
                bound(s.demand.must).c_str(), s.demand.aim ? bound(*s.demand.aim).c_str() : "",
                !s.here  ? ""
                : s.aim  ? "passed, aim reached"
                : s.must ? "passed"
                         : "FAILED");
    measured += s.here.has_value();
    passed += s.must;
  }
  std::printf("%d of %zu passed, %d failed, %zu not measured.\n", passed, standings.size(), measured - passed,
              standings.size() - static_cast<std::size_t>(measured));
}
}  // namespace binpick::bench
