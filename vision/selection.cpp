#include "vision/selection.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>

namespace binpick::vision {
namespace {
constexpr double kClaimedMax = 0.5;
constexpr double kInsideMax = 0.12;
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

/// Columns in which both bodies claim the same room, over the columns of the smaller.
double shared_room(const Template& a, const Template& b, float depth_mm) {
  const int row_first = std::max(a.row0, b.row0), row_last = std::min(a.row0 + a.rows, b.row0 + b.rows);
  const int col_first = std::max(a.col0, b.col0), col_last = std::min(a.col0 + a.cols, b.col0 + b.cols);
  if (row_first >= row_last || col_first >= col_last) return 0;
  int shared = 0;
  for (int r = row_first; r < row_last; ++r)
    for (int c = col_first; c < col_last; ++c) {
      const std::size_t i = a.at(r - a.row0, c - a.col0), j = b.at(r - b.row0, c - b.col0);
      if (a.triangle[i] < 0 || b.triangle[j] < 0) continue;
      shared += std::min(a.top_mm[i], b.top_mm[j]) - std::max(a.bottom_mm[i], b.bottom_mm[j]) > depth_mm;
    }
  const auto columns = [](const Template& t) {
    return std::count_if(t.triangle.begin(), t.triangle.end(), [](std::int32_t k) { return k >= 0; });
  };
  return static_cast<double>(shared) /
         static_cast<double>(std::max<std::ptrdiff_t>(1, std::min(columns(a), columns(b))));
}
}  // namespace

double displacement_mm(const Candidate& a, const Candidate& b, const Symmetry& symmetry, double radius_mm) {
  const PoseDistance distance = pose_distance(a.pose.iso(), b.pose.iso(), symmetry, radius_mm);
  const double turn = 2 * std::sin(0.5 * distance.angle_rad) * radius_mm;
  return std::hypot(distance.centroid_mm, std::sqrt(2.0 / 3.0) * turn);
}

std::vector<Selected> select(const Scene& scene, const Rasteriser& part, const Symmetry& symmetry,
                             std::vector<Candidate> candidates, const SelectOptions& options) {
  std::stable_sort(candidates.begin(), candidates.end(),
                   [](const Candidate& a, const Candidate& b) { return a.test.evidence > b.test.evidence; });
  struct Standing {
    std::size_t selected;
    Template drawn;
  };
  std::vector<Standing> standing;
  std::vector<Selected> all;
  std::vector<PixelState> states;
  Grid<std::int32_t> owner = Grid<std::int32_t>::Constant(scene.rows(), scene.cols(), -1);
  const auto room_mm = static_cast<float>(2 * tolerance_of(scene) + 0.01 * options.diameter_mm);

  for (Candidate& candidate : candidates) {
    const bool again = std::any_of(standing.begin(), standing.end(), [&](const Standing& s) {
      return displacement_mm(all[s.selected].candidate, candidate, symmetry, options.radius_mm) < options.same_mm;
    });
    if (again) continue;
    Selected entry{candidate, 0, options.outside ? options.outside(candidate.pose) : "", false};
    if (entry.reason.empty() && score_of(candidate.evidence) < options.score_min)
      entry.reason = what_speaks_against(candidate.test);
    if (!entry.reason.empty()) {
      all.push_back(std::move(entry));
      continue;
    }
    Template drawn;
    part.draw(candidate.pose.R, candidate.pose.t, scene.pixel_mm, scene.origin_mm, drawn);
    compare(scene, part, candidate.pose, drawn, states);
    std::vector<int> claims(standing.size(), 0);
    int explained = 0, claimed = 0;
    for (int r = 0; r < drawn.rows; ++r)
      for (int c = 0; c < drawn.cols; ++c) {
        if (states[drawn.at(r, c)] != PixelState::Explained) continue;
        ++explained;
        const std::int32_t other = owner(r + drawn.row0, c + drawn.col0);
        if (other < 0) continue;
        ++claimed;
        ++claims[static_cast<std::size_t>(other)];
      }
    for (std::size_t s = 0; s < standing.size(); ++s) {
      const float share = static_cast<float>(claims[s]) / static_cast<float>(std::max(1, explained));
      Candidate& better = all[standing[s].selected].candidate;
      if (share > kRivalShare)
        better.evidence[Clue::Rival] =
            std::max(better.evidence[Clue::Rival], candidate.test.evidence / better.test.evidence);
      if (options.rooms && entry.reason.empty() && share <= kClaimedMax &&
          shared_room(standing[s].drawn, drawn, room_mm) > kInsideMax)
        entry.reason = "stands inside a better one";
    }
    Evidence& evidence = entry.candidate.evidence;
    evidence[Clue::Claimed] = static_cast<float>(claimed) / static_cast<float>(std::max(1, explained));
    if (options.explain_away && evidence[Clue::Claimed] > kClaimedMax) entry.reason = "explained by a better one";
    entry.overshadowed = !entry.reason.empty();
    if (entry.reason.empty() && score_of(evidence) < options.score_min)
      entry.reason = what_speaks_against(entry.candidate.test);
    if (entry.reason.empty()) {
      for (int r = 0; r < drawn.rows; ++r)
        for (int c = 0; c < drawn.cols; ++c)
          if (states[drawn.at(r, c)] == PixelState::Explained) {
            std::int32_t& at = owner(r + drawn.row0, c + drawn.col0);
            if (at < 0) at = static_cast<std::int32_t>(standing.size());
          }
      standing.push_back({all.size(), std::move(drawn)});
    }
    all.push_back(std::move(entry));
  }
  for (Selected& entry : all) entry.score = score_of(entry.candidate.evidence);
  std::stable_sort(all.begin(), all.end(), [](const Selected& a, const Selected& b) { return a.score > b.score; });
  return all;
}
}  // namespace binpick::vision
