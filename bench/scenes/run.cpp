#include "bench/scenes/run.hpp"

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <memory>
#include <random>
#include <stdexcept>

#include "bench/scenes/classes.hpp"
#include "bench/scenes/commit.hpp"
#include "bench/scenes/memory.hpp"
#include "bench/scenes/opencv_peer.hpp"
#include "bench/scenes/run_file.hpp"
#include "bench/scenes/scanners.hpp"
#include "bench/scenes/stage_recall.hpp"
#include "vision/draw.hpp"
#include "vision/kernels.hpp"

namespace binpick::bench {
namespace {
namespace fs = std::filesystem;
using SteadyClock = std::chrono::steady_clock;

constexpr const char* kPeer = "opencv";
constexpr const char* kThorough = "thorough";
constexpr double kThoroughEffort = 8;

double ms_since(SteadyClock::time_point from) {
  return std::chrono::duration<double, std::milli>(SteadyClock::now() - from).count();
}

/// One part in one class: what its scenes share.
class PartRun {
 public:
  PartRun(const RunOptions& options, const ClassSetting& setting, const std::string& name)
      : options_{options},
        part_{scene_part(setting.scanner, name)},
        judge_{part_},
        base_file_{options.base_file(part_)},
        base_{knowledge_base_of(part_, base_file_)} {}

  /// By each of the contenders; `done` gets their lines.
  template <class Done>
  void scene(const Split& split, std::size_t number, const std::vector<std::pair<SceneLine, const Contender*>>& wanted,
             const Done& done) {
    const SceneId id = split.scene(number);
    const auto begin = SteadyClock::now();
    const std::vector<ObjectPose> pile = taken_down(settled_pile(part_, id.pile, options_.piles), id.fill);
    const double settled_ms = ms_since(begin);
    const Scene scene = make_scene(part_, pile, id, options_.bias_mm, options_.sparse);
    const double scanned_ms = ms_since(begin) - settled_ms;
    for (auto [line, contender] : wanted) {
      line.pile = id.pile;
      line.fill = id.fill;
      if (line.detector == kPeer) {
        if (!peer_) peer_ = std::make_unique<OpencvPeer>(part_, judge_);
        for (const Truth& t : scene.truths) line.truths.push_back({t.T_supply_object.iso, t.visible, t.told});
        peer_->detect(scene.points, line);
      } else {
        detect_scene(scene, judge_, base_, contender->options, line, options_.picture_folder());
      }
      if (contender->memory && number == 0)
        line.memory_mib = memory_mib(scene, base_file_, contender->options, options_.out);
      const Match m = match(judge_.judged(line), 0);
      std::printf("%s: %zu objects, %d to find, %d right, %d wrong; %.0f ms (pile %.1f s, scan %.2f s)\n",
                  line.key().c_str(), line.truths.size(), m.to_find, m.right, m.wrong, line.time_ms, settled_ms / 1000,
                  scanned_ms / 1000);
      std::fflush(stdout);
      done(line);
    }
  }

