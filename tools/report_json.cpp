#include "tools/report_json.hpp"

namespace binpick::tools {
nlohmann::json rows_of(const Eigen::MatrixXd& matrix) {
  nlohmann::json rows = nlohmann::json::array();
  for (Eigen::Index r = 0; r < matrix.rows(); ++r) {
    nlohmann::json row = nlohmann::json::array();
    for (Eigen::Index c = 0; c < matrix.cols(); ++c) row.push_back(matrix(r, c));
    rows.push_back(row);
  }
  return rows;
}

namespace {
nlohmann::json to_json(const vision::Evidence& evidence) {
  nlohmann::json json;
  for (std::size_t k = 0; k < vision::kClueNames.size(); ++k)
    json[std::string{vision::kClueNames[k]}] = evidence.clues[k];
  return json;
}
}  // namespace

nlohmann::json to_json(const std::string& part, const vision::DetectionReport& report) {
  nlohmann::json json{{"part", part},
                      {"time_ms", report.time_ms},
                      {"stages_ms", report.stages_ms},
                      {"maxima", report.maxima},
                      {"hypotheses", report.hypotheses},
                      {"detections", nlohmann::json::array()},
                      {"rejected", nlohmann::json::array()}};
  for (const vision::Detection& d : report.detections)
    json["detections"].push_back({{"score", d.score},
                                  {"T_supply_object", rows_of(d.T_supply_object.iso.matrix())},
                                  {"visible_fraction", d.visible_fraction},
                                  {"covariance", rows_of(d.covariance)},
                                  {"evidence", to_json(d.evidence)}});
  for (const vision::Rejection& r : report.rejected)
    json["rejected"].push_back({{"score", r.score},
                                {"T_supply_object", rows_of(r.T_supply_object.iso.matrix())},
                                {"reason", r.reason},
                                {"evidence", to_json(r.evidence)}});
  return json;
}
}  // namespace binpick::tools
