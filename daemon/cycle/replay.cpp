#include "daemon/cycle/replay.hpp"

#include <algorithm>
#include <cinttypes>
#include <cstdio>
#include <cstring>

#include "daemon/cycle/scan_picture.hpp"

namespace binpick::daemon {
namespace {
template <class... Values>
std::string line(const char* format, Values... values) {
  char text[400];
  std::snprintf(text, sizeof text, format, values...);
  return text;
}

/// The knowledge base of the recipe, which must be the recorded one unless another is asked for.
Expected<vision::KnowledgeBase, std::string> open_base(const Record& record, const config::Recipe& recipe,
                                                       std::size_t index, const ReplayChanges& changes) {
  const std::string& path = changes.knowledge_base.empty() ? recipe.knowledge_base : changes.knowledge_base;
  const std::string remedy =
      "; give it by --knowledge-base, or make it with: binpick train " + recipe.part.path + " -o " + path;
  auto base = vision::KnowledgeBase::open(path);
  if (base)
    if (const auto whole = base->verify(); !whole) base = unexpected(whole.error());
  if (!base) return unexpected(base.error().text + remedy);
  const std::uint64_t then =
      index < record.cell.knowledge_bases.size() ? record.cell.knowledge_bases[index].checksum : 0;
  if (changes.knowledge_base.empty() && changes.part.empty() && base->checksum() != then)
    return unexpected(line("knowledge base %s is not the one of the record (checksum %016" PRIx64 ", then %016" PRIx64
                           ")",
                           path.c_str(), base->checksum(), then) +
                      "; give that one by --knowledge-base, or this one to see what it would have found");
  return *base;
}

Expected<std::shared_ptr<const CellData>, std::string> cell_of(const Record& record, const RecordedRequest& request,
                                                               const ReplayChanges& changes) {
  auto config = config::load_texts(record.cell.cell, record.cell.parts);
  if (!config)
    return unexpected("its configuration is not understood by this binpick: " + config.error().front().message);
  if (request.supply >= config->supplies.size() || request.recipe >= config->recipes.size())
    return unexpected(std::string{"its request names a supply or part that its configuration does not have"});
  auto& recipe = config->recipes[request.recipe];
  if (!changes.part.empty()) {
    auto part = config::load_part(changes.part);
    if (!part)
      return unexpected(changes.part +
                        " is not a good part file: " + (part.error().empty() ? "" : part.error().front().message));
    recipe.part = std::move(*part);
  }
  auto base = open_base(record, recipe, request.recipe, changes);
  if (!base) return unexpected(base.error());
  auto cell = std::make_shared<CellData>();
  cell->config = std::move(*config);
  // What came first on that day's clock is no property of the scan.
  cell->config.detection.deadline = std::chrono::hours(24);
  cell->knowledge_bases.assign(cell->config.recipes.size(), *base);  // only the recipe's own is looked at
  return std::shared_ptr<const CellData>{std::move(cell)};
}

/// To the last bit; what is no number is the same as another that is none.
bool same(double a, double b) { return std::memcmp(&a, &b, sizeof a) == 0 || a == b; }
template <class A, class B>
bool same_values(const A& a, const B& b) {
  return std::equal(std::begin(a), std::end(a), std::begin(b), std::end(b),
                    [](double x, double y) { return same(x, y); });
}
bool same(const Eigen::Isometry3d& a, const Eigen::Isometry3d& b) {
  return same_values(a.matrix().reshaped(), b.matrix().reshaped());
}
bool same(const vision::Evidence& a, const vision::Evidence& b) { return same_values(a.clues, b.clues); }
bool same(const vision::Detection& a, const vision::Detection& b) {
  return same(a.T_supply_object.iso, b.T_supply_object.iso) && same(a.score, b.score) &&
         same(a.visible_fraction, b.visible_fraction) &&
         same_values(a.covariance.reshaped(), b.covariance.reshaped()) && same(a.evidence, b.evidence);
}
bool same(const vision::Rejection& a, const vision::Rejection& b) {
  return same(a.T_supply_object.iso, b.T_supply_object.iso) && same(a.score, b.score) && same(a.evidence, b.evidence) &&
         a.reason == b.reason;
}
/// Earlier records do not hold where the part was lifted to.
bool is_recorded(const Eigen::Isometry3d& T_supply_retreat) {
  return T_supply_retreat.matrix() != Eigen::Matrix4d::Identity();
}
/// `a` is the recorded one.
bool same(const vision::Reachable& a, const vision::Reachable& b) {
  return a.detection == b.detection && a.grasp == b.grasp && same(a.T_supply_grasp.iso, b.T_supply_grasp.iso) &&
         same(a.T_supply_approach.iso, b.T_supply_approach.iso) &&
         (!is_recorded(a.T_supply_retreat.iso) || same(a.T_supply_retreat.iso, b.T_supply_retreat.iso));
}
bool same(const vision::Unreachable& a, const vision::Unreachable& b) {
  return a.detection == b.detection && a.reason == b.reason;
}

std::string in_words(const vision::Detection& d) {
  const Eigen::Vector3d t = d.T_supply_object.iso.translation();
  return line("score %.3f at %.1f %.1f %.1f", d.score, t.x(), t.y(), t.z());
}
std::string in_words(const vision::Rejection& r) { return r.reason; }
std::string in_words(const vision::Reachable& r) {
  const Eigen::Vector3d t = r.T_supply_grasp.iso.translation();
  return line("grasp %zu of object %zu at %.1f %.1f %.1f", r.grasp + 1, r.detection + 1, t.x(), t.y(), t.z());
}
std::string in_words(const vision::Unreachable& u) { return line("object %zu: ", u.detection + 1) + u.reason; }

template <class Item>
void compare(const char* what, const std::vector<Item>& then, const std::vector<Item>& now,
             std::vector<std::string>& lines) {
  if (then.size() != now.size()) lines.push_back(line("%s: %zu then, %zu now", what, then.size(), now.size()));
  for (std::size_t i = 0; i < std::min(then.size(), now.size()); ++i) {
    if (same(then[i], now[i])) continue;
    const std::string before = in_words(then[i]), after = in_words(now[i]);
    lines.push_back(line("%s %zu: ", what, i + 1) +
                    (before == after ? before + ", in its last digits" : before + " then, " + after + " now"));
  }
}
}  // namespace

Expected<Replayed, std::string> replay(const Record& record, const ReplayChanges& changes) {
  if (!record.request) return unexpected(std::string{"holds no request: it is of binpick scan, not of a cycle"});
  if (record.scan_of_cycle)
    return unexpected(line("was answered from the scan of cycle %" PRIu64 "; replay that one", *record.scan_of_cycle));
  if (!record.scan || record.scan->profiles.empty())
    return unexpected(std::string{"holds no scan: the cycle ended before its sweep"});
  auto cell = cell_of(record, *record.request, changes);
  if (!cell) return unexpected(cell.error());
  ScanPicture picture{std::move(*cell), record.request->supply, record.request->recipe};
  for (const auto& registered : record.scan->profiles) picture.add(registered);
  Replayed replayed;
  replayed.request = picture.take_request(record.origin.cycle_id);
  replayed.result = run_detection(replayed.request);
  return replayed;
}

std::vector<std::string> differences(const DetectResult& recorded, const DetectResult& now) {
  std::vector<std::string> lines;
  const auto text = [&](const char* what, const std::string& a, const std::string& b) {
    if (a != b) lines.push_back(std::string{what} + ": \"" + a + "\" then, \"" + b + "\" now");
  };
  text("failure", recorded.error, now.error);
  text("supply not located", recorded.not_located, now.not_located);
  if (!same(recorded.place.T_said_found, now.place.T_said_found))
    lines.emplace_back("the supply was located elsewhere");
  compare("detection", recorded.report.detections, now.report.detections, lines);
  compare("reachable", recorded.choice.reachable, now.choice.reachable, lines);
  compare("not reachable", recorded.choice.unreachable, now.choice.unreachable, lines);
  compare("rejected", recorded.report.rejected, now.report.rejected, lines);
  if (recorded.report.maxima != now.report.maxima || recorded.report.hypotheses != now.report.hypotheses)
    lines.push_back(line("%zu maxima and %zu hypotheses then, %zu and %zu now", recorded.report.maxima,
                         recorded.report.hypotheses, now.report.maxima, now.report.hypotheses));
  if (!same(recorded.fill.share, now.fill.share) || !same(recorded.fill.occupied_mm2, now.fill.occupied_mm2) ||
      recorded.supply_empty != now.supply_empty)
    lines.push_back(line("fill level %.1f %% then, %.1f %% now", 100 * recorded.fill.share, 100 * now.fill.share));
  return lines;
}
}  // namespace binpick::daemon
