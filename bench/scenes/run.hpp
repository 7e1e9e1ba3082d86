#pragma once

#include <memory>
#include <string>
#include <vector>

#include "bench/scenes/judge.hpp"
#include "bench/scenes/lines.hpp"
#include "bench/scenes/piles.hpp"

namespace binpick::bench {
/// What makes a run; everything that changes its result stands in its header.
struct RunOptions {
  std::string out;
  std::string piles = "build/scenes/piles";
  std::string bases;  ///< Folder of knowledge bases; empty: `out`/bases.
  int threads = 2;
  int hypotheses_max = 0;  ///< 0: the detector's default.
  double bias_mm = 0;
  std::vector<std::string> without;
  std::size_t peer_scenes = 0;  ///< So many of a part's first scenes are shown to OpenCV's surface_matching as well,
  std::size_t thorough_scenes = 0;  ///< and so many to our own search with all that it can try.
  RunHeader header() const;
  vision::DetectorOptions detector() const;
  vision::DetectorOptions thorough() const;
};

/// A scene as a detector gets it, with what is true of it.
struct Scene {
  SceneId id;
  std::vector<Truth> truths;
  std::vector<Eigen::Vector3f> points;
};
Scene make_scene(const ScenePart& part, const std::vector<ObjectPose>& poses, const SceneId& id, double bias_mm);

/// Trained for the class, or read from `file` where it is.
vision::KnowledgeBase knowledge_base_of(const ScenePart& part, const std::string& file);

/// Detects once and writes down what came out; `line` has its names already.
void detect_scene(const Scene& scene, const Judge& judge, const vision::KnowledgeBase& base,
                  vision::DetectorOptions options, SceneLine& line);

struct RunSelection {
  std::vector<std::string> classes, parts;  ///< Empty: all.
  std::string split = "tune";
  std::size_t from = 0, to = 1'000'000;  ///< Scenes of the split.
  std::size_t shard = 0, shards = 1;
};
/// Runs what the folder has not yet. Prints one line for each scene.
void run(const RunOptions& options, const RunSelection& selection);
}  // namespace binpick::bench
