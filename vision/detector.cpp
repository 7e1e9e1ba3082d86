#include "vision/detector.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <mutex>
#include <utility>

#include "base/check.hpp"
#include "vision/bounds.hpp"
#include "vision/candidates.hpp"
#include "vision/exhaustive.hpp"
#include "vision/feature.hpp"
#include "vision/maxima.hpp"
#include "vision/narrowing.hpp"
#include "vision/voting.hpp"

namespace binpick::vision {
namespace {
using SteadyClock = std::chrono::steady_clock;

/// How many hypotheses of a pass survive each stage. Thousands are cheap to test and dear to lose; only distinct
/// survivors pay for a rendered test.
constexpr double kSparseBest = 2000, kNudgedBest = 600, kDistinctBest = 300, kRenderedBest = 100, kTurnedBest = 16;
/// So many of each maximum stay, whatever those of others are worth.
constexpr std::size_t kOfEachMaximum = 6;
/// So many poses of one place are enough: a well-seen object must not crowd out the others.
constexpr std::size_t kCrowdMax = 10, kRenderedCrowdMax = 3;
/// What explains less of its silhouette at the first look is not refined: strict where there is a second pass.
constexpr float kFirstLookShare = 0.05F, kLastLookShare = -0.2F;
/// A place is settled by a pose this sure; what explains less than this share of what it does is not looked at again.
constexpr double kSettledScore = 0.9;
constexpr float kSettledShare = 0.95F;
constexpr double kSparseToleranceDiameters = 0.035;
/// A rotation of a grid of 10 000 is up to nine degrees off, which moves the lowest point against the highest by so
/// much: a narrower gate silently loses what lies flat on the floor.
constexpr double kFloorGateDiameters = 0.12;
constexpr double kUsualGapRad = 0.0988;  ///< Of a grid of 10 000, on average.
constexpr double kSameDiameters = 0.12;
/// The first pass tries maxima this far apart; most objects are found at one of them.
constexpr double kFirstApartDiameters = 0.15;
/// Below this a hypothesis is no detection.
constexpr double kScoreMin = 0.1;
/// From this on a pose is valid by itself.
constexpr double kValidScore = 0.5;

constexpr std::array<std::string_view, 9> kAdditions{"edges",         "first look",   "turned",
                                                     "weighed turns", "explain away", "second pass",
                                                     "all anchors",   "known",        "second refinement"};

/// The memory of the last scene, for the next one of this thread.
Scene& spare_scene() {
  thread_local Scene spare;
  return spare;
}

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
        finish_{scene_, part_, deadline_, {options.threads, with("edges"), with("second refinement")}},
        narrow_{scene_, part_, finish_, deadline_, options.threads, with("edges")},
        centroid_{finish_.centroid_mm()} {
    noise_mm_ = std::max(options.noise_mm.value_or(part_.noise_mm), 1e-3);
  }

  DetectionReport run() {
    stage_start_ = SteadyClock::now();
    scene_ = prepare_scene(image_, noise_mm_, options_.threads, kernels::table(), std::exchange(spare_scene(), {}));
    bounds_.emplace(scene_, supply_, part_.diameter_mm);
    lowest_allowed_mm_ = static_cast<float>(
        bounds_->floor_mm() - std::max(3 * noise_mm_, kFloorGateDiameters * coarseness() * part_.diameter_mm));
    finish_.begin(supply_);
    ended("surface");
    const std::vector<Eigen::Vector3f> maxima = anchors();
    report_.maxima = maxima.size();
    ended("maxima");
    observed({"maxima", maxima, {}});
    std::vector<Candidate> candidates;
    if (with("second pass")) {
      pass(far_apart(maxima), kFirstLookShare, candidates);
      const std::vector<Eigen::Vector3f> left = unexplained(maxima, explained_by(candidates));
      ended("selection");
      pass(left, kLastLookShare, candidates);
    } else {
      pass(maxima, kLastLookShare, candidates);
    }
    for (const auto& [stage, poses] : alive_) observed({stage, {}, poses});
    if (with("turned")) finish_.add_turned(candidates, most(kTurnedBest), kSameDiameters * part_.diameter_mm);
    ended("rendered test");
    observed("rendered test", candidates, [](const Candidate& c) { return c.pose.iso(); });
    std::vector<Selected> selected =
        select(scene_, finish_.rasteriser(), part_.symmetry, std::move(candidates), select_options());
    ended("selection");
    if (with("weighed turns")) weigh_turns(selected);
    ended("rendered test");
    report(selected);
    observed("selection", report_.detections, [](const Detection& d) { return d.T_supply_object.iso; });
    report_.cut_short = deadline_.cut_short();
    report_.time_ms = milliseconds_since(start_);
    spare_scene() = std::move(scene_);
    return std::move(report_);
  }

