#include "vision/detector.hpp"

#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <mutex>
#include <numbers>

#include "base/check.hpp"
#include "vision/exhaustive.hpp"
#include "vision/feature.hpp"
#include "vision/knowledge_base_impl.hpp"
#include "vision/maxima.hpp"
#include "vision/prepared.hpp"
#include "vision/selection.hpp"
#include "vision/team.hpp"
#include "vision/voting.hpp"

namespace binpick::vision {
namespace {
using SteadyClock = std::chrono::steady_clock;

/// How many hypotheses survive each stage. Thousands are cheap to test and dear to lose; only distinct survivors pay
/// for a rendered test.
constexpr std::size_t kSparseBest = 3000;
constexpr std::size_t kDistinctBest = 500;
constexpr std::size_t kRenderedBest = 120;
constexpr std::size_t kRenderedCrowdMax = 3;
constexpr std::size_t kTurnedBest = 16;
/// So many poses of one place are enough: a well-seen object must not crowd out the others.
constexpr std::size_t kCrowdMax = 10;
constexpr std::size_t kRejectionsMax = 20;
constexpr double kSparseToleranceDiameters = 0.035;
/// A rotation of a grid of 10 000 is up to nine degrees off, which moves the lowest point against the highest by so
/// much: a narrower gate silently loses what lies flat on the floor.
constexpr double kFloorGateDiameters = 0.12;
constexpr double kUsualGapRad = 0.0988;  ///< Of a grid of 10 000, on average.
constexpr double kWallGateDiameters = 0.04;
constexpr double kSameDiameters = 0.12;
/// Below this a hypothesis is no detection.
constexpr double kScoreMin = 0.1;
/// From this on a pose is valid by itself.
constexpr double kValidScore = 0.5;

/// Supply's floor: known, or found as the level below which there is nothing and on which much lies, or unknown.
float floor_of(const Scene& scene, const SupplyBox& supply) {
  constexpr float kUnknown = -std::numeric_limits<float>::infinity();
  if (supply.size_mm.x() > 0 && supply.size_mm.y() > 0) return 0;
  std::vector<float> heights;
  for (const float z : scene.z_mm.reshaped<Eigen::RowMajor>())
    if (!std::isnan(z)) heights.push_back(z);
  if (heights.empty()) return kUnknown;
  const auto low = heights.begin() + static_cast<std::ptrdiff_t>(heights.size() / 50);
  std::nth_element(heights.begin(), low, heights.end());
  const float band = 3 * static_cast<float>(scene.noise_mm);
  double sum = 0;
  std::size_t n = 0;
  for (const float z : heights)
    if (std::abs(z - *low) <= band) sum += z, ++n;
  return n * 5 >= heights.size() ? static_cast<float>(sum / static_cast<double>(n)) : kUnknown;
}

struct Hypothesis {
  std::uint32_t maximum = 0;
  std::uint16_t view = 0;
  Pose pose;
  float evidence = 0;
};

bool stronger(const Hypothesis& a, const Hypothesis& b) { return a.evidence > b.evidence; }

/// One detection under way: what all stages share.
class Detecting {
 public:
  Detecting(const DepthImage& image, const SupplyBox& supply, const KnowledgeBase& base, const DetectorOptions& options)
      : start_{SteadyClock::now()},
        deadline_{options.deadline ? std::optional{start_ + *options.deadline} : std::nullopt},
        image_{image},
        supply_{supply},
        part_{base.impl()},
        options_{options},
        rasteriser_{prepared(part_).rasteriser()},
        centroid_{part_.mesh.centroid_mm().cast<float>()} {
    noise_mm_ = std::max(options.noise_mm.value_or(part_.noise_mm), 1e-3);
    double sum = 0;
    for (const Eigen::Vector3f& v : part_.mesh.vertices_mm) sum += (v - centroid_).squaredNorm();
    radius_mm_ = std::sqrt(sum / std::max<double>(1, static_cast<double>(part_.mesh.vertices_mm.size())));
  }