 private:
  const RunOptions& options_;
  ScenePart part_;
  Judge judge_;
  std::string base_file_;
  vision::KnowledgeBase base_;
  std::unique_ptr<OpencvPeer> peer_;  // trained when its first scene comes
};

bool wanted(const std::vector<std::string>& names, std::string_view name) {
  return names.empty() || std::ranges::find(names, name) != names.end();
}
}  // namespace

RunHeader RunOptions::header() const {
  RunHeader header;
  header.commit = kCommit;
  header.options["threads"] = std::to_string(threads);
  if (hypotheses_max > 0) header.options["hypotheses"] = std::to_string(hypotheses_max);
  if (sparse != 1) header.options["sparse"] = std::to_string(sparse);
  if (bias_mm != 0) header.options["bias_mm"] = std::to_string(bias_mm);
  for (const std::string& name : without) header.options["without"] += name + ';';
  const std::string loops = vision::kernels::table().name;
  if (loops == vision::kernels::portable().name && !loops_in_names) header.options["loops"] = loops;
  return header;
}

std::string RunOptions::base_file(const ScenePart& part) const {
  return (bases.empty() ? out + "/bases" : bases) + "/" + setting_of(part).name.data() + "-" + part.body.name + ".kb";
}

std::string RunOptions::picture_folder() const { return pictures ? out + "/pictures" : std::string{}; }

vision::DetectorOptions RunOptions::detector() const {
  vision::DetectorOptions detector;
  detector.threads = threads;
  detector.rejections_max = 60;
  if (hypotheses_max > 0) detector.hypotheses_max = hypotheses_max;
  detector.without = {without.begin(), without.end()};
  return detector;
}

vision::DetectorOptions RunOptions::thorough() const {
  vision::DetectorOptions thorough = detector();
  thorough.hypotheses_max = 1 << 20;
  thorough.effort = kThoroughEffort;
  return thorough;
}

Scene make_scene(const ScenePart& part, const std::vector<ObjectPose>& poses, const SceneId& id, double bias_mm,
                 double sparse) {
  const ClassSetting setting = setting_of(part);
  emulators::World world{setting.supply_mm};
  const auto mesh = std::make_shared<const emulators::RayMesh>(part.body.mesh);
  for (const ObjectPose& pose : poses) world.add(part.body.name, mesh, pose);
  const std::vector<Profile> lines = sweep_lines(setting, id.noise, sparse);
  const auto ideal = ideal_sweep(setting, lines, world);
  return {id, setting.supply_mm, truths_of(part, setting, lines, ideal, world),
          measured_points(setting, lines, ideal, world, {id.noise, bias_mm})};
}

vision::KnowledgeBase knowledge_base_of(const ScenePart& part, const std::string& file, vision::Picking picking) {
  if (auto known = vision::KnowledgeBase::open(file)) return std::move(*known);
  vision::PartOptions options;
  options.name = part.body.name;
  options.scanner = part.scanner;
  options.picking = picking;
  vision::TrainingSummary summary;
  auto trained = vision::train(part.body.mesh, options, {}, &summary);
  if (!trained) throw std::runtime_error{trained.error().text};
  std::printf("trained %s: symmetry %s, %d rotations, %.1f MiB, %.1f s\n", file.c_str(),
              to_string(summary.symmetry).c_str(), summary.rotations, summary.mib, summary.seconds);
  fs::create_directories(fs::path{file}.parent_path());
  // Under another name first: shards beside this one read the same folder.
  const std::string unfinished = file + "." + std::to_string(std::random_device{}());
  if (const auto saved = trained->save(unfinished); !saved) throw std::runtime_error{saved.error().text};
  fs::rename(unfinished, file);
  return std::move(*trained);
}

vision::DepthImage depth_image_of(const std::vector<Eigen::Vector3f>& points, const vision::KnowledgeBase& base,
                                  const vision::SupplyBox& supply) {
  const vision::DepthWindow window = vision::window_of(supply);
  vision::DepthImageBuilder builder{base.pixel_mm(), window.min_mm, window.max_mm};
  builder.add(points);
  return builder.image();
}

void detect_scene(const Scene& scene, const Judge& judge, const vision::KnowledgeBase& base,
                  vision::DetectorOptions options, SceneLine& line, const std::string& pictures) {
  StageRecall recall{judge, scene.truths, base};
  options.observer = [&](const vision::StageSurvivors& alive) { recall(alive); };
  const auto begin = SteadyClock::now();
  const vision::SupplyBox supply{scene.supply_mm};
  const vision::DepthImage image = depth_image_of(scene.points, base, supply);
  line.image_ms = ms_since(begin);
  const vision::DetectionReport report = vision::detect(image, supply, base, options);

  if (!pictures.empty()) {
    fs::create_directories(pictures);
    std::string name = line.key();
    std::ranges::replace(name, ' ', '-');
    if (const auto drawn = vision::draw_report(pictures + "/" + name + ".png", image, base, report); !drawn)
      throw std::runtime_error{drawn.error()};
  }
  line.time_ms = line.image_ms + report.time_ms;
  line.points = scene.points.size();
  line.maxima = report.maxima;
  line.hypotheses = report.hypotheses;
  line.stages_ms = report.stages_ms;
  line.alive = recall.nearest();
  for (const Truth& t : scene.truths) line.truths.push_back({t.T_supply_object.iso, t.visible, t.told});
  for (const vision::Detection& d : report.detections)
    line.detections.push_back({d.T_supply_object.iso, d.score, d.visible_fraction,
                               judge.nearest_mm(d.T_supply_object.iso, scene.truths), d.covariance, d.evidence});
  for (const vision::Rejection& r : report.rejected)
    line.rejected.push_back(
        {r.T_supply_object.iso, r.score, judge.nearest_mm(r.T_supply_object.iso, scene.truths), r.evidence, r.reason});
  if (report.first)
    line.first = FirstLine{line.image_ms + report.first->time_ms, report.first->hypotheses,
                           judge.nearest_mm(report.first->T_supply_object.iso, scene.truths) < judge.threshold_mm()};
}

std::vector<std::string> selected_parts(const ClassSetting& setting, const RunSelection& selection) {
  if (!wanted(selection.classes, setting.name)) return {};
  std::vector<std::string> names = part_names(setting.scanner);
  if (setting.scanner == vision::ScannerClass::Lms400 && !selection.parts.empty()) names.emplace_back(kDeepPart);
  std::erase_if(names, [&](const std::string& name) { return !wanted(selection.parts, name); });
  return names;
}

void run(const RunOptions& options, const RunSelection& selection, const std::vector<Contender>& contenders) {
  const Split& split = split_named(selection.split);
  RunFile file{options.out, options.header(), shard_name(selection.split, selection.shard, selection.shards)};
  for (const ClassSetting& setting : class_settings()) {
    for (const std::string& name : selected_parts(setting, selection)) {
      std::optional<PartRun> part;  // trained when the first scene asks for it
      for (std::size_t number = selection.from; number < std::min(selection.to, split.scenes()); ++number) {
        if (number % selection.shards != selection.shard) continue;
        std::vector<std::pair<SceneLine, const Contender*>> missing;
        for (const Contender& contender : contenders) {
          SceneLine line;
          line.detector = contender.name;
          line.scanner = setting.name;
          line.part = name;
          line.split = split.name;
          line.number = number;
          if (number < contender.scenes && !file.has(line)) missing.emplace_back(std::move(line), &contender);
        }
        if (missing.empty()) continue;
        // Who comes first finds cold caches: each has its turn.
        std::ranges::rotate(missing, missing.begin() + static_cast<std::ptrdiff_t>(number % missing.size()));
        if (!part) part.emplace(options, setting, name);
        part->scene(split, number, missing, [&](const SceneLine& line) { file.write(line); });
      }
    }
  }
}

void run(const RunOptions& options, const RunSelection& selection) {
  if (options.peer_scenes > 0 && !OpencvPeer::built())
    throw std::runtime_error{"built without OpenCV's surface_matching; .ci/install bench, configure and build again"};
  run(options, selection,
      {{"binpick", options.detector()},
       {kPeer, {}, options.peer_scenes},
       {kThorough, options.thorough(), options.thorough_scenes}});
}
}  // namespace binpick::bench