 private:
  bool with(std::string_view addition) const { return !options_.without.contains(addition); }
  std::size_t most(double cap) const { return static_cast<std::size_t>(std::max(1.0, cap * options_.effort)); }

  /// From maxima to candidates, which are added and sorted by evidence.
  void pass(const std::vector<Eigen::Vector3f>& maxima, float look_share, std::vector<Candidate>& candidates) {
    std::vector<Hypothesis> hypotheses;
    if (options_.search == Search::Votes) {
      const std::vector<Ballot> ballots = ballots_of(maxima);
      ended("votes");
      remember("votes", ballots,
               [&](const Ballot& b) { return pose_at(maxima[b.maximum], part_.views[b.view]).iso(); });
      hypotheses = tested(maxima, ballots);
    } else {
      hypotheses = tested_all(maxima);
    }
    ended("sparse test");
    remember("sparse test", hypotheses, [](const Hypothesis& h) { return h.pose.iso(); });
    hypotheses = narrow_.thinned(std::move(hypotheses));
    narrow_.nudge(hypotheses, most(kNudgedBest));
    hypotheses = narrow_.distinct(std::move(hypotheses), most(kDistinctBest), kCrowdMax);
    ended("first refinement");
    remember("first refinement", hypotheses, [](const Hypothesis& h) { return h.pose.iso(); });
    if (with("first look")) narrow_.look_at(hypotheses, look_share);
    hypotheses = narrow_.distinct(std::move(hypotheses), most(kRenderedBest), kRenderedCrowdMax);
    ended("first look");
    remember("first look", hypotheses, [](const Hypothesis& h) { return h.pose.iso(); });
    render(hypotheses, candidates);
    ended("rendered test");
  }

  /// Maxima with some room between them.
  std::vector<Eigen::Vector3f> far_apart(const std::vector<Eigen::Vector3f>& maxima) const {
    const auto apart = static_cast<float>(kFirstApartDiameters * part_.diameter_mm);
    std::vector<Eigen::Vector3f> kept;
    for (const Eigen::Vector3f& m : maxima)
      if (std::none_of(kept.begin(), kept.end(), [&](const Eigen::Vector3f& k) { return (k - m).norm() < apart; }))
        kept.push_back(m);
    return kept;
  }

  /// Those that do not lie on what is known by now.
  std::vector<Eigen::Vector3f> unexplained(const std::vector<Eigen::Vector3f>& maxima,
                                           const Grid<std::uint8_t>& explained) const {
    std::vector<Eigen::Vector3f> kept;
    for (const Eigen::Vector3f& m : maxima) {
      const auto px = [&](float mm, double origin) {
        return static_cast<int>(std::lround((static_cast<double>(mm) - origin) / scene_.pixel_mm));
      };
      const int col = px(m.x(), scene_.origin_mm.x()), row = px(m.y(), scene_.origin_mm.y());
      int known = 0, seen = 0;
      for (int r = row - 1; r <= row + 1; ++r)
        for (int c = col - 1; c <= col + 1; ++c)
          if (scene_.inside(r, c)) ++seen, known += explained(r, c);
      if (2 * known <= seen) kept.push_back(m);
    }
    return kept;
  }

