#include "bench/scenes/table.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <numeric>
#include <stdexcept>

#include "bench/scenes/charts.hpp"
#include "bench/scenes/classes.hpp"
#include "bench/scenes/figures.hpp"

namespace binpick::bench {
namespace {
/// Fewer say nothing of a share.
constexpr double kBinMin = 10;

struct ClassFigures {
  std::string name;
  std::vector<PartFigures> parts;
};

std::string with_interval(const Estimate& estimate, const char* format) {
  const Interval interval = estimate.interval();
  std::array<char, 32> value{}, low{}, high{};
  std::snprintf(value.data(), value.size(), format, estimate.value);
  std::snprintf(low.data(), low.size(), format, interval.low);
  std::snprintf(high.data(), high.size(), format, interval.high);
  return std::string{value.data()} + " [" + low.data() + ", " + high.data() + "]";
}

template <class Of>
std::vector<double> all_of(const ClassFigures& figures, const Of& of) {
  std::vector<double> all;
  for (const PartFigures& part : figures.parts) all.insert(all.end(), (part.*of).begin(), (part.*of).end());
  return all;
}

double ratio(int part, int whole) { return whole > 0 ? static_cast<double>(part) / whole : 1; }

void print_row(const char* what, const std::vector<ClassFigures>& classes, Estimate PartFigures::*of,
               const char* format, bool large_is_good) {
  std::printf("| %s |", what);
  for (const ClassFigures& figures : classes) {
    std::vector<const Estimate*> parts;
    const PartFigures* worst = nullptr;
    for (const PartFigures& part : figures.parts) {
      parts.push_back(&(part.*of));
      if (worst == nullptr || ((part.*of).value < (worst->*of).value) == large_is_good) worst = &part;
    }
    std::printf(" %s; worst %s (%s) |", with_interval(mean_of(parts), format).c_str(),
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
  for (const ClassFigures& figures : classes) {
    const auto times = all_of(figures, &PartFigures::time_ms), firsts = all_of(figures, &PartFigures::first_ms);
    std::printf("| %s |", figures.name.c_str());
    for (const double q : {0.5, 0.9, 0.95, 0.99, 1.0}) std::printf(" %.0f |", quantile(times, q));
    for (const double q : {0.5, 0.9, 0.95, 0.99}) std::printf(" %.0f |", quantile(firsts, q));
    std::printf(" %.1f |\n", quantile(all_of(figures, &PartFigures::image_ms), 0.5));
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
                quantile(all_of(figures, &PartFigures::normalised_errors), 0.5));
  }
  std::printf("| all | | | %.3f | |\n", calibration_error(everywhere));
}

std::vector<ClassFigures> collected(const RunFolder& run, const std::string& detector) {
  std::vector<ClassFigures> classes;
  std::uint64_t stream = 0;
  for (const ClassSetting& setting : class_settings()) {
    ClassFigures figures{std::string{setting.name}, {}};
    for (const std::string& name : part_names(setting.scanner)) {
      std::vector<const SceneLine*> scenes;
      for (const auto& [key, scene] : run.scenes)
        if (scene.detector == detector && scene.scanner == setting.name && scene.part == name) scenes.push_back(&scene);
      if (!scenes.empty())
        figures.parts.push_back(figures_of_part(scene_part(setting.scanner, name), scenes, ++stream));
    }
    if (!figures.parts.empty()) classes.push_back(std::move(figures));
  }
  return classes;
}
/// Another detector beside ours, on those scenes only that both saw.
void print_peer(const RunFolder& run, const std::string& detector) {
  RunFolder common;
  for (const auto& [key, scene] : run.scenes) {
    if (scene.detector != detector) continue;
    SceneLine ours = scene;
    ours.detector = "binpick";
    const auto it = run.scenes.find(ours.key());
    if (it == run.scenes.end()) continue;
    common.scenes[key] = scene;
    common.scenes[ours.key()] = it->second;
  }
  if (common.scenes.empty()) return;
  const auto ours = collected(common, "binpick"), theirs = collected(common, detector);
  std::printf(
      "\n| %s beside binpick, the same %zu scenes | AP | binpick | 1 - AP, ratio | first right | binpick | ms p50 | "
      "binpick | times as fast |\n|---|---|---|---|---|---|---|---|---|\n",
      detector.c_str(), common.scenes.size() / 2);
  for (std::size_t c = 0; c < theirs.size(); ++c) {
    const auto mean = [](const ClassFigures& figures, Estimate PartFigures::*of) {
      double sum = 0;
      for (const PartFigures& part : figures.parts) sum += (part.*of).value;
      return sum / static_cast<double>(figures.parts.size());
    };
    const double ap = mean(ours[c], &PartFigures::ap), their_ap = mean(theirs[c], &PartFigures::ap);
    const double ms = quantile(all_of(ours[c], &PartFigures::time_ms), 0.5),
                 their_ms = quantile(all_of(theirs[c], &PartFigures::time_ms), 0.5);
    std::printf("| %s | %.3f | %.3f | %.2f | %.3f | %.3f | %.0f | %.0f | %.0f |\n", theirs[c].name.c_str(), their_ap,
                ap, (1 - ap) / std::max(1e-9, 1 - their_ap), mean(theirs[c], &PartFigures::first_right),
                mean(ours[c], &PartFigures::first_right), their_ms, ms, their_ms / ms);
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
  const RunFolder run = read_run(folder);
  if (!run.header || run.scenes.empty())
    throw std::runtime_error{folder + ": holds no scene; bench_scenes run --out " + folder + " makes some"};
  std::printf("%zu scenes, %s. All of it is simulation.\n", run.scenes.size(), to_json(*run.header).c_str());
  const std::vector<ClassFigures> classes = collected(run, "binpick");
  print_main(classes);
  print_parts(classes);
  print_stages(classes);
  print_times(classes);
  print_reliability(classes);
  print_peer(run, "opencv");
  print_peer(run, "thorough");
  draw(folder, classes);
}
}  // namespace binpick::bench
