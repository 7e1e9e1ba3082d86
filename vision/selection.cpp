#include "vision/selection.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>

#include "base/check.hpp"
#include "vision/team.hpp"

namespace binpick::vision {
namespace {
constexpr double kClaimedMax = 0.5;
constexpr double kOnePlaceDiameters = 0.06;
constexpr const char* kExplained = "explained by a better one";
/// A rival has to speak of mostly the same pixels.
constexpr double kRivalShare = 0.6;

std::string percent(const char* text, double share) {
  std::array<char, 100> line{};
  std::snprintf(line.data(), line.size(), text, 100 * share);
  return line.data();
}

/// What speaks most against a pose that is not believed.
std::string what_speaks_against(const DenseTest& test) {
  constexpr float kVisibleMin = 0.2F, kContradictedMax = 0.15F, kEdgeRatioMin = 0.5F, kNormalAgreementMin = 0.6F,
                  kBendAgreementMin = 0.1F;
  if (test.explained == 0 || test.evidence <= 0) return "more contradicted than explained";
  if (test.visible_fraction() < kVisibleMin) return percent("mostly hidden (%.0f %% seen)", test.visible_fraction());
  if (test.contradicted_ratio() > kContradictedMax)
    return percent("free space seen through it (%.0f %%)", test.contradicted_ratio());
  if (test.edge_ratio() < kEdgeRatioMin) return percent("edges missing (%.0f %%)", 1 - test.edge_ratio());
  if (test.normal_agreement < kNormalAgreementMin)
    return percent("normals disagree (%.0f %%)", 1 - test.normal_agreement);
  if (test.bend_agreement < kBendAgreementMin) return "curvature disagrees";
  return "too little evidence";
}

/// A candidate on the picture.
struct Shown {
  Template drawn;
  std::vector<PixelState> states;  ///< Empty: not drawn yet.
};

class Selecting {
 public:
  Selecting(const Scene& scene, const Rasteriser& part, const Symmetry& symmetry, std::vector<Candidate> candidates,
            const SelectOptions& options)
      : scene_{scene},
        part_{part},
        symmetry_{symmetry},
        options_{options},
        candidates_{std::move(candidates)},
        owner_{Grid<std::int32_t>::Constant(scene.rows(), scene.cols(), -1)},
        content_px_{std::max(1.0, options.content.cast<double>().sum())} {
    BINPICK_CHECK(options.content.rows() == scene.rows() && options.content.cols() == scene.cols());
    std::stable_sort(candidates_.begin(), candidates_.end(),
                     [](const Candidate& a, const Candidate& b) { return a.test.evidence > b.test.evidence; });
    for (const Candidate& c : candidates_) {
      centres_.push_back(c.pose.R * options.centroid_mm + c.pose.t);
      std::string reason = options.outside ? options.outside(c.pose) : "";
      if (reason.empty() && score_by_itself(c.evidence) < options.score_min) reason = what_speaks_against(c.test);
      own_reasons_.push_back(std::move(reason));
    }
    shown_.resize(candidates_.size());
  }

  std::vector<Selected> run() {
    show_likely();
    for (std::size_t i = 0; i < candidates_.size(); ++i) judge(i);
    tell_known();
    for (Selected& entry : all_) entry.score = score_of(entry.candidate.evidence);
    std::stable_sort(all_.begin(), all_.end(), [](const Selected& a, const Selected& b) { return a.score > b.score; });
    return std::move(all_);
  }

 private:
  struct Standing {
    std::size_t candidate, selected;
  };

  bool same(std::size_t a, std::size_t b) const {
    return (centres_[a] - centres_[b]).norm() < static_cast<float>(options_.same_mm) &&
           displacement_mm(candidates_[a].pose, candidates_[b].pose, symmetry_, options_.radius_mm) < options_.same_mm;
  }

  /// Two bodies have no centre in common: one glance at the centres tells that this is another pose of the same object.
  bool in_one_place(std::size_t a, std::size_t b) const {
    return (centres_[a] - centres_[b]).norm() < static_cast<float>(kOnePlaceDiameters * options_.diameter_mm);
  }

  void show(std::size_t i) {
    const Pose& pose = candidates_[i].pose;
    part_.draw(pose.R, pose.t, scene_.pixel_mm, scene_.origin_mm, shown_[i].drawn);
    compare(scene_, part_, pose, shown_[i].drawn, shown_[i].states);
  }

  /// Those that will most likely be asked for, by all threads; the others are drawn when they are.
  void show_likely() {
    std::vector<std::size_t> likely;
    for (std::size_t i = 0; i < candidates_.size(); ++i)
      if (own_reasons_[i].empty() && std::none_of(likely.begin(), likely.end(), [&](std::size_t other) {
            return in_one_place(other, i) || same(other, i);
          }))
        likely.push_back(i);
    share(options_.threads, likely.size(), Deadline{}, [&](std::size_t k, int) { show(likely[k]); });
  }