  DetectionReport run() {
    stage_start_ = SteadyClock::now();
    scene_ = prepare_scene(image_, noise_mm_);
    floor_mm_ = floor_of(scene_, supply_);
    lowest_allowed_mm_ =
        static_cast<float>(floor_mm_ - std::max(3 * noise_mm_, kFloorGateDiameters * coarseness() * part_.diameter_mm));
    ended("surface");
    const std::vector<Eigen::Vector3f> maxima = anchors();
    report_.maxima = maxima.size();
    ended("maxima");
    observed({"maxima", maxima, {}});
    std::vector<Hypothesis> hypotheses;
    if (options_.search == Search::Votes) {
      const std::vector<Ballot> ballots = ballots_of(maxima);
      ended("votes");
      observed("votes", ballots,
               [&](const Ballot& b) { return pose_at(maxima[b.maximum], part_.views[b.view]).iso(); });
      hypotheses = tested(maxima, ballots);
    } else {
      hypotheses = tested_all(maxima);
    }
    ended("sparse test");
    observed("sparse test", hypotheses, [](const Hypothesis& h) { return h.pose.iso(); });
    nudge(hypotheses);
    hypotheses = distinct(std::move(hypotheses), kDistinctBest, kCrowdMax);
    ended("first refinement");
    observed("first refinement", hypotheses, [](const Hypothesis& h) { return h.pose.iso(); });
    first_look(hypotheses);
    hypotheses = distinct(std::move(hypotheses), kRenderedBest, kRenderedCrowdMax);
    ended("first look");
    observed("first look", hypotheses, [](const Hypothesis& h) { return h.pose.iso(); });
    std::vector<Candidate> candidates = rendered(hypotheses);
    add_turned(candidates);
    ended("rendered test");
    observed("rendered test", candidates, [](const Candidate& c) { return c.pose.iso(); });
    report(select(scene_, rasteriser_, part_.symmetry, std::move(candidates), select_options()));
    ended("selection");
    observed("selection", report_.detections, [](const Detection& d) { return d.T_supply_object.iso; });
    report_.time_ms = milliseconds_since(start_);
    return std::move(report_);
  }

 private:
  static double milliseconds_since(SteadyClock::time_point from) {
    return std::chrono::duration<double, std::milli>(SteadyClock::now() - from).count();
  }
  void ended(const char* stage) {
    report_.stages_ms[stage] = milliseconds_since(stage_start_);
    stage_start_ = SteadyClock::now();
  }

  /// Tells the observer what is alive. Its time is not detection's.
  void observed(const StageSurvivors& survivors) {
    if (!options_.observer) return;
    const auto begin = SteadyClock::now();
    options_.observer(survivors);
    const auto spent = SteadyClock::now() - begin;
    start_ += spent;
    stage_start_ += spent;
  }
  template <class Items, class IsoOf>
  void observed(std::string_view stage, const Items& items, const IsoOf& iso_of) {
    if (!options_.observer) return;
    std::vector<Transform<frame::Supply, frame::Object>> poses;
    for (const auto& item : items) poses.push_back({iso_of(item)});
    observed({stage, {}, poses});
  }

  /// How far apart the training rotations are, against the usual grid.
  double coarseness() const { return std::clamp(part_.rotation_gap_rad / kUsualGapRad, 0.8, 2.0); }

  std::vector<Eigen::Vector3f> anchors() const {
    MaximaOptions maxima;
    maxima.diameter_mm = part_.diameter_mm;
    // The flattest view's top is the lowest place of any anchor.
    float rise = std::numeric_limits<float>::max();
    for (const View& view : part_.views) rise = std::min(rise, -view.lowest_mm);
    const auto gate = static_cast<float>(std::max(2 * noise_mm_, 0.03 * part_.diameter_mm));
    maxima.z_min_mm = part_.views.empty() ? floor_mm_ : floor_mm_ + std::max(0.5F * rise, rise - gate);
    return find_maxima(scene_, maxima);
  }

  std::vector<Ballot> ballots_of(const std::vector<Eigen::Vector3f>& maxima) const {
    VoteOptions votes;
    votes.ballots_max = static_cast<std::size_t>(std::max(1, options_.hypotheses_max));
    votes.reach_mm = std::max(1.0 * image_.pixel_mm, 0.05 * part_.diameter_mm);
    votes.height_mm = std::max(3 * noise_mm_, 1.5 * image_.pixel_mm);
    votes.z_floor_mm = lowest_allowed_mm_;
    votes.threads = options_.threads;
    const DepthImage smooth = smoothed(image_, smoothing_jump_mm(noise_mm_, image_.pixel_mm));
    return vote(smooth, part_, maxima, votes, deadline_);
  }

