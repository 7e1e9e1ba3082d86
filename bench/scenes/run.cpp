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
#include "bench/scenes/opencv_peer.hpp"
#include "bench/scenes/scanners.hpp"
#include "bench/scenes/stage_recall.hpp"

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
        base_{knowledge_base_of(part_, (fs::path{options.bases.empty() ? options.out + "/bases" : options.bases} /
                                        (std::string{setting.name} + "-" + name + ".kb"))
                                           .string())} {}

  /// By each of the detectors; `done` gets their lines.
  template <class Done>
  void scene(const Split& split, std::size_t number, const std::vector<SceneLine>& wanted, const Done& done) {
    const SceneId id = split.scene(number);
    const auto begin = SteadyClock::now();
    const std::vector<ObjectPose> pile = taken_down(settled_pile(part_, id.pile, options_.piles), id.fill);
    const double settled_ms = ms_since(begin);
    const Scene scene = make_scene(part_, pile, id, options_.bias_mm);
    const double scanned_ms = ms_since(begin) - settled_ms;
    for (SceneLine line : wanted) {
      line.pile = id.pile;
      line.fill = id.fill;
      if (line.detector == kPeer) {
        if (!peer_) peer_ = std::make_unique<OpencvPeer>(part_, judge_);
        for (const Truth& t : scene.truths) line.truths.push_back({t.T_supply_object.iso, t.visible, t.told});
        peer_->detect(scene.points, line);
      } else {
        detect_scene(scene, judge_, base_, line.detector == kThorough ? options_.thorough() : options_.detector(),
                     line);
      }
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
  if (bias_mm != 0) header.options["bias_mm"] = std::to_string(bias_mm);
  for (const std::string& name : without) header.options["without"] += name + ';';
  return header;
}

vision::DetectorOptions RunOptions::detector() const {
  vision::DetectorOptions detector;
  detector.threads = threads;
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

Scene make_scene(const ScenePart& part, const std::vector<ObjectPose>& poses, const SceneId& id, double bias_mm) {
  const ClassSetting& setting = setting_of(part.scanner);
  emulators::World world{setting.supply_mm};
  const auto mesh = std::make_shared<const emulators::RayMesh>(part.body.mesh);
  for (const ObjectPose& pose : poses) world.add(part.body.name, mesh, pose);
  const std::vector<Profile> lines = sweep_lines(setting, id.noise);
  const auto ideal = ideal_sweep(setting, lines, world);
  return {id, truths_of(part, setting, lines, ideal, world),
          measured_points(setting, lines, ideal, world, {id.noise, bias_mm})};
}

vision::KnowledgeBase knowledge_base_of(const ScenePart& part, const std::string& file) {
  if (auto known = vision::KnowledgeBase::open(file)) return std::move(*known);
  vision::PartOptions options;
  options.name = part.body.name;
  options.scanner = part.scanner;
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

void detect_scene(const Scene& scene, const Judge& judge, const vision::KnowledgeBase& base,
                  vision::DetectorOptions options, SceneLine& line) {
  StageRecall recall{judge, scene.truths, base};
  options.observer = [&](const vision::StageSurvivors& alive) { recall(alive); };
  const auto begin = SteadyClock::now();
  const vision::SupplyBox supply{setting_of(base.scanner()).supply_mm};
  const vision::DepthWindow window = vision::window_of(supply);
  vision::DepthImageBuilder builder{base.pixel_mm(), window.min_mm, window.max_mm};
  builder.add(scene.points);
  const vision::DepthImage image = builder.image();
  line.image_ms = ms_since(begin);
  const vision::DetectionReport report = vision::detect(image, supply, base, options);

  line.time_ms = line.image_ms + report.time_ms;
  line.points = scene.points.size();
  line.maxima = report.maxima;
  line.hypotheses = report.hypotheses;
  line.stages_ms = report.stages_ms;
  line.alive = recall.nearest();
  for (const Truth& t : scene.truths) line.truths.push_back({t.T_supply_object.iso, t.visible, t.told});
  for (const vision::Detection& d : report.detections)
    line.detections.push_back({d.T_supply_object.iso, d.score, d.visible_fraction,
                               judge.nearest_mm(d.T_supply_object.iso, scene.truths), d.covariance});
  for (const vision::Rejection& r : report.rejected)
    line.rejected.push_back({r.T_supply_object.iso, r.score, r.reason});
  if (report.first)
    line.first = FirstLine{line.image_ms + report.first->time_ms, report.first->hypotheses,
                           judge.nearest_mm(report.first->T_supply_object.iso, scene.truths) < judge.threshold_mm()};
}

void run(const RunOptions& options, const RunSelection& selection) {
  const Split* split = find_split(selection.split);
  if (split == nullptr) throw std::runtime_error{"no split \"" + selection.split + "\"; there are tune and report"};
  if (options.peer_scenes > 0 && !OpencvPeer::built())
    throw std::runtime_error{"built without OpenCV's surface_matching; .ci/install bench, configure and build again"};
  const RunHeader header = options.header();
  const RunFolder before = read_run(options.out);
  if (before.header && *before.header != header)
    throw std::runtime_error{options.out + ": holds a run made as " + to_json(*before.header) + ", this one is " +
                             to_json(header) + "; use another folder"};
  fs::create_directories(options.out);
  const std::string file = options.out + "/" + split->name.data() + "-" + std::to_string(selection.shard) + "of" +
                           std::to_string(selection.shards) + ".jsonl";
  std::ofstream out{file, std::ios::app};
  out << '\n' << to_json(header) << '\n' << std::flush;
  for (const ClassSetting& setting : class_settings())
    for (const std::string& name : part_names(setting.scanner)) {
      if (!wanted(selection.classes, setting.name) || !wanted(selection.parts, name)) continue;
      std::optional<PartRun> part;  // trained when the first scene asks for it
      for (std::size_t number = selection.from; number < std::min(selection.to, split->scenes()); ++number) {
        if (number % selection.shards != selection.shard) continue;
        std::vector<SceneLine> missing;
        for (const auto& [detector, until] : {std::pair{"binpick", selection.to}, std::pair{kPeer, options.peer_scenes},
                                              std::pair{kThorough, options.thorough_scenes}}) {
          SceneLine line;
          line.detector = detector;
          line.scanner = setting.name;
          line.part = name;
          line.split = split->name;
          line.number = number;
          if (number < until && !before.scenes.contains(line.key())) missing.push_back(std::move(line));
        }
        if (missing.empty()) continue;
        if (!part) part.emplace(options, setting, name);
        part->scene(*split, number, missing, [&](const SceneLine& line) {
          out << to_json(line) << '\n' << std::flush;
          if (!out) throw std::runtime_error{file + ": cannot be written; check folder and free space"};
        });
      }
    }
}
}  // namespace binpick::bench
