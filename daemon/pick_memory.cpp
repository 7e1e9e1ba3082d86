#include "daemon/pick_memory.hpp"

#include <algorithm>
#include <cstdio>

namespace binpick::daemon {
namespace {
/// Nearer than this share of its smallest extent, an object that was seen again is the same one.
constexpr double kSameShare = 0.5;
constexpr int kPicksMax = 2;  ///< Of one object that fail, before it is left alone.
}  // namespace

void PickMemory::keep(const Place& place, DetectResult result, TimePoint scanned_at) {
  scans_[place.supply_id] = Scan{place.part_id, std::move(result), scanned_at, {}};
  auto& failures = failures_[place];
  std::erase_if(failures, [](Failure& failure) { return failure.scans_left-- <= 0; });
}

const PickMemory::Failure* PickMemory::failure_of(const Place& place, const Eigen::Vector3d& centre_mm) const {
  const auto known = failures_.find(place);
  if (known == failures_.end()) return nullptr;
  const Failure* most = nullptr;
  for (const Failure& failure : known->second)
    if ((failure.centre_mm - centre_mm).norm() < failure.radius_mm && (most == nullptr || failure.picks > most->picks))
      most = &failure;
  return most;
}

std::optional<PickMemory::Pick> PickMemory::next(const Place& place, const config::Picks& options,
                                                 TimePoint now) const {
  const auto kept = scans_.find(place.supply_id);
  if (kept == scans_.end() || kept->second.part_id != place.part_id) return std::nullopt;
  const Scan& scan = kept->second;
  const bool fresh = scan.picked.empty();
  if (!fresh &&
      (scan.picked.size() >= static_cast<std::size_t>(options.per_scan) || now - scan.at > options.scan_valid))
    return std::nullopt;
  const auto& footprints = scan.result.footprints;
  const auto touches = [&](std::size_t a, std::size_t b) {
    return a == b || vision::gap_mm(footprints[a], footprints[b]) < options.margin_mm;
  };
  // What touched a picked object may have moved, and with it what it lies on or leans on, from one to the next.
  std::vector<std::size_t> moved = scan.picked;
  for (std::size_t d = 0; d < footprints.size(); ++d)
    if (std::ranges::any_of(scan.picked, [&](std::size_t picked) { return touches(picked, d); })) moved.push_back(d);
  for (std::size_t k = 0; k < moved.size(); ++k)
    for (std::size_t d = 0; d < footprints.size(); ++d)
      if (vision::gap_mm(footprints[moved[k]], footprints[d]) <= 0 && std::ranges::find(moved, d) == moved.end())
        moved.push_back(d);
  const std::size_t left = scan.result.report.detections.size() - scan.picked.size() - 1;
  std::optional<Pick> again, last;
  for (std::size_t i = 0; i < scan.result.choice.reachable.size(); ++i) {
    const std::size_t detection = scan.result.choice.reachable[i].detection;
    if (std::ranges::any_of(moved, [&](std::size_t d) { return touches(d, detection); })) continue;
    const Failure* failure = failure_of(place, scan.result.centres_mm[detection]);
    if (failure == nullptr) return Pick{i, false, false, left};
    const vision::Reachable& reachable = scan.result.choice.reachable[i];
    if (!fresh || failure->picks >= kPicksMax) continue;
    const bool is_same = vision::is_same_way(reachable.T_supply_grasp, failure->T_supply_grasp);
    const bool other = reachable.other && is_same;
    // What was doubtful before it failed is hardly better the second time.
    const bool is_doubtful = reachable.covered_mm > 0 || reachable.is_aslant;
    std::optional<Pick>& place_in_line = is_doubtful ? last : again;
    if (!place_in_line && (other || !is_same || !is_doubtful)) place_in_line = Pick{i, true, other, left};
  }
  return again ? again : last;
}

void PickMemory::answered(const Place& place, const Pick& pick, std::uint16_t pick_id, const config::Picks& options) {
  Scan& scan = scans_.at(place.supply_id);
  const vision::Reachable& reachable = scan.result.choice.reachable[pick.reachable];
  scan.picked.push_back(reachable.detection);
  open_ = Open{pick_id, place,
               Failure{scan.result.centres_mm[reachable.detection],
                       pick.other ? reachable.other->T_supply_grasp : reachable.T_supply_grasp,
                       kSameShare * scan.result.part_width_mm, 1, options.failed_scans}};
}

void PickMemory::on_report(std::uint16_t pick_id, bool done, const config::Picks& options) {
  if (!open_ || open_->pick_id != pick_id) {
    if (!done) forget_scans();  // of a pick of long ago
    return;
  }
  const Open open = *std::exchange(open_, std::nullopt);
  if (done) return;
  scans_.erase(open.place.supply_id);
  auto& failures = failures_[open.place];
  const auto same = std::ranges::find_if(failures, [&](const Failure& failure) {
    return (failure.centre_mm - open.would_be.centre_mm).norm() < failure.radius_mm;
  });
  if (same == failures.end()) {
    if (options.failed_scans > 0) failures.push_back(open.would_be);
    return;
  }
  ++same->picks;
  same->scans_left = options.failed_scans;
  same->centre_mm = open.would_be.centre_mm;  // it was pushed, perhaps
  same->T_supply_grasp = open.would_be.T_supply_grasp;
}

std::vector<std::string> PickMemory::passed_over(const Place& place) const {
  std::vector<std::string> lines;
  const auto kept = scans_.find(place.supply_id);
  if (kept == scans_.end() || kept->second.part_id != place.part_id) return lines;
  const DetectResult& result = kept->second.result;
  for (const auto& reachable : result.choice.reachable) {
    const Failure* failure = failure_of(place, result.centres_mm[reachable.detection]);
    if (failure == nullptr) continue;
    char text[120];
    std::snprintf(text, sizeof text, "object %zu is passed over: %d pick%s of it failed", reachable.detection,
                  failure->picks, failure->picks == 1 ? "" : "s");
    lines.emplace_back(text);
  }
  return lines;
}

void PickMemory::forget(std::uint16_t supply_id) {
  scans_.erase(supply_id);
  std::erase_if(failures_, [&](const auto& known) { return known.first.supply_id == supply_id; });
}
}  // namespace binpick::daemon