  static double milliseconds_since(SteadyClock::time_point from) {
    return std::chrono::duration<double, std::milli>(SteadyClock::now() - from).count();
  }
  void ended(const char* stage) {
    report_.stages_ms[stage] += milliseconds_since(stage_start_);
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

  /// For the observer, who is told of all passes at once.
  template <class Items, class IsoOf>
  void remember(std::string_view stage, const Items& items, const IsoOf& iso_of) {
    if (!options_.observer) return;
    const auto begin = SteadyClock::now();
    auto it = std::find_if(alive_.begin(), alive_.end(), [&](const auto& known) { return known.first == stage; });
    if (it == alive_.end()) it = alive_.insert(it, {stage, {}});
    for (const auto& item : items) it->second.push_back({iso_of(item)});
    const auto spent = SteadyClock::now() - begin;
    start_ += spent;
    stage_start_ += spent;
  }

  /// How far apart the training rotations are, against the usual grid.
  double coarseness() const { return std::clamp(part_.rotation_gap_rad / kUsualGapRad, 0.8, 2.0); }

  std::vector<Eigen::Vector3f> anchors() const {
    MaximaOptions maxima;
    maxima.diameter_mm = part_.diameter_mm;
    maxima.threads = options_.threads;
    // The flattest view's top is the lowest place of any anchor.
    float rise = std::numeric_limits<float>::max();
    for (const View& view : part_.views) rise = std::min(rise, -view.lowest_mm);
    const auto gate = static_cast<float>(std::max(2 * noise_mm_, 0.03 * part_.diameter_mm));
    maxima.z_min_mm = bounds_->floor_mm() + std::max(0.5F * rise, rise - gate);
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

  /// The best few of each maximum, then the best of all.
  void keep_best(std::vector<Hypothesis>& hypotheses) const {
    std::stable_sort(hypotheses.begin(), hypotheses.end(), stronger);
    std::map<std::uint32_t, std::size_t> of_maximum;
    std::stable_partition(hypotheses.begin(), hypotheses.end(),
                          [&](const Hypothesis& h) { return of_maximum[h.maximum]++ < kOfEachMaximum; });
    const std::size_t best = most(kSparseBest);
    if (hypotheses.size() > best)
      hypotheses.erase(hypotheses.begin() + static_cast<std::ptrdiff_t>(best), hypotheses.end());
  }

  std::vector<Hypothesis> tested_all(const std::vector<Eigen::Vector3f>& maxima) {
    if (!search_) {
      ExhaustiveOptions search;
      search.tolerance_mm = coarse_tolerance_mm();
      search.z_floor_mm = lowest_allowed_mm_;
      search.threads = options_.threads;
      search.effort = options_.effort;
      search.all_anchors = with("all anchors");
      search_.emplace(scene_, part_, search);
    }
    std::vector<Hypothesis> hypotheses;
    for (const Standing& s : search_->at(maxima, deadline_, report_.hypotheses))
      hypotheses.push_back({s.maximum, s.view, pose_at(maxima[s.maximum], part_.views[s.view], s.anchor), s.evidence});
    keep_best(hypotheses);
    return hypotheses;
  }

  std::vector<Hypothesis> tested(const std::vector<Eigen::Vector3f>& maxima, const std::vector<Ballot>& ballots) {
    report_.hypotheses += ballots.size();
    const float tolerance = coarse_tolerance_mm();
    // Votes point at the first anchor; the maximum that is near may be another one.
    std::vector<Hypothesis> best(ballots.size());
    constexpr std::size_t kBlock = 64;
    share(options_.threads, (ballots.size() + kBlock - 1) / kBlock, deadline_, [&](std::size_t block, int) {
      for (std::size_t i = block * kBlock; i < std::min(ballots.size(), (block + 1) * kBlock); ++i) {
        const View& view = part_.views[ballots[i].view];
        const Eigen::Vector3f& maximum = maxima[ballots[i].maximum];
        const std::size_t anchors = with("all anchors") ? view.anchors_object_mm.size() : 1;
        for (std::size_t k = 0; k < anchors; ++k) {
          const Eigen::Vector3f first =
              maximum - view.R_supply_object * (view.anchors_object_mm[k] - view.anchors_object_mm.front());
          const float evidence = sparse_evidence(scene_, part_, ballots[i].view, first, tolerance);
          if (evidence > best[i].evidence)
            best[i] = {ballots[i].maximum, ballots[i].view, pose_at(maximum, view, k), evidence};
        }
      }
    });
    std::vector<Hypothesis> hypotheses;
    for (const Hypothesis& h : best)
      if (h.evidence > 0) hypotheses.push_back(h);
    keep_best(hypotheses);
    return hypotheses;
  }

  /// The best of each place first; the others of a place only where that did not settle it.
  void render(const std::vector<Hypothesis>& hypotheses, std::vector<Candidate>& candidates) {
    const float place_mm = narrow_.place_mm();
    std::vector<std::size_t> leaders, others, leader_of(hypotheses.size());
    std::vector<Eigen::Vector3f> centres;
    for (std::size_t i = 0; i < hypotheses.size(); ++i) {
      centres.push_back(hypotheses[i].pose.R * centroid_ + hypotheses[i].pose.t);
      const auto leader = std::find_if(leaders.begin(), leaders.end(),
                                       [&](std::size_t l) { return (centres[l] - centres[i]).norm() < place_mm; });
      leader_of[i] = leader == leaders.end() ? i : *leader;
      (leader == leaders.end() ? leaders : others).push_back(i);
    }
    std::vector<Candidate> made(hypotheses.size());
    finish(hypotheses, leaders, made);
    std::erase_if(others, [&](std::size_t i) {
      const Candidate& leader = made[leader_of[i]];
      return score_by_itself(leader.evidence) > kSettledScore &&
             hypotheses[i].evidence < kSettledShare * leader.test.evidence;
    });
    finish(hypotheses, others, made);
    for (Candidate& c : made)
      if (c.test.evidence > 0) candidates.push_back(std::move(c));
    std::stable_sort(candidates.begin(), candidates.end(),
                     [](const Candidate& a, const Candidate& b) { return a.test.evidence > b.test.evidence; });
  }

  void finish(const std::vector<Hypothesis>& hypotheses, const std::vector<std::size_t>& which,
              std::vector<Candidate>& made) {
    std::vector<Template> drawn(static_cast<std::size_t>(std::clamp(options_.threads, 1, 64)));
    std::mutex first_valid;
    share(options_.threads, which.size(), deadline_, [&](std::size_t k, int thread) {
      Candidate& candidate = made[which[k]];
      candidate = finish_.finished(hypotheses[which[k]].pose, drawn[static_cast<std::size_t>(thread)]);
      if (score_by_itself(candidate.evidence) < kValidScore || !against(candidate.pose).empty()) return;
      const std::scoped_lock lock{first_valid};
      if (!report_.first)
        report_.first = FirstValid{{candidate.pose.iso()}, milliseconds_since(start_), rendered_ + k + 1};
    });
    rendered_ += which.size();
  }

  /// Pixels that a valid pose explains. Of poses that are close together the strongest only is looked at.
  Grid<std::uint8_t> explained_by(const std::vector<Candidate>& candidates) const {
    const float place_mm = narrow_.place_mm();
    std::vector<const Candidate*> standing;
    std::vector<Eigen::Vector3f> centres;
    for (const Candidate& c : candidates) {
      if (score_by_itself(c.evidence) < kValidScore || !against(c.pose).empty()) continue;
      const Eigen::Vector3f centre = c.pose.R * centroid_ + c.pose.t;
      if (std::any_of(centres.begin(), centres.end(),
                      [&](const Eigen::Vector3f& other) { return (other - centre).norm() < place_mm; }))
        continue;
      standing.push_back(&c);
      centres.push_back(centre);
    }
    std::vector<std::vector<std::int32_t>> pixels(standing.size());
    share(options_.threads, standing.size(), deadline_, [&](std::size_t i, int) {
      const Pose& pose = standing[i]->pose;
      Template drawn;
      std::vector<PixelState> states;
      finish_.rasteriser().draw(pose.R, pose.t, scene_.pixel_mm, scene_.origin_mm, drawn);
      compare(scene_, finish_.rasteriser(), pose, drawn, states);
      for (int row = 0; row < drawn.rows; ++row)
        for (int col = 0; col < drawn.cols; ++col)
          if (states[drawn.at(row, col)] == PixelState::Explained)
            pixels[i].push_back((row + drawn.row0) * scene_.cols() + col + drawn.col0);
    });
    Grid<std::uint8_t> explained = Grid<std::uint8_t>::Zero(scene_.rows(), scene_.cols());
    for (const auto& of_one : pixels)
      for (const std::int32_t pixel : of_one) explained.data()[pixel] = 1;
    return explained;
  }

  SelectOptions select_options() const {
    SelectOptions options;
    options.same_mm = kSameDiameters * part_.diameter_mm;
    options.diameter_mm = part_.diameter_mm;
    options.radius_mm = finish_.radius_mm();
    options.centroid_mm = centroid_;
    options.threads = options_.threads;
    options.score_min = kScoreMin;
    options.content = bounds_->content(scene_);
    options.outside = [this](const Pose& pose) { return against(pose); };
    options.explain_away = with("explain away");
    options.ask_known = with("known") && !deadline_.expired();
    return options;
  }

  /// Why the part cannot be there; empty: it can.
  std::string against(const Pose& pose) const { return bounds_->against(pose, part_.mesh.vertices_mm); }

  void weigh_turns(std::vector<Selected>& selected) const {
    std::vector<Candidate*> believed;
    for (Selected& entry : selected)
      if (entry.reason.empty() && entry.score >= kScoreMin) believed.push_back(&entry.candidate);
    finish_.weigh_turns(believed, [this](const Pose& pose) { return against(pose).empty(); });
    for (Selected& entry : selected) entry.score = score_of(entry.candidate.evidence);
    std::stable_sort(selected.begin(), selected.end(),
                     [](const Selected& a, const Selected& b) { return a.score > b.score; });
  }

  /// Why the score is small where nothing speaks against the pose itself.
  static std::string too_little(const Evidence& evidence) {
    if (evidence[Clue::Known] >= kKnownEnough || score_by_itself(evidence) < kScoreMin) return "too little evidence";
    const long percent = std::lround(100 * evidence[Clue::Known]);
    return "most of the supply is something else (" + std::to_string(percent) + " % known)";
  }

  void report(const std::vector<Selected>& selected) {
    const auto rejections = static_cast<std::size_t>(std::max(0, options_.rejections_max));
    for (const Selected& entry : selected) {
      const Transform<frame::Supply, frame::Object> T{entry.candidate.pose.iso()};
      const std::string reason =
          entry.reason.empty() && entry.score < kScoreMin ? too_little(entry.candidate.evidence) : entry.reason;
      if (reason.empty()) {
        Detection detection;
        detection.T_supply_object = T;
        detection.score = entry.score;
        detection.evidence = entry.candidate.evidence;
        detection.visible_fraction = entry.candidate.test.visible_fraction();
        detection.covariance = finish_.covariance_of(entry.candidate);
        report_.detections.push_back(detection);
      } else if (report_.rejected.size() < rejections && (reason != entry.reason || !entry.overshadowed)) {
        report_.rejected.push_back({T, entry.score, entry.candidate.evidence, reason});
      }
    }
    // Then what lost to a better pose of the same place: many, and they tell little.
    for (const Selected& entry : selected)
      if (entry.overshadowed && report_.rejected.size() < rejections)
        report_.rejected.push_back({{entry.candidate.pose.iso()}, entry.score, entry.candidate.evidence, entry.reason});
    if (options_.detections_max > 0 && report_.detections.size() > static_cast<std::size_t>(options_.detections_max))
      report_.detections.resize(static_cast<std::size_t>(options_.detections_max));
  }

  SteadyClock::time_point start_, stage_start_;
  Deadline deadline_;
  const DepthImage& image_;
  const SupplyBox& supply_;
  const KnowledgeBase::Impl& part_;
  const DetectorOptions& options_;
  Scene scene_;  // before what refers to it
  Finisher finish_;
  Narrowing narrow_;
  std::optional<Bounds> bounds_;
  Eigen::Vector3f centroid_;
  double noise_mm_ = 1;
  float lowest_allowed_mm_ = 0;
  std::size_t rendered_ = 0;
  std::optional<ExhaustiveSearch> search_;
  std::vector<std::pair<std::string_view, std::vector<Transform<frame::Supply, frame::Object>>>> alive_;
  DetectionReport report_;
};
}  // namespace

std::span<const std::string_view> detector_additions() { return kAdditions; }

DetectionReport detect(const DepthImage& image, const SupplyBox& supply, const KnowledgeBase& part,
                       const DetectorOptions& options) {
  BINPICK_CHECK(part.verify());  // Votes index without a look; who opened the file has been told long before.
  return Detecting{image, supply, part, options}.run();
}
}  // namespace binpick::vision