  static Pose pose_at(const Eigen::Vector3f& place, const View& view, std::size_t anchor = 0) {
    Pose pose;
    pose.R = view.R_supply_object.toRotationMatrix();
    pose.t = place - pose.R * view.anchors_object_mm[anchor];
    return pose;
  }

  /// As wide as the grid of rotations is coarse.
  float coarse_tolerance_mm() const {
    return static_cast<float>(std::max(kSparseToleranceDiameters * coarseness() * part_.diameter_mm,
                                       static_cast<double>(tolerance_of(scene_))));
  }

  static void keep_best(std::vector<Hypothesis>& hypotheses, std::size_t most) {
    std::stable_sort(hypotheses.begin(), hypotheses.end(), stronger);
    if (hypotheses.size() > most)
      hypotheses.erase(hypotheses.begin() + static_cast<std::ptrdiff_t>(most), hypotheses.end());
  }

  std::vector<Hypothesis> tested_all(const std::vector<Eigen::Vector3f>& maxima) {
    ExhaustiveOptions search;
    search.tolerance_mm = coarse_tolerance_mm();
    search.z_floor_mm = lowest_allowed_mm_;
    search.threads = options_.threads;
    std::vector<Hypothesis> hypotheses;
    for (const Standing& s : search_all(scene_, part_, maxima, search, deadline_, report_.hypotheses))
      hypotheses.push_back({s.maximum, s.view, pose_at(maxima[s.maximum], part_.views[s.view], s.anchor), s.evidence});
    keep_best(hypotheses, kSparseBest);
    return hypotheses;
  }

  std::vector<Hypothesis> tested(const std::vector<Eigen::Vector3f>& maxima, const std::vector<Ballot>& ballots) {
    report_.hypotheses = ballots.size();
    const float tolerance = coarse_tolerance_mm();
    std::vector<float> evidence(ballots.size(), -1);
    constexpr std::size_t kBlock = 64;
    share(options_.threads, (ballots.size() + kBlock - 1) / kBlock, deadline_, [&](std::size_t block, int) {
      for (std::size_t i = block * kBlock; i < std::min(ballots.size(), (block + 1) * kBlock); ++i)
        evidence[i] = sparse_evidence(scene_, part_, ballots[i].view, maxima[ballots[i].maximum], tolerance);
    });
    std::vector<Hypothesis> hypotheses;
    for (std::size_t i = 0; i < ballots.size(); ++i)
      if (evidence[i] > 0)
        hypotheses.push_back({ballots[i].maximum, ballots[i].view,
                              pose_at(maxima[ballots[i].maximum], part_.views[ballots[i].view]), evidence[i]});
    keep_best(hypotheses, kSparseBest);
    return hypotheses;
  }

  /// A few steps of refinement on the view's own samples, then the sparse test again, more strictly.
  void nudge(std::vector<Hypothesis>& hypotheses) const {
    const float tolerance = tolerance_of(scene_);
    RefineOptions options;
    options.steps = 5;
    options.gate_from_mm = std::max(3 * tolerance, static_cast<float>(0.06 * part_.diameter_mm));
    options.gate_to_mm = std::max(2 * tolerance, static_cast<float>(0.03 * part_.diameter_mm));
    options.edge_gate_from_px = edge_gate_px(6, 0.08);
    options.edge_gate_to_px = edge_gate_px(3, 0.03);
    share(options_.threads, hypotheses.size(), deadline_, [&](std::size_t i, int) {
      Hypothesis& h = hypotheses[i];
      const View& view = part_.views[h.view];
      refine(scene_, model_points(view, h.pose), h.pose.R * centroid_ + h.pose.t, options, h.pose);
      h.evidence = sparse_evidence(scene_, part_, h.view, h.pose, 2 * tolerance);
    });
  }

  /// Edges pull from as far as the pose may be off: pixels, or a share of the part where pixels are small.
  float edge_gate_px(float pixels, double diameters) const {
    return std::max(pixels, static_cast<float>(diameters * part_.diameter_mm / scene_.pixel_mm));
  }

