#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "vision/detector.hpp"

/// What a run writes down: one JSON line for each scene, after one line that says how the run was made.
namespace binpick::bench {
struct TruthLine {
  Eigen::Isometry3d T_supply_object = Eigen::Isometry3d::Identity();
  double visible = 0;
  bool told = true;
};
struct DetectionLine {
  Eigen::Isometry3d T_supply_object = Eigen::Isometry3d::Identity();
  double score = 0;
  double visible = 0;
  double nearest_mm = 0;  ///< To the nearest truth; for readers of the file.
  vision::Matrix6 covariance = vision::Matrix6::Zero();
  vision::Evidence evidence;
};
struct RejectionLine {
  Eigen::Isometry3d T_supply_object = Eigen::Isometry3d::Identity();
  double score = 0;
  double nearest_mm = 0;
  vision::Evidence evidence;
  std::string reason;
};
struct FirstLine {
  double time_ms = 0;  ///< From points in memory.
  std::uint64_t hypotheses = 0;
  bool right = false;  ///< Nearer to a truth than the threshold.
};

struct SceneLine {
  std::string detector = "binpick";
  std::string scanner, part, split;
  std::uint64_t number = 0;  ///< In its split.
  std::uint64_t pile = 0;
  double fill = 0;
  std::vector<TruthLine> truths;
  std::vector<DetectionLine> detections;
  std::vector<RejectionLine> rejected;
  std::uint64_t points = 0, maxima = 0, hypotheses = 0;
  double time_ms = 0;   ///< From points in memory to the whole list.
  double image_ms = 0;  ///< Of it, points to depth image.
  std::map<std::string, double> stages_ms;
  std::optional<FirstLine> first;
  std::map<std::string, double> memory_mib;  ///< Where it was measured: see memory.hpp.
  /// For each stage, in order, and truth: distance of the nearest pose still alive, in part diameters; 9 where none is
  /// near.
  std::vector<std::pair<std::string, std::vector<double>>> alive;

  std::string key() const;  ///< Tells it from all others of a run.
};

/// How a run was made: shards merge only when it is the same.
struct RunHeader {
  std::string commit;
  std::map<std::string, std::string> options;
  bool operator==(const RunHeader&) const = default;
};

std::string to_json(const RunHeader& header);
std::string to_json(const SceneLine& line);

/// All scenes of a folder's *.jsonl files, by key; a line that was cut short is no scene. Throws std::runtime_error
/// where the files are not of one run.
struct RunFolder {
  std::optional<RunHeader> header;
  std::map<std::string, SceneLine> scenes;
};
RunFolder read_run(const std::string& folder);
}  // namespace binpick::bench
