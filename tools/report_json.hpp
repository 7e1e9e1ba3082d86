#pragma once

#include <nlohmann/json.hpp>
#include <string>

#include "vision/detector.hpp"

namespace binpick::tools {
/// Row by row.
nlohmann::json rows_of(const Eigen::MatrixXd& matrix);
/// A detection's report as other programs read it.
nlohmann::json to_json(const std::string& part, const vision::DetectionReport& report);
}  // namespace binpick::tools
