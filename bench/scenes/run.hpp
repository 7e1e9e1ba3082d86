#pragma once

#include <limits>
#include <memory>
#include <string>
#include <vector>

#include "bench/scenes/classes.hpp"
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
  double sparse = 1;  ///< Points farther apart than the class's, by this factor.
  std::vector<std::string> without;
  std::size_t peer_scenes = 0;  ///< So many of a part's first scenes are shown to OpenCV's surface_matching as well,
  std::size_t thorough_scenes = 0;  ///< and so many to our own search with all that it can try.
  bool pictures = false;            ///< What was found in each scene is drawn into `out`/pictures.
  bool loops_in_names = false;      ///< Lines say which inner loops they were made with: runs of several may mix.
  RunHeader header() const;
  std::string base_file(const ScenePart& part) const;
  std::string picture_folder() const;  ///< Empty: none.
  vision::DetectorOptions detector() const;
  vision::DetectorOptions thorough() const;
};

/// A scene as a detector gets it, with what is true of it.
struct Scene {
  SceneId id;
  Eigen::Vector3d supply_mm;
  std::vector<Truth> truths;
  std::vector<Eigen::Vector3f> points;
};
Scene make_scene(const ScenePart& part, const std::vector<ObjectPose>& poses, const SceneId& id, double bias_mm,
                 double sparse = 1);

/// Trained for the class, or read from `file` where it is.
vision::KnowledgeBase knowledge_base_of(const ScenePart& part, const std::string& file,
                                        vision::Picking picking = vision::Picking::Bin);

vision::DepthImage depth_image_of(const std::vector<Eigen::Vector3f>& points, const vision::KnowledgeBase& base,
                                  const vision::SupplyBox& supply);

/// Detects once and writes down what came out; `line` has its names already. Drawn into the folder `pictures`, if any.
void detect_scene(const Scene& scene, const Judge& judge, const vision::KnowledgeBase& base,
                  vision::DetectorOptions options, SceneLine& line, const std::string& pictures = {});

struct RunSelection {
  std::vector<std::string> classes, parts;  ///< Empty: all.
  std::string split = "tune";
  std::size_t from = 0, to = 1'000'000;  ///< Scenes of the split.
  std::size_t shard = 0, shards = 1;
};
/// Those of a class that are selected; the deep supply only where it is named.
std::vector<std::string> selected_parts(const ClassSetting& setting, const RunSelection& selection);
/// One way of looking at the scenes; its lines bear its name.
struct Contender {
  std::string name;
  vision::DetectorOptions options;
  std::size_t scenes = std::numeric_limits<std::size_t>::max();  ///< Of a part's first ones.
  bool memory = false;  ///< On a part's first scene: what does it take? See memory.hpp.
};
/// Each scene is made once and seen by all contenders that have not seen it yet. Prints a line for each.
void run(const RunOptions& options, const RunSelection& selection, const std::vector<Contender>& contenders);
/// Ours, and those that the options name beside it.
void run(const RunOptions& options, const RunSelection& selection);
}  // namespace binpick::bench
