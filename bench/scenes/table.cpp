#include "bench/scenes/table.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <numeric>
#include <stdexcept>

#include "bench/scenes/alarms.hpp"
#include "bench/scenes/charts.hpp"
#include "bench/scenes/classes.hpp"
#include "bench/scenes/comparison.hpp"
#include "bench/scenes/must.hpp"

namespace binpick::bench {
namespace {
/// Fewer say nothing of a share.
constexpr double kBinMin = 10;

double ratio(int part, int whole) { return whole > 0 ? static_cast<double>(part) / whole : 1; }

void print_row(const char* what, const std::vector<ClassFigures>& classes, Estimate PartFigures::*of,
               const char* format, bool large_is_good) {
  std::printf("| %s |", what);
  for (const ClassFigures& figures : classes) {
    const PartFigures* worst = nullptr;
    for (const PartFigures& part : figures.parts)
      if (worst == nullptr || ((part.*of).value < (worst->*of).value) == large_is_good) worst = &part;
    std::printf(" %s; worst %s (%s) |", with_interval(figures.mean(of), format).c_str(),
                with_interval(worst->*of, format).c_str(), worst->name.c_str());
  }
  std::printf("\n");
}

void print_head(const std::vector<ClassFigures>& classes) {
  std::printf("| |");
  for (const ClassFigures& figures : classes) std::printf(" %s |", figures.name.c_str());
  std::printf("\n|---|");
  for (std::size_t k = 0; k < classes.size(); ++k) std::printf("---|");
  std::printf("\n");
}

void print_main(const std::vector<ClassFigures>& classes) {
  std::printf("\nMean over parts, and the worst part; 95 %% intervals by 1000 draws of piles.\n");
  print_head(classes);
  print_row("AP", classes, &PartFigures::ap, "%.3f", true);
  print_row("first answer right", classes, &PartFigures::first_right, "%.3f", true);
  print_row("median error of right ones, mm", classes, &PartFigures::t_mm, "%.2f", false);
  print_row("median error of right ones, deg", classes, &PartFigures::r_deg, "%.2f", false);
}

void print_parts(const std::vector<ClassFigures>& classes) {
  std::printf(
      "\n| part | scenes | AP | at .05 D | at .02 D | mAP | best F1 | recall at precision .99 | .999 | right / wrong / "
      "to find | first right | within 3 mm 3 deg | visible >= .85 | .25 to .5 | mm p95 | deg p95 | ms p50 |\n"
      "|---|---|---|---|---|---|---|---|---|---|---|---|---|---|---|---|---|\n");
  for (const ClassFigures& figures : classes)
    for (const PartFigures& p : figures.parts)
      std::printf(
          "| %s %s | %zu | %.3f | %.3f | %.3f | %.3f | %.3f | %.3f | %.3f | %d / %d / %d | %.3f | %.3f | %.3f | "
          "%.3f | %.2f | %.2f | %.0f |\n",
          figures.name.c_str(), p.name.c_str(), p.scenes, p.ap.value, p.ap_05, p.ap_02, p.summary.map,
          p.summary.best_f1, p.summary.recall_99, p.summary.recall_999, p.right, p.wrong, p.to_find,
          p.first_right.value, p.first_within_3, p.recall_easy, p.recall_hard, p.t_p95_mm, p.r_p95_deg,
          quantile(p.time_ms, 0.5));
}

void print_stages(const std::vector<ClassFigures>& classes) {
  std::printf(
      "\nStage recall: true poses to find that are still alive (within .15 of the diameter, after the rendered test "
      ".1).\n");
  for (const ClassFigures& figures : classes)
    for (const PartFigures& p : figures.parts) {
      std::printf("  %s %s (%d):", figures.name.c_str(), p.name.c_str(), p.to_find);
      for (const StageCount& stage : p.stages)
        std::printf(" %s %.3f;", stage.stage.c_str(), ratio(stage.alive, p.to_find));
      std::printf("\n");
    }
}

void print_times(const std::vector<ClassFigures>& classes) {
  std::printf(
      "\n| ms | p50 | p90 | p95 | p99 | max | first valid pose p50 | p90 | p95 | p99 | depth image p50 |\n"
      "|---|---|---|---|---|---|---|---|---|---|---|\n");
  ClassFigures together{"all", {}};
  for (const ClassFigures& figures : classes)
    together.parts.insert(together.parts.end(), figures.parts.begin(), figures.parts.end());
  std::vector<ClassFigures> rows = classes;
  rows.push_back(std::move(together));
  for (const ClassFigures& figures : rows) {
    const auto times = figures.all(&PartFigures::time_ms), firsts = figures.all(&PartFigures::first_ms);
    std::printf("| %s |", figures.name.c_str());
    for (const double q : {0.5, 0.9, 0.95, 0.99, 1.0}) std::printf(" %.0f |", quantile(times, q));
    for (const double q : {0.5, 0.9, 0.95, 0.99}) std::printf(" %.0f |", quantile(firsts, q));
    std::printf(" %.1f |\n", quantile(figures.all(&PartFigures::image_ms), 0.5));
  }
  std::printf("Mean ms of the stages:");
  for (const ClassFigures& figures : classes) {
    std::map<std::string, double> stages;
    for (const PartFigures& p : figures.parts)
      for (const auto& [stage, ms] : p.stages_ms) stages[stage] += ms / static_cast<double>(figures.parts.size());
    std::printf("\n  %s:", figures.name.c_str());
    for (const auto& [stage, ms] : stages) std::printf(" %s %.1f;", stage.c_str(), ms);
  }
  std::printf("\n");
}

void print_reliability(const std::vector<ClassFigures>& classes) {
  std::printf(
      "\n| | precision at score >= .5 | recall | calibration error | normalised error squared, median |\n"
      "|---|---|---|---|---|\n");
  std::vector<Believed> everywhere;
  for (const ClassFigures& figures : classes) {
    std::vector<Believed> believed;
    int right = 0, wrong = 0, to_find = 0;
    for (const PartFigures& p : figures.parts) {
      believed.insert(believed.end(), p.believed.begin(), p.believed.end());
      right += p.right_half, wrong += p.wrong_half, to_find += p.to_find;
    }
    everywhere.insert(everywhere.end(), believed.begin(), believed.end());
    std::printf("| %s | %.3f | %.3f | %.3f | %.2f |\n", figures.name.c_str(), ratio(right, right + wrong),
                ratio(right, to_find), calibration_error(believed),
                quantile(figures.all(&PartFigures::normalised_errors), 0.5));
  }
  std::printf("| all | | | %.3f | |\n", calibration_error(everywhere));
}

/// Another detector beside ours, on those scenes only that both saw.
void print_peer(const RunFolder& run, const std::string& detector) {
  const RunFolder common = seen_by_all(run, {"binpick", detector});
  if (common.scenes.empty()) return;
  const auto ours = collected(common, "binpick"), theirs = collected(common, detector);
  std::printf(
      "\n| %s beside binpick, the same %zu scenes | AP | binpick | 1 - AP, ratio | first right | binpick | ms p50 | "
      "binpick | times as fast |\n|---|---|---|---|---|---|---|---|---|\n",
      detector.c_str(), common.scenes.size() / 2);
  for (std::size_t c = 0; c < theirs.size(); ++c) {
    const double ap = ours[c].mean(&PartFigures::ap).value, their_ap = theirs[c].mean(&PartFigures::ap).value;
    const double ms = quantile(ours[c].all(&PartFigures::time_ms), 0.5),
                 their_ms = quantile(theirs[c].all(&PartFigures::time_ms), 0.5);
    std::printf("| %s | %.3f | %.3f | %.2f | %.3f | %.3f | %.0f | %.0f | %.0f |\n", theirs[c].name.c_str(), their_ap,
                ap, (1 - ap) / std::max(1e-9, 1 - their_ap), theirs[c].mean(&PartFigures::first_right).value,
                ours[c].mean(&PartFigures::first_right).value, their_ms, ms, their_ms / ms);
  }
}

void draw(const std::string& folder, const std::vector<ClassFigures>& classes) {
  std::printf("\n");
  std::vector<Series> reliability{{"as it should be", {{0, 0}, {1, 1}}, false, false, true}};
  for (const ClassFigures& figures : classes) {
    std::vector<Series> curves;
    std::vector<Believed> believed;
    for (const PartFigures& part : figures.parts) {
      Series& curve = curves.emplace_back(Series{part.name, {}, true, false, false});
      for (const MeanPoint& point : mean_curve(part.curves)) curve.points.push_back({point.recall, point.precision});
      believed.insert(believed.end(), part.believed.begin(), part.believed.end());
    }
    write_text(folder + "/precision-recall-" + figures.name + ".svg",
               line_chart("Precision and recall, " + figures.name, {"recall (mean over scenes)", 0, 1, 10},
                          {"precision (mean over scenes)", 0.5, 1, 5}, curves));
    Series& series = reliability.emplace_back(Series{figures.name, {}, false, true, false});
    for (const ScoreBin& bin : score_bins(believed))
      if (bin.count >= kBinMin) series.points.push_back({bin.score / bin.count, bin.right / bin.count});
  }
  write_text(folder + "/reliability.svg",
             line_chart("Is the score a probability? Bins of ten detections and more", {"score", 0, 1, 10},
                        {"share of right ones", 0, 1, 10}, reliability, 0.75));
}
}  // namespace

void print_table(const std::string& folder) {
  const RunFolder all = read_run(folder);
  RunFolder run;
  for (const char* split : {"report", "tune"})
    if (run.scenes.empty()) run = of_split(all, split);
  if (!all.header || run.scenes.empty())
    throw std::runtime_error{folder + ": holds no scene to report or to tune on; bench_scenes run --out " + folder +
                             " makes some"};
  const std::string& split = run.scenes.begin()->second.split;
  std::printf("%zu scenes to %s, %s. All of it is simulation.\n", run.scenes.size(),
              split == "tune" ? "tune on" : "report", to_json(*all.header).c_str());
  Evidence evidence;
  evidence.classes = collected(run, "binpick");
  const RunFolder peer = seen_by_all(run, {"binpick", "opencv"});
  evidence.peer = collected(peer, "opencv");
  evidence.beside_peer = collected(peer, "binpick");
  evidence.alarms = alarm_counts(all, "alarms-" + split);
  print_main(evidence.classes);
  print_parts(evidence.classes);
  print_stages(evidence.classes);
  print_times(evidence.classes);
  print_reliability(evidence.classes);
  print_peer(run, "opencv");
  print_peer(run, "thorough");
  print_alarms(all, "alarms-" + split);
  print_standings(standings(evidence));
  draw(folder, evidence.classes);
}
}  // namespace binpick::bench
