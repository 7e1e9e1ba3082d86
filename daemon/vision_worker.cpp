#include "daemon/vision_worker.hpp"

#include <cstdio>
#include <exception>
#include <map>
#include <string>
#include <utility>

#include "base/log.hpp"
#include "daemon/spare_memory.hpp"
#include "vision/draw.hpp"

namespace binpick::daemon {
namespace {
/// So long after a scan its answer is with the robot, and the next sweep takes longer than to give memory back.
constexpr std::chrono::milliseconds kQuiet{500};

/// Pictures are numbered by cycle; a picture that cannot be made never costs a cycle.
void draw(const DetectRequest& request, const DetectResult& result) noexcept {
  const auto& dir = request.cell->config.picture_dir;
  if (dir.empty() || !result.error.empty() || !result.not_located.empty()) return;
  try {
    char name[32];
    std::snprintf(name, sizeof name, "/cycle-%06llu.png", static_cast<unsigned long long>(request.cycle_id));
    const auto* chosen = result.choice.reachable.empty() ? nullptr : &result.choice.reachable.front();
    const auto& part = request.cell->config.recipes[request.recipe].part;
    const auto drawn = vision::draw_report(dir + name, request.image, request.cell->knowledge_bases[request.recipe],
                                           result.report, chosen, part.gripper ? &*part.gripper : nullptr,
                                           chosen != nullptr ? &part.grasps[chosen->grasp] : nullptr);
    if (!drawn) BINPICK_LOG(Warning, "vision", "no picture: %s", drawn.error().c_str());
  } catch (const std::exception& failure) {
    BINPICK_LOG(Warning, "vision", "no picture: %s", failure.what());
  }
}
/// One line for each grasp of each object: in how many poses it was tried in vain, and why in the best of them.
void tell_rejected(const DetectRequest& request, const DetectResult& result) {
  const auto& rejected = result.choice.rejected;
  const auto& grasps = request.cell->config.recipes[request.recipe].part.grasps;
  std::map<std::pair<std::size_t, std::size_t>, std::pair<int, const vision::RejectedGrasp*>> of;
  for (const auto& one : rejected) {
    auto& [count, last] = of[{one.detection, one.grasp}];
    ++count;
    if (last == nullptr || one.why > last->why) last = &one;
  }
  for (const auto& [which, told] : of)
    BINPICK_LOG(Debug, "vision", "cycle %llu: object %zu, grasp %zu \"%s\": %d rejected, %s",
                static_cast<unsigned long long>(request.cycle_id), which.first, which.second,
                grasps[which.second].name.c_str(), told.first, to_string(*told.second).c_str());
}
}  // namespace

VisionWorker::VisionWorker(std::function<void()> wake_loop)
    : wake_loop_{std::move(wake_loop)}, thread_{[this] { work(); }} {}

VisionWorker::~VisionWorker() { requests_.close(); }

bool VisionWorker::post(DetectRequest request) { return requests_.try_push(std::move(request)); }

std::optional<DetectResult> VisionWorker::take_result() { return results_.try_pop(); }

void VisionWorker::work() {
  bool looked = false;  // since memory was given back
  while (!requests_.closed()) {
    auto request = requests_.pop_for(kQuiet);
    ++progress_;
    if (!request) {
      if (std::exchange(looked, false)) give_back_spare_memory();
      continue;
    }
    busy_ = looked = true;
    DetectResult result = run_detection(*request);
    DetectResult to_draw = result;
    // The loop takes results faster than detections are made; a full box means that nobody listens any more.
    if (!results_.try_push(std::move(result))) BINPICK_LOG(Error, "vision", "a result found no taker");
    wake_loop_();
    tell_rejected(*request, to_draw);
    draw(*request, to_draw);
    busy_ = false;
  }
}
}  // namespace binpick::daemon
