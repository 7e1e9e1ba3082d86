#include "bench/scenes/conveyor.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <numbers>
#include <random>

#include "base/check.hpp"
#include "bench/scenes/comparison.hpp"
#include "bench/scenes/precision.hpp"
#include "bench/scenes/run_file.hpp"
#include "vision/resting.hpp"

namespace binpick::bench {
namespace {
namespace fs = std::filesystem;
constexpr const char* kSplit = "conveyor";
constexpr std::uint64_t kFirstSeed = 7'001'000;
/// Objects lie in cells of this many diameters, at least a tenth of one from each other.
constexpr double kCellDiameters = 1.3, kPartDiameters = 1.1;
constexpr double kEdgeMm = 1;  ///< A belt has no walls.

ScenePart on_belt(ScenePart part) {
  const Eigen::Vector3d bin = setting_of(part).supply_mm;
  part.supply_mm = Eigen::Vector3d{bin.x(), bin.y(), kEdgeMm};
  return part;
}

/// One object in each cell, resting and turned at random.
std::vector<ObjectPose> lying_about(const ScenePart& part, const std::vector<vision::RestingPose>& resting,
                                    std::uint64_t seed) {
  const vision::Mesh& mesh = part.body.mesh;
  const double diameter = mesh.diameter_mm();
  std::mt19937_64 random{seed};
  const auto even = [&](double low, double high) { return std::uniform_real_distribution{low, high}(random); };
  const Eigen::Array2d size = part.supply_mm->head<2>().array();
  const Eigen::Array2d cells = (size / (kCellDiameters * diameter)).floor().max(1.0), cell = size / cells;
  const Eigen::Array2d room = (0.5 * (cell - kPartDiameters * diameter)).max(0.0);
  std::vector<ObjectPose> poses;
  for (double row = 0; row < cells.y(); ++row)
    for (double col = 0; col < cells.x(); ++col) {
      const vision::RestingPose& pose = resting[random() % resting.size()];
      ObjectPose T;
      T.iso.linear() = (Eigen::AngleAxisd(even(0, 2 * std::numbers::pi), Eigen::Vector3d::UnitZ()) *
                        Eigen::Quaterniond::FromTwoVectors(pose.down, -Eigen::Vector3d::UnitZ()))
                           .toRotationMatrix();
      Eigen::AlignedBox3d box;
      for (const Eigen::Vector3f& v : mesh.vertices_mm) box.extend(T.iso.linear() * v.cast<double>());
      const Eigen::Array2d middle = -0.5 * size + cell * Eigen::Array2d{col + 0.5, row + 0.5};
      T.iso.translation() << middle.x() + even(-room.x(), room.x()) - box.center().x(),
          middle.y() + even(-room.y(), room.y()) - box.center().y(), -box.min().z();
      poses.push_back(T);
    }
  return poses;
}

double mib_of(const std::string& file) { return static_cast<double>(fs::file_size(file)) / (1 << 20); }

double opening_ms(const std::string& file) {
  std::vector<double> ms;
  for (int i = 0; i < 9; ++i) {
    const auto begin = std::chrono::steady_clock::now();
    const auto base = vision::KnowledgeBase::open(file);
    ms.push_back(std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - begin).count());
    BINPICK_CHECK(base.has_value());
  }
  return quantile(ms, 0.5);
}

struct Row {
  std::string name;
  double bin_mib = 0, belt_mib = 0, bin_ms = 0, belt_ms = 0;
};

void print_rows(const std::vector<Row>& rows, const RunFolder& run) {
  std::printf(
      "\nObjects that lie by themselves on a belt, %s. All of it is simulation. Recall and wrong ones at score .5.\n"
      "| | scenes | found / to find | recall | wrong | ms p50 | knowledge base, bin: MiB, opened in ms | belt: MiB, "
      "opened in ms | belt / bin |\n|---|---|---|---|---|---|---|---|---|\n",
      to_json(*run.header).c_str());
  int right = 0, to_find = 0;
  for (const ClassFigures& figures : collected(run, "binpick"))
    for (const PartFigures& part : figures.parts) {
      const auto row = std::ranges::find(rows, figures.name + ' ' + part.name, &Row::name);
      if (row == rows.end()) continue;
      right += part.right_half;
      to_find += part.to_find;
      std::printf("| %s | %zu | %d / %d | %.3f | %d | %.0f | %.1f, %.1f | %.1f, %.1f | %.2f |\n", row->name.c_str(),
                  part.scenes, part.right_half, part.to_find,
                  static_cast<double>(part.right_half) / std::max(1, part.to_find), part.wrong_half,
                  quantile(part.time_ms, 0.5), row->bin_mib, row->bin_ms, row->belt_mib, row->belt_ms,
                  row->belt_mib / row->bin_mib);
    }
  std::printf("| all | %zu | %d / %d | %.4f | | | | | |\n", run.scenes.size(), right, to_find,
              static_cast<double>(right) / std::max(1, to_find));
}
}  // namespace

void conveyor(const RunOptions& options, const RunSelection& selection, std::size_t scenes) {
  constexpr double kBarrierDiameters = 0.01, kStepRad = 4 * std::numbers::pi / 180;
  RunFile file{options.out, options.header(), shard_name(kSplit, selection.shard, selection.shards)};
  std::vector<Row> rows;
  for (const ClassSetting& setting : class_settings())
    for (const std::string& name : selected_parts(setting, selection)) {
      if (name == kDeepPart) continue;  // a supply of its own
      const ScenePart part = on_belt(scene_part(setting.scanner, name));
      const std::string bin_file = options.base_file(part);
      const std::string belt_file = fs::path{bin_file}.replace_extension("belt.kb").string();
      knowledge_base_of(part, bin_file);
      const vision::KnowledgeBase base = knowledge_base_of(part, belt_file, vision::Picking::Conveyor);
      rows.push_back({std::string{setting.name} + ' ' + name, mib_of(bin_file), mib_of(belt_file), opening_ms(bin_file),
                      opening_ms(belt_file)});
      const auto resting =
          vision::resting_poses(base.mesh(), base.symmetry(), kBarrierDiameters * base.diameter_mm(), kStepRad);
      const Judge judge{part};
      for (std::size_t number = selection.shard; number < scenes; number += selection.shards) {
        SceneLine line;
        line.scanner = setting.name;
        line.part = name;
        line.split = kSplit;
        line.number = line.pile = number;
        if (file.has(line)) continue;
        const std::uint64_t seed = kFirstSeed + number;
        const Scene scene =
            make_scene(part, lying_about(part, resting, seed), {number, 1, seed}, options.bias_mm, options.sparse);
        detect_scene(scene, judge, base, options.detector(), line, options.picture_folder());
        std::printf("%s: %zu objects, %zu detections\n", line.key().c_str(), line.truths.size(),
                    line.detections.size());
        std::fflush(stdout);
        file.write(line);
      }
    }
  print_rows(rows, of_split(read_run(options.out), kSplit));
}
}  // namespace binpick::bench
