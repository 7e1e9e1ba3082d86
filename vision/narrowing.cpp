#include "vision/narrowing.hpp"

#include <algorithm>
#include <cmath>
#include <unordered_map>
#include <utility>

namespace binpick::vision {
namespace {
/// Two hypotheses are one if their centres and rotations are no further apart than this: first as they are proposed,
constexpr double kThinDiameters = 0.06, kThinGaps = 2.0;
/// then once they are refined (surface displacement).
constexpr double kSameDiameters = 0.04;
constexpr double kPlaceDiameters = 0.15;
/// Samples of the first steps of refinement.
constexpr std::size_t kQuickSurface = 64, kQuickEdges = 24, kAll = 1000;
}  // namespace

float Narrowing::place_mm() const { return static_cast<float>(kPlaceDiameters * part_.diameter_mm); }

std::vector<Hypothesis> Narrowing::thinned(std::vector<Hypothesis> hypotheses) const {
  std::stable_sort(hypotheses.begin(), hypotheses.end(), stronger);
  const auto cell_mm = static_cast<float>(kThinDiameters * part_.diameter_mm);
  const auto same_turn = static_cast<float>(std::cos(0.5 * kThinGaps * part_.rotation_gap_rad));
  struct Kept {
    Eigen::Vector3f centre;
    Eigen::Quaternionf turn;
  };
  std::unordered_map<std::uint64_t, std::vector<Kept>> cells;
  const auto key_of = [](const Eigen::Array3i& cell) {
    constexpr std::uint64_t kBits = 21, kMask = (1U << kBits) - 1;
    const Eigen::Array<std::uint64_t, 3, 1> bits = (cell + (1 << (kBits - 1))).cast<std::uint64_t>();
    return (bits.x() & kMask) << (2 * kBits) | (bits.y() & kMask) << kBits | (bits.z() & kMask);
  };
  std::vector<Hypothesis> kept;
  for (Hypothesis& h : hypotheses) {
    const Eigen::Vector3f centre = centre_of(h.pose);
    const Eigen::Quaternionf& turn = part_.views[h.view].R_supply_object;
    const Eigen::Array3i cell = (centre / cell_mm).array().floor().cast<int>();
    bool again = false;
    for (int k = 0; k < 27 && !again; ++k) {
      const auto it = cells.find(key_of(cell + Eigen::Array3i(k % 3 - 1, k / 3 % 3 - 1, k / 9 - 1)));
      if (it == cells.end()) continue;
      again = std::any_of(it->second.begin(), it->second.end(), [&](const Kept& other) {
        return std::abs(other.turn.dot(turn)) > same_turn && (other.centre - centre).norm() < cell_mm;
      });
    }
    if (again) continue;
    cells[key_of(cell)].push_back({centre, turn});
    kept.push_back(std::move(h));
  }
  return kept;
}

void Narrowing::nudge(std::vector<Hypothesis>& hypotheses, std::size_t best) const {
  const float tolerance = tolerance_of(scene_);
  RefineOptions options;
  options.gate_from_mm = std::max(3 * tolerance, static_cast<float>(0.06 * part_.diameter_mm));
  options.gate_to_mm = std::max(2 * tolerance, static_cast<float>(0.03 * part_.diameter_mm));
  options.edge_gate_from_px = finish_.edge_gate_px(6, 0.08);
  options.edge_gate_to_px = finish_.edge_gate_px(3, 0.03);
  const float edge_gate_to_px = options.edge_gate_to_px, gate_to_mm = options.gate_to_mm;
  const auto refine_all = [&](std::size_t surface_max, std::size_t edges_max, float evidence_mm) {
    share(threads_, hypotheses.size(), deadline_, [&](std::size_t i, int) {
      Hypothesis& h = hypotheses[i];
      refine(scene_, model_points(part_.views[h.view], h.pose, surface_max, edges_max), centre_of(h.pose), options,
             h.pose);
      h.evidence = sparse_evidence(scene_, part_, h.view, h.pose, evidence_mm, surface_max);
    });
  };
  options.steps = 2;
  options.gate_to_mm = 0.5F * (options.gate_from_mm + gate_to_mm);
  options.edge_gate_to_px = 0.5F * (options.edge_gate_from_px + edge_gate_to_px);
  refine_all(kQuickSurface, edges_ ? kQuickEdges : 0, 3 * tolerance);
  std::stable_sort(hypotheses.begin(), hypotheses.end(), stronger);
  if (hypotheses.size() > best)
    hypotheses.erase(hypotheses.begin() + static_cast<std::ptrdiff_t>(best), hypotheses.end());
  options.steps = 3;
  options.gate_from_mm = options.gate_to_mm;
  options.edge_gate_from_px = options.edge_gate_to_px;
  options.gate_to_mm = gate_to_mm;
  options.edge_gate_to_px = edge_gate_to_px;
  refine_all(kAll, edges_ ? kAll : 0, 2 * tolerance);
}

std::vector<Hypothesis> Narrowing::distinct(std::vector<Hypothesis> hypotheses, std::size_t most,
                                            std::size_t crowd) const {
  std::stable_sort(hypotheses.begin(), hypotheses.end(), stronger);
  const double same_mm = kSameDiameters * part_.diameter_mm;
  const float crowd_mm = place_mm();
  std::vector<Hypothesis> kept;
  std::vector<Eigen::Vector3f> centres;
  for (const Hypothesis& h : hypotheses) {
    if (kept.size() >= most || h.evidence <= 0) break;
    const Eigen::Vector3f centre = centre_of(h.pose);
    bool again = false;
    std::size_t near = 0;
    for (std::size_t k = 0; k < kept.size() && !again; ++k) {
      const float apart = (centres[k] - centre).norm();
      near += apart < crowd_mm;
      again = apart < same_mm && displacement_mm(kept[k].pose, h.pose, part_.symmetry, finish_.radius_mm()) < same_mm;
    }
    if (again || near >= crowd) continue;
    kept.push_back(h);
    centres.push_back(centre);
  }
  return kept;
}

void Narrowing::look_at(std::vector<Hypothesis>& hypotheses, float share) const {
  constexpr float kTrace = 0.001F;
  std::vector<Pose> poses;
  for (const Hypothesis& h : hypotheses) poses.push_back(h.pose);
  const std::vector<float> seen = finish_.looked_at(poses);
  std::vector<Hypothesis> kept;
  for (std::size_t i = 0; i < hypotheses.size(); ++i) {
    Hypothesis& h = hypotheses[i];
    if (seen[i] < share * part_.views[h.view].area_mm2 / static_cast<float>(scene_.pixel_mm * scene_.pixel_mm))
      continue;
    // Refinement may mend what is more contradicted than explained: it comes last, but in its order.
    h.evidence = seen[i] > kTrace ? seen[i] : kTrace / (1 + kTrace - seen[i]);
    kept.push_back(h);
  }
  hypotheses = std::move(kept);
}
}  // namespace binpick::vision
