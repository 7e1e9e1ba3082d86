#pragma once

#include <Eigen/Core>
#include <chrono>
#include <functional>
#include <map>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "base/frames.hpp"
#include "vision/depth_image.hpp"
#include "vision/evidence.hpp"
#include "vision/knowledge_base.hpp"

namespace binpick::vision {
using Matrix6 = Eigen::Matrix<double, 6, 6>;

/// What is still alive after a stage. For benches, which know the truth and ask where it was lost.
struct StageSurvivors {
  std::string_view stage;                      ///< As in DetectionReport::stages_ms.
  std::span<const Eigen::Vector3f> maxima_mm;  ///< After "maxima" only: where a part's highest point may be.
  std::span<const Transform<frame::Supply, frame::Object>> poses;  ///< After every later stage, strongest first.
};
using StageObserver = std::function<void(const StageSurvivors&)>;

/// Where hypotheses come from: what the features vote for, or every trained view at every maximum.
enum class Search { Votes, Exhaustive };

struct DetectorOptions {
  Search search = Search::Exhaustive;
  int hypotheses_max = 16384;                         ///< Bound of the hypotheses that are tested.
  double effort = 1;                                  ///< Multiplies every cap on what goes on to the next stage.
  std::optional<double> noise_mm;                     ///< Expected depth noise, 1 sd; default: the knowledge base's.
  std::optional<std::chrono::milliseconds> deadline;  ///< Return the best so far.
  int threads = 2;                                    ///< The result does not depend on it.
  int detections_max = 0;                             ///< 0: unlimited.
  int rejections_max = 20;                            ///< How many of those not believed are told.
  StageObserver observer;                             ///< Called after each stage; empty: nothing is done for it.
  std::set<std::string, std::less<>> without;         ///< Of detector_additions(): to see what each brings.
};

/// What was added to the published method, by the names that DetectorOptions::without knows.
std::span<const std::string_view> detector_additions();

struct Detection {
  Transform<frame::Supply, frame::Object> T_supply_object;
  double score = 0.0;             ///< Probability that this detection is right, 0 … 1.
  Evidence evidence;              ///< What the score is made of.
  double visible_fraction = 0.0;  ///< Share of the silhouette that is the top surface, 0 … 1.
  Matrix6 covariance =
      Matrix6::Zero();  ///< Of (translation mm, rotation rad), supply axes, at the part's surface centroid.
};

struct Rejection {
  Transform<frame::Supply, frame::Object> T_supply_object;
  double score = 0.0;
  Evidence evidence;
  std::string reason;  ///< "free space seen through it", "edges missing", "explained by a better one" …
};

/// The first pose that stood every test by itself, before it was compared with the others.
struct FirstValid {
  Transform<frame::Supply, frame::Object> T_supply_object;
  double time_ms = 0;          ///< Since the start of detect().
  std::size_t hypotheses = 0;  ///< Rendered and compared up to and with it.
};

/// What happened, also when nothing was found: the operator's question is "why not?".
struct DetectionReport {
  std::vector<Detection> detections;  ///< Best first.
  std::vector<Rejection> rejected;    ///< Strongest hypotheses not believed, each with its reason.
  std::size_t maxima = 0;
  std::size_t hypotheses = 0;  ///< Tested against the depth image.
  std::optional<FirstValid> first;
  bool cut_short = false;  ///< By the deadline: with more time there would have been more to look at.
  std::map<std::string, double> stages_ms;
  double time_ms = 0;
};

/// Finds objects of one part in one depth image. An empty supply is a report without detections, not an error.
/// Bounded by options; touches nothing but its arguments; same input, same result.
DetectionReport detect(const DepthImage& image, const SupplyBox& supply, const KnowledgeBase& part,
                       const DetectorOptions& options);
}  // namespace binpick::vision
