#pragma once

#include <string>

#include "base/expected.hpp"
#include "vision/detector.hpp"
#include "vision/grasp.hpp"

namespace binpick::vision {
/// PNG of the depth image, shaded, with the outlines of the detected objects drawn over it (coloured by score, the
/// chosen one thick, with the gripper where it is known), rejected ones dashed with their reason. Returns what went
/// wrong as text.
Expected<void, std::string> draw_report(const std::string& png_path, const DepthImage& image, const KnowledgeBase& part,
                                        const DetectionReport& report, const Reachable* chosen = nullptr,
                                        const Gripper* gripper = nullptr, const Grasp* grasp = nullptr);
}  // namespace binpick::vision