  std::vector<Hypothesis> distinct(std::vector<Hypothesis> hypotheses, std::size_t most, std::size_t crowd) const {
    std::stable_sort(hypotheses.begin(), hypotheses.end(), stronger);
    const double same_mm = 0.04 * part_.diameter_mm, crowd_mm = 0.15 * part_.diameter_mm;
    std::vector<Hypothesis> kept;
    std::vector<Eigen::Vector3f> centres;
    for (const Hypothesis& h : hypotheses) {
      if (kept.size() >= most || h.evidence <= 0) break;
      const Eigen::Vector3f centre = h.pose.R * centroid_ + h.pose.t;
      bool again = false;
      std::size_t near = 0;
      for (std::size_t k = 0; k < kept.size() && !again; ++k) {
        const float apart = (centres[k] - centre).norm();
        near += apart < crowd_mm;
        again =
            apart < same_mm && displacement_mm({kept[k].pose, {}}, {h.pose, {}}, part_.symmetry, radius_mm_) < same_mm;
      }
      if (again || near >= crowd) continue;
      kept.push_back(h);
      centres.push_back(centre);
    }
    return kept;
  }

  /// Rendered coarsely and compared as it is: cheaper than refinement by far, and tells which hypotheses of a place are
  /// worth it.
  void first_look(std::vector<Hypothesis>& hypotheses) const {
    const int every = glance_every(scene_, part_.diameter_mm);
    std::vector<Template> drawn(static_cast<std::size_t>(std::clamp(options_.threads, 1, 64)));
    share(options_.threads, hypotheses.size(), deadline_, [&](std::size_t i, int thread) {
      Hypothesis& h = hypotheses[i];
      Template& t = drawn[static_cast<std::size_t>(thread)];
      h.evidence = std::max(glance(scene_, rasteriser_, h.pose, t, every), 0.001F);
    });
  }

  /// Refined against its own render, twice; then the rendered test.
  Candidate render_and_refine(Pose pose, Template& drawn) const {
    const float tolerance = tolerance_of(scene_);
    Candidate candidate;
    RefineOptions options;
    options.steps = 5;
    options.gate_from_mm = std::max(2 * tolerance, static_cast<float>(0.03 * part_.diameter_mm));
    options.gate_to_mm = 2 * tolerance;
    options.edge_gate_from_px = edge_gate_px(4, 0.04);
    for (int round = 0; round < 2; ++round) {
      rasteriser_.draw(pose.R, pose.t, scene_.pixel_mm, scene_.origin_mm, drawn, false);
      const ModelPoints points = model_points(scene_, rasteriser_, pose, drawn, 400, 160);
      candidate.information = refine(scene_, points, pose.R * centroid_ + pose.t, options, pose);
      options.gate_from_mm = options.gate_to_mm = std::max(3.5F * static_cast<float>(noise_mm_), tolerance);
      options.edge_gate_from_px = 2;
      options.single_heights = true;
    }
    rasteriser_.draw(pose.R, pose.t, scene_.pixel_mm, scene_.origin_mm, drawn, false);
    candidate.pose = pose;
    candidate.test = dense_test(scene_, rasteriser_, pose, drawn);
    return candidate;
  }

  std::vector<Candidate> rendered(const std::vector<Hypothesis>& hypotheses) {
    std::vector<Candidate> candidates(hypotheses.size());
    std::vector<Template> drawn(static_cast<std::size_t>(std::clamp(options_.threads, 1, 64)));
    std::mutex first_valid;
    share(options_.threads, hypotheses.size(), deadline_, [&](std::size_t i, int thread) {
      candidates[i] = render_and_refine(hypotheses[i].pose, drawn[static_cast<std::size_t>(thread)]);
      if (score_of(candidates[i]) < kValidScore || !outside(candidates[i].pose).empty()) return;
      const std::scoped_lock lock{first_valid};
      if (!report_.first) report_.first = FirstValid{{candidates[i].pose.iso()}, milliseconds_since(start_), i + 1};
    });
    std::erase_if(candidates, [](const Candidate& c) { return c.test.evidence <= 0; });
    std::stable_sort(candidates.begin(), candidates.end(),
                     [](const Candidate& a, const Candidate& b) { return a.test.evidence > b.test.evidence; });
    return candidates;
  }