  template <class Work>
  void for_explained(const Shown& shown, const Work& work) {
    const Template& t = shown.drawn;
    for (int r = 0; r < t.rows; ++r)
      for (int c = 0; c < t.cols; ++c)
        if (shown.states[t.at(r, c)] == PixelState::Explained) work((r + t.row0) * scene_.cols() + c + t.col0);
  }

  void judge(std::size_t i) {
    if (std::any_of(standing_.begin(), standing_.end(), [&](const Standing& s) { return same(s.candidate, i); }))
      return;
    Selected entry{.candidate = candidates_[i], .reason = own_reasons_[i]};
    if (entry.reason.empty()) {
      if (const auto there = std::find_if(standing_.begin(), standing_.end(),
                                          [&](const Standing& s) { return in_one_place(s.candidate, i); });
          options_.explain_away && there != standing_.end()) {
        add_rival(*there, entry);
        entry.candidate.evidence[Clue::Claimed] = 1;
        entry.reason = kExplained;
      } else {
        if (shown_[i].states.empty()) show(i);
        compare_with_standing(i, entry);
      }
      entry.overshadowed = !entry.reason.empty();
      if (entry.reason.empty() && score_by_itself(entry.candidate.evidence) < options_.score_min)
        entry.reason = what_speaks_against(entry.candidate.test);
    }
    if (entry.reason.empty()) {
      int explained = 0, aside = 0;
      for_explained(shown_[i], [&](std::int32_t pixel) {
        std::int32_t& owner = owner_.data()[pixel];
        if (owner >= 0) return;
        owner = static_cast<std::int32_t>(standing_.size());
        ++explained;
        aside += options_.content.data()[pixel] == 0;
      });
      Evidence& evidence = entry.candidate.evidence;
      evidence[Clue::Extent] = static_cast<float>(explained);
      // What lies low is content as far as it is believed to be the part.
      content_px_ += score_by_itself(evidence) * aside;
      standing_.push_back({i, all_.size()});
    }
    all_.push_back(std::move(entry));
  }

  void tell_known() {
    double known_px = 0;
    for (const Selected& entry : all_)
      if (const Evidence& e = entry.candidate.evidence; e[Clue::Extent] > 0)
        known_px += score_by_itself(e) * static_cast<double>(e[Clue::Extent]);
    for (Selected& entry : all_) {
      Evidence& e = entry.candidate.evidence;
      e[Clue::Extent] = static_cast<float>(static_cast<double>(e[Clue::Extent]) / content_px_);
      if (options_.ask_known) e[Clue::Known] = static_cast<float>(known_px / content_px_);
    }
  }

  void add_rival(const Standing& standing, const Selected& entry) {
    Candidate& better = all_[standing.selected].candidate;
    float& rival = better.evidence[Clue::Rival];
    rival = std::max(rival, entry.candidate.test.evidence / better.test.evidence);
  }

  /// What better ones take from it.
  void compare_with_standing(std::size_t i, Selected& entry) {
    std::vector<int> claims(standing_.size(), 0);
    int explained = 0, claimed = 0;
    for_explained(shown_[i], [&](std::int32_t pixel) {
      const std::int32_t owner = owner_.data()[pixel];
      ++explained;
      if (owner < 0) return;
      ++claimed;
      ++claims[static_cast<std::size_t>(owner)];
    });
    for (std::size_t s = 0; s < standing_.size(); ++s) {
      const float share = static_cast<float>(claims[s]) / static_cast<float>(std::max(1, explained));
      if (share > kRivalShare) add_rival(standing_[s], entry);
    }
    Evidence& evidence = entry.candidate.evidence;
    evidence[Clue::Claimed] = static_cast<float>(claimed) / static_cast<float>(std::max(1, explained));
    if (options_.explain_away && evidence[Clue::Claimed] > kClaimedMax) entry.reason = kExplained;
  }

  const Scene& scene_;
  const Rasteriser& part_;
  const Symmetry& symmetry_;
  const SelectOptions& options_;
  std::vector<Candidate> candidates_;  // strongest first
  std::vector<Eigen::Vector3f> centres_;
  std::vector<std::string> own_reasons_;
  std::vector<Shown> shown_;
  std::vector<Standing> standing_;
  std::vector<Selected> all_;
  Grid<std::int32_t> owner_;  // of each pixel: who of those standing explains it first
  double content_px_;         // what lies in the supply, and what those standing explain besides
};
}  // namespace

double displacement_mm(const Pose& a, const Pose& b, const Symmetry& symmetry, double radius_mm) {
  const PoseDistance distance = pose_distance(a.iso(), b.iso(), symmetry, radius_mm);
  const double turn = 2 * std::sin(0.5 * distance.angle_rad) * radius_mm;
  return std::hypot(distance.centroid_mm, std::sqrt(2.0 / 3.0) * turn);
}

std::vector<Selected> select(const Scene& scene, const Rasteriser& part, const Symmetry& symmetry,
                             std::vector<Candidate> candidates, const SelectOptions& options) {
  return Selecting{scene, part, symmetry, std::move(candidates), options}.run();
}
}  // namespace binpick::vision
