#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <fstream>
#include <memory>
#include <nlohmann/json.hpp>
#include <numbers>

#include "base/rotation.hpp"
#include "tools/commands.hpp"
#include "tools/output.hpp"
#include "tools/report_json.hpp"
#include "vision/cloud.hpp"
#include "vision/detector.hpp"
#include "vision/draw.hpp"

namespace binpick::tools {
namespace {
struct DetectArguments {
  std::string part, scene, json, image;
  int max = 0, repeat = 1, threads = 2;
  std::vector<double> supply_mm;  ///< Three numbers; empty: unknown.
  bool votes = false;
  int deadline_ms = 0;
};

void print_table(const vision::DetectionReport& report) {
  if (report.detections.empty()) {
    std::printf("nothing found\n");
  } else {
    std::printf("  #  score  seen    x mm    y mm    z mm   W deg   P deg   R deg  sd mm  sd deg\n");
    for (std::size_t k = 0; k < report.detections.size(); ++k) {
      const vision::Detection& d = report.detections[k];
      const Eigen::Vector3d t = d.T_supply_object.iso.translation();
      const Eigen::Vector3d wpr = to_wpr_deg(d.T_supply_object.iso.linear());
      const double sd_mm = std::sqrt(d.covariance.topLeftCorner<3, 3>().trace() / 3);
      const double sd_deg = std::sqrt(d.covariance.bottomRightCorner<3, 3>().trace() / 3) * 180 / std::numbers::pi;
      std::printf("%3zu  %5.3f  %3.0f%% %7.1f %7.1f %7.1f %7.1f %7.1f %7.1f %6.2f %7.2f\n", k + 1, d.score,
                  100 * d.visible_fraction, t.x(), t.y(), t.z(), wpr.x(), wpr.y(), wpr.z(), sd_mm, sd_deg);
    }
  }
  for (const vision::Rejection& r : report.rejected) {
    const Eigen::Vector3d t = r.T_supply_object.iso.translation();
    std::printf("  rejected at %.0f %.0f %.0f: %s\n", t.x(), t.y(), t.z(), r.reason.c_str());
  }
  std::printf("%zu maxima, %zu hypotheses, %.1f ms (", report.maxima, report.hypotheses, report.time_ms);
  const char* separator = "";
  for (const auto& [stage, ms] : report.stages_ms) {
    std::printf("%s%s %.1f", separator, stage.c_str(), ms);
    separator = ", ";
  }
  std::printf(")\n");
}

/// A cloud far smaller than the part is in metres, most often; "nothing found" alone would not say so.
void print_size_doubt(const vision::DepthWindow& window, double diameter_mm) {
  const Eigen::Vector2d size_mm = window.max_mm - window.min_mm;
  if (size_mm.maxCoeff() < diameter_mm / 4)
    std::printf("the cloud measures %.3g x %.3g mm, the part %.0f mm: is the cloud in millimetres?\n", size_mm.x(),
                size_mm.y(), diameter_mm);
}

int complain(int status, const std::string& text) {
  std::fprintf(stderr, "binpick detect: %s\n", text.c_str());
  return status;
}

int run(const DetectArguments& arguments) {
  const auto part = vision::KnowledgeBase::open(arguments.part);
  if (!part) return complain(2, part.error().text);
  if (const auto whole = part->verify(); !whole) return complain(2, whole.error().text);
  const auto points = vision::load_cloud(arguments.scene);
  if (!points) return complain(2, points.error().text);
  for (const std::string& path : {arguments.image, arguments.json == "-" ? std::string{} : arguments.json})
    if (const auto trouble = path.empty() ? path : cannot_be_written(path); !trouble.empty())
      return complain(1, trouble);

  vision::DetectorOptions options;
  options.threads = arguments.threads;
  options.search = arguments.votes ? vision::Search::Votes : vision::Search::Exhaustive;
  options.detections_max = arguments.max;
  if (arguments.deadline_ms > 0) options.deadline = std::chrono::milliseconds{arguments.deadline_ms};

  vision::SupplyBox supply;
  if (!arguments.supply_mm.empty())
    supply.size_mm = {arguments.supply_mm[0], arguments.supply_mm[1], arguments.supply_mm[2]};
  vision::DetectionReport report;
  vision::DepthImage image;
  std::vector<double> times_ms;
  for (int k = 0; k < arguments.repeat; ++k) {
    const auto start = std::chrono::steady_clock::now();
    const vision::DepthWindow window = supply.size_mm.x() > 0 ? vision::window_of(supply) : vision::window_of(*points);
    vision::DepthImageBuilder builder{part->pixel_mm(), window.min_mm, window.max_mm};
    builder.add(*points);
    image = builder.image();
    const double image_ms = std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count();
    report = vision::detect(image, supply, *part, options);
    report.stages_ms["depth image"] = image_ms;
    report.time_ms += image_ms;
    times_ms.push_back(report.time_ms);
  }

  if (!arguments.image.empty())
    if (const auto drawn = vision::draw_report(arguments.image, image, *part, report); !drawn)
      return complain(1, drawn.error());
  const std::string json = to_json(part->part_name(), report).dump(2);
  if (arguments.json == "-") {
    std::printf("%s\n", json.c_str());
    return 0;
  }
  if (!arguments.json.empty()) {
    std::ofstream out{arguments.json};
    out << json << '\n';
    if (!out.flush())
      return complain(1, arguments.json + ": cannot be written; check that the folder exists and has room");
  }
  print_table(report);
  if (report.detections.empty()) print_size_doubt(vision::window_of(*points), part->diameter_mm());
  if (arguments.repeat > 1) {
    std::sort(times_ms.begin(), times_ms.end());
    std::printf("%d runs: median %.1f ms, best %.1f ms, worst %.1f ms\n", arguments.repeat,
                times_ms[times_ms.size() / 2], times_ms.front(), times_ms.back());
  }
  return 0;
}
}  // namespace

void add_detect(CLI::App& app, int& exit_status) {
  auto arguments = std::make_shared<DetectArguments>();
  CLI::App* command = app.add_subcommand("detect", "Finds the objects of a trained part in a point cloud.");
  command->add_option("PART.kb", arguments->part, "the knowledge base, made by binpick train")->required();
  command->add_option("SCENE.ply", arguments->scene, "the cloud: PLY, millimetres, in the supply's frame (z up)")
      ->required();
  command
      ->add_option("--supply-mm", arguments->supply_mm,
                   "X Y Z: the supply's inner size, its frame in the middle of the floor; then nothing reaches through "
                   "its walls, and what lies in it counts, as in the daemon (default: unknown)")
      ->expected(3)
      ->check(CLI::Range(1.0, 100'000.0));
  command->add_option("--json", arguments->json,
                      "write the whole report to this file; -: to stdout, without the table");
  command->add_option("--image", arguments->image, "write the depth image with the detections drawn over it (PNG)");
  command->add_option("--max", arguments->max, "report at most so many detections (default: all)")
      ->check(CLI::Range(1, 1'000'000));
  command->add_option("--repeat", arguments->repeat, "detect so many times and say how long it took")
      ->check(CLI::Range(1, 100'000));
  command->add_option("--threads", arguments->threads, "threads; the result does not depend on it (default: 2)")
      ->check(CLI::Range(1, 64));
  command->add_flag("--votes", arguments->votes,
                    "try what the features vote for only, not every view at every maximum");
  command->add_option("--deadline-ms", arguments->deadline_ms, "answer the best found until then")
      ->check(CLI::Range(1, 3'600'000));
  command->callback([arguments, &exit_status] { exit_status = run(*arguments); });
}
}  // namespace binpick::tools