  /// Parts look much alike from both sides, or end for end. The strongest candidates are tried in the turns about
  /// the part's principal axes that are no symmetry: either the turned one is better, or how much worse it
  /// is tells how sure the first one is.
  void add_turned(std::vector<Candidate>& candidates) const {
    std::vector<Candidate> strongest;
    for (const Candidate& c : candidates) {
      if (strongest.size() >= kTurnedBest) break;
      const bool again = std::any_of(strongest.begin(), strongest.end(), [&](const Candidate& other) {
        return displacement_mm(other, c, part_.symmetry, radius_mm_) < kSameDiameters * part_.diameter_mm;
      });
      if (!again) strongest.push_back(c);
    }
    const std::vector<Eigen::Matrix3f> turns = principal_turns();
    std::vector<Candidate> turned(strongest.size() * turns.size());
    std::vector<Template> drawn(static_cast<std::size_t>(std::clamp(options_.threads, 1, 64)));
    share(options_.threads, turned.size(), deadline_, [&](std::size_t i, int thread) {
      Pose pose = strongest[i / turns.size()].pose;
      const Eigen::Vector3f centre = pose.R * centroid_ + pose.t;
      pose.R = pose.R * turns[i % turns.size()];
      pose.t = centre - pose.R * centroid_;
      turned[i] = render_and_refine(pose, drawn[static_cast<std::size_t>(thread)]);
    });
    for (const Candidate& c : turned)
      if (c.test.evidence > 0) candidates.push_back(c);
  }

  /// Quarter turns about the principal axes; steps of 15 degrees about an axis that the part is nearly round about (a
  /// wheel's spokes are found by the next edge only). None that the symmetry makes another's equal.
  std::vector<Eigen::Matrix3f> principal_turns() const {
    constexpr double kNearlyRound = 0.8;
    constexpr double kStepRad = std::numbers::pi / 12;
    Eigen::Matrix3d spread = Eigen::Matrix3d::Zero();
    for (const Eigen::Vector3f& v : part_.mesh.vertices_mm) {
      const Eigen::Vector3d d = (v - centroid_).cast<double>();
      spread += d * d.transpose();
    }
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> principal(spread);
    const Eigen::Vector3d centroid = centroid_.cast<double>();
    std::vector<Eigen::Isometry3d> distinct{Eigen::Isometry3d::Identity()};
    for (int axis = 0; axis < 3; ++axis) {
      const double a = principal.eigenvalues()[(axis + 1) % 3], b = principal.eigenvalues()[(axis + 2) % 3];
      const int steps = std::min(a, b) > kNearlyRound * std::max(a, b) ? 1 : 6;
      for (int k = steps; k < 24; k += steps) {
        Eigen::Isometry3d moved = Eigen::Isometry3d::Identity();
        moved.linear() =
            Eigen::AngleAxisd(kStepRad * k, principal.eigenvectors().col(axis).normalized()).toRotationMatrix();
        moved.translation() = centroid - moved.linear() * centroid;
        const bool again = std::any_of(distinct.begin(), distinct.end(), [&](const Eigen::Isometry3d& other) {
          const PoseDistance d = pose_distance(other, moved, part_.symmetry, radius_mm_);
          return d.angle_rad < 0.1 && d.centroid_mm < 0.05 * part_.diameter_mm;
        });
        if (!again) distinct.push_back(moved);
      }
    }
    std::vector<Eigen::Matrix3f> turns;
    for (std::size_t k = 1; k < distinct.size(); ++k) turns.push_back(distinct[k].linear().cast<float>());
    return turns;
  }

  SelectOptions select_options() const {
    SelectOptions options;
    options.same_mm = kSameDiameters * part_.diameter_mm;
    options.diameter_mm = part_.diameter_mm;
    options.radius_mm = radius_mm_;
    options.centroid_mm = centroid_.cast<double>();
    return options;
  }

