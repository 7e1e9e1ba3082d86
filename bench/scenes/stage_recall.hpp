#pragma once

#include <span>
#include <string>
#include <utility>
#include <vector>

#include "bench/scenes/judge.hpp"
#include "vision/detector.hpp"

namespace binpick::bench {
/// Asks after each stage of detection how near the nearest pose still alive is to each truth.
class StageRecall {
 public:
  StageRecall(const Judge& judge, std::span<const Truth> truths, const vision::KnowledgeBase& base);

  void operator()(const vision::StageSurvivors& alive);
  /// In part diameters; kFar where nothing is near.
  const std::vector<std::pair<std::string, std::vector<double>>>& nearest() const { return nearest_; }
  static constexpr double kFar = 9;

 private:
  const Judge& judge_;
  std::span<const Truth> truths_;
  const vision::KnowledgeBase& base_;
  std::vector<std::pair<std::string, std::vector<double>>> nearest_;
};
}  // namespace binpick::bench
