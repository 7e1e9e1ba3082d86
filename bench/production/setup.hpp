#pragma once

#include <Eigen/Core>
#include <memory>
#include <string>
#include <vector>

#include "bench/production/figures.hpp"
#include "daemon/cycle/cell_data.hpp"
#include "tests/emulators/robot/robot.hpp"
#include "tests/emulators/world/example_parts.hpp"

/// The cells of the production run: each part in the supply and under the scanner of its class.
namespace binpick::bench {
struct ProductionPart {
  std::string name;
  std::string scanner;        ///< scanner.model.
  Eigen::Vector3d supply_mm;  ///< Inner size.
  int objects = 30;           ///< In a full one.
  double height_mm = 0;       ///< Of the pivot over the supply's floor.
  double sweep_deg = 0;       ///< To either side.
  double sweep_deg_s = 0;
  double line_deg = 0;                 ///< Of an LMS 400, to either side.
  double wrong_mm = 0, wrong_deg = 0;  ///< A pose sent that is further off than either is wrong.
  bool is_located = false;             ///< By its rim, in every scan.
};
const std::vector<ProductionPart>& production_parts();
/// The same under a wider scan: the rim is seen wherever the supply stands within 80 mm and 10 degrees of its place.
ProductionPart to_be_located(ProductionPart part);

/// 1 m/s and 3 m/s² over 1.5 m beside the supply and 0.5 m up and down, 0.25 m/s on the last 120 mm to the grasp.
RobotModel robot_model();
emulators::RobotOptions robot_options(const RobotModel& model);

/// Writes part and cell file into `folder`, trains what is not trained there yet, and loads it; a cell with
/// a folder for `records` makes them. Throws std::runtime_error.
std::shared_ptr<const daemon::CellData> load_production_cell(const ProductionPart& part, const std::string& folder,
                                                             int threads, const std::string& records = {});
}  // namespace binpick::bench