  /// Floor and walls at the refined pose, by every vertex.
  std::string outside(const Pose& pose) const {
    const double depth = std::max(3 * noise_mm_, 0.03 * part_.diameter_mm);
    const double wall = kWallGateDiameters * part_.diameter_mm + 2 * scene_.pixel_mm;
    float lowest = std::numeric_limits<float>::max();
    Eigen::Vector2f reach = Eigen::Vector2f::Zero();
    for (const Eigen::Vector3f& v : part_.mesh.vertices_mm) {
      const Eigen::Vector3f p = pose.R * v + pose.t;
      lowest = std::min(lowest, p.z());
      reach = reach.cwiseMax(p.head<2>().cwiseAbs());
    }
    if (lowest < floor_mm_ - depth) return "reaches through the floor";
    if (supply_.size_mm.x() > 0 && supply_.size_mm.y() > 0 &&
        (reach.x() > 0.5 * supply_.size_mm.x() + wall || reach.y() > 0.5 * supply_.size_mm.y() + wall))
      return "reaches through a wall";
    return {};
  }

  Matrix6 covariance_of(const Matrix6& information) const {
    // Single points are fewer than pixels where holes were filled; the scanner's own error is common to all of them.
    constexpr double kCorrelation = 2.0;
    constexpr double kCommonShare = 0.1;
    Matrix6 prior = Matrix6::Zero();
    prior.diagonal().head<3>().setConstant(1 / std::pow(0.1 * part_.diameter_mm, 2));
    prior.diagonal().tail<3>().setConstant(1 / std::pow(0.3, 2));
    Matrix6 covariance = (information / kCorrelation + prior).inverse();
    covariance.diagonal().head<3>().array() += std::pow(kCommonShare * noise_mm_, 2);
    return 0.5 * (covariance + covariance.transpose());
  }

  void report(const std::vector<Selected>& selected) {
    for (const Selected& entry : selected) {
      const Transform<frame::Supply, frame::Object> T{entry.candidate.pose.iso()};
      std::string reason = entry.reason;
      if (reason.empty()) reason = outside(entry.candidate.pose);
      if (reason.empty() && entry.score < kScoreMin) reason = "too little evidence";
      if (reason.empty()) {
        Detection detection;
        detection.T_supply_object = T;
        detection.score = entry.score;
        detection.visible_fraction = entry.candidate.test.visible_fraction();
        detection.covariance = covariance_of(entry.candidate.information);
        report_.detections.push_back(detection);
      } else if (report_.rejected.size() < kRejectionsMax && (reason != entry.reason || !entry.overshadowed)) {
        report_.rejected.push_back({T, entry.score, reason});
      }
    }
    // Then what lost to a better pose of the same place: many, and they tell little.
    for (const Selected& entry : selected)
      if (entry.overshadowed && report_.rejected.size() < kRejectionsMax)
        report_.rejected.push_back({{entry.candidate.pose.iso()}, entry.score, entry.reason});
    if (options_.detections_max > 0 && report_.detections.size() > static_cast<std::size_t>(options_.detections_max))
      report_.detections.resize(static_cast<std::size_t>(options_.detections_max));
  }

  SteadyClock::time_point start_, stage_start_;
  Deadline deadline_;
  const DepthImage& image_;
  const SupplyBox& supply_;
  const KnowledgeBase::Impl& part_;
  const DetectorOptions& options_;
  const Rasteriser& rasteriser_;
  Eigen::Vector3f centroid_;
  double noise_mm_ = 1, radius_mm_ = 1;
  float floor_mm_ = 0, lowest_allowed_mm_ = 0;
  Scene scene_;
  DetectionReport report_;
};
}  // namespace

std::span<const std::string_view> detector_additions() {
  static constexpr std::array<std::string_view, 11> kAdditions{"edges",
                                                               "first look",
                                                               "turned",
                                                               "rooms",
                                                               "explain away",
                                                               "second pass",
                                                               "all anchors",
                                                               "normals",
                                                               "calibrated score",
                                                               "second refinement",
                                                               "curvature"};
  return kAdditions;
}

DetectionReport detect(const DepthImage& image, const SupplyBox& supply, const KnowledgeBase& part,
                       const DetectorOptions& options) {
  BINPICK_CHECK(part.verify());  // Votes index without a look; who opened the file has been told long before.
  return Detecting{image, supply, part, options}.run();
}
}  // namespace binpick::vision
