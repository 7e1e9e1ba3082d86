#pragma once

#include <optional>
#include <string>

#include "base/expected.hpp"
#include "vision/detector.hpp"
#include "vision/grasp.hpp"

namespace binpick::vision {
/// How a report is drawn.
struct DrawStyle {
  int width_min_px = 1200;
  int pen = 1;                            ///< Times as thick, for a picture that will be shown smaller.
  bool words = true;                      ///< Scores, rejected objects with their reasons, and a legend.
  bool noise = true;                      ///< Not: the relief is that of the heights\' medians over 5 × 5 pixels.
  std::optional<double> height_max_mm{};  ///< Over the floor, in the brightest colour; by default that of this picture.
};

/// PNG of the depth image, shaded, with the outlines of the detected objects drawn over it (coloured by score, the
/// chosen one thick, with the gripper where it is known), rejected ones dashed with their reason. Returns what went
/// wrong as text.
Expected<void, std::string> draw_report(const std::string& png_path, const DepthImage& image, const KnowledgeBase& part,
                                        const DetectionReport& report, const Reachable* chosen = nullptr,
                                        const Gripper* gripper = nullptr, const Grasp* grasp = nullptr,
                                        const DrawStyle& style = {});
}  // namespace binpick::vision
