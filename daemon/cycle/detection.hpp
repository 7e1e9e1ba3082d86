#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "daemon/cycle/cell_data.hpp"
#include "vision/depth_image.hpp"
#include "vision/detector.hpp"
#include "vision/fill_level.hpp"
#include "vision/footprint.hpp"
#include "vision/grasp.hpp"
#include "vision/supply_place.hpp"

namespace binpick::daemon {
/// One scan to look through. Owns all it names: it is moved to the vision worker.
struct DetectRequest {
  std::uint64_t cycle_id = 0;
  vision::DepthImage image;
  /// Where the supply has to be located first: the scan's points in its frame as configured. The image is made of them.
  std::vector<Eigen::Vector3f> points_said_mm;
  std::shared_ptr<const CellData> cell;
  std::size_t supply = 0;  ///< Index into the configuration's supplies.
  std::size_t recipe = 0;  ///< Index into its recipes.
};

struct DetectResult {
  std::uint64_t cycle_id = 0;      ///< A result of an abandoned cycle is dropped by it.
  vision::DetectionReport report;  ///< Only detections that reach the recipe's score_min stay in `detections`.
  vision::GraspChoice choice;
  /// Of each detection: what it covers of the floor, and the middle of its surface (supply frame).
  std::vector<vision::Footprint> footprints;
  std::vector<Eigen::Vector3d> centres_mm;
  double part_width_mm = 0;  ///< The part's smallest extent along its own axes.
  vision::FillLevel fill;
  /// Where the supply was located: all poses here are in its frame as found.
  vision::SupplyPlace place;
  std::string not_located;    ///< Not empty: why it was not; nothing else is valid.
  std::string loops;          ///< The inner loops it ran on, by name: others differ in the last digits.
  bool supply_empty = false;  ///< Nothing lies in the supply that could be a part.
  std::string error;          ///< Not empty: detection itself failed; nothing else is valid.
};

/// The whole of a cycle's vision, from depth image to reachable grasps. Pure but for the image of a supply that has to
/// be located; long; called by the vision worker. What a library throws becomes `error`.
DetectResult run_detection(DetectRequest& request) noexcept;
}  // namespace binpick::daemon
