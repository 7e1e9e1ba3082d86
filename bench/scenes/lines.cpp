#include "bench/scenes/lines.hpp"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <stdexcept>

namespace binpick::bench {
namespace {
using Json = nlohmann::json;
namespace fs = std::filesystem;

double rounded(double value, double step) { return std::isfinite(value) ? std::round(value / step) * step : 0; }

/// Quaternion w, x, y, z and translation.
Json of_pose(const Eigen::Isometry3d& T) {
  const Eigen::Quaterniond q{T.linear()};
  const Eigen::Vector3d& t = T.translation();
  return {q.w(), q.x(), q.y(), q.z(), t.x(), t.y(), t.z()};
}
Eigen::Isometry3d to_pose(const Json& json) {
  const auto v = json.get<std::array<double, 7>>();
  Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  T.linear() = Eigen::Quaterniond{v[0], v[1], v[2], v[3]}.normalized().toRotationMatrix();
  T.translation() = Eigen::Vector3d{v[4], v[5], v[6]};
  return T;
}

Json of_covariance(const vision::Matrix6& covariance) {
  Json upper = Json::array();
  for (int r = 0; r < 6; ++r)
    for (int c = r; c < 6; ++c) upper.push_back(covariance(r, c));
  return upper;
}
vision::Matrix6 to_covariance(const Json& json) {
  vision::Matrix6 covariance;
  std::size_t k = 0;
  for (int r = 0; r < 6; ++r)
    for (int c = r; c < 6; ++c) covariance(r, c) = covariance(c, r) = json.at(k++).get<double>();
  return covariance;
}

Json of_evidence(const vision::Evidence& evidence) {
  Json clues = Json::array();
  for (const float clue : evidence.clues) clues.push_back(rounded(clue, 1e-5));
  return clues;
}
vision::Evidence to_evidence(const Json& json) {
  vision::Evidence evidence;
  json.get_to(evidence.clues);
  return evidence;
}

SceneLine to_scene(const Json& json) {
  SceneLine line;
  json.at("detector").get_to(line.detector);
  json.at("scanner").get_to(line.scanner);
  json.at("part").get_to(line.part);
  json.at("split").get_to(line.split);
  json.at("number").get_to(line.number);
  json.at("pile").get_to(line.pile);
  json.at("fill").get_to(line.fill);
  for (const Json& t : json.at("truths")) line.truths.push_back({to_pose(t.at("pose")), t.at("visible"), t.at("told")});
  for (const Json& d : json.at("detections"))
    line.detections.push_back({to_pose(d.at("pose")), d.at("score"), d.at("visible"), d.at("nearest_mm"),
                               to_covariance(d.at("covariance")), to_evidence(d.at("evidence"))});
  for (const Json& r : json.at("rejected"))
    line.rejected.push_back(
        {to_pose(r.at("pose")), r.at("score"), r.at("nearest_mm"), to_evidence(r.at("evidence")), r.at("reason")});
  json.at("points").get_to(line.points);
  json.at("maxima").get_to(line.maxima);
  json.at("hypotheses").get_to(line.hypotheses);
  json.at("time_ms").get_to(line.time_ms);
  json.at("image_ms").get_to(line.image_ms);
  json.at("stages_ms").get_to(line.stages_ms);
  json.at("alive").get_to(line.alive);
  if (const auto first = json.find("first"); first != json.end())
    line.first = FirstLine{first->at("time_ms"), first->at("hypotheses"), first->at("right")};
  if (const auto memory = json.find("memory_mib"); memory != json.end()) memory->get_to(line.memory_mib);
  return line;
}
}  // namespace

std::string SceneLine::key() const {
  return scanner + ' ' + part + ' ' + split + ' ' + std::to_string(number) + ' ' + detector;
}

std::string to_json(const RunHeader& header) {
  return Json{{"commit", header.commit}, {"options", header.options}}.dump();
}

std::string to_json(const SceneLine& line) {
  Json json{{"detector", line.detector},  {"scanner", line.scanner},       {"part", line.part},
            {"split", line.split},        {"number", line.number},         {"pile", line.pile},
            {"fill", line.fill},          {"points", line.points},         {"maxima", line.maxima},
            {"time_ms", line.time_ms},    {"hypotheses", line.hypotheses}, {"image_ms", line.image_ms},
            {"stages_ms", line.stages_ms}};
  Json &truths = json["truths"] = Json::array(), &detections = json["detections"] = Json::array(),
       &rejected = json["rejected"] = Json::array();
  for (const TruthLine& t : line.truths)
    truths.push_back({{"pose", of_pose(t.T_supply_object)}, {"visible", t.visible}, {"told", t.told}});
  for (const DetectionLine& d : line.detections)
    detections.push_back({{"pose", of_pose(d.T_supply_object)},
                          {"score", d.score},
                          {"visible", d.visible},
                          {"nearest_mm", rounded(d.nearest_mm, 1e-3)},
                          {"covariance", of_covariance(d.covariance)},
                          {"evidence", of_evidence(d.evidence)}});
  for (const RejectionLine& r : line.rejected)
    rejected.push_back({{"pose", of_pose(r.T_supply_object)},
                        {"score", r.score},
                        {"nearest_mm", rounded(r.nearest_mm, 1e-3)},
                        {"evidence", of_evidence(r.evidence)},
                        {"reason", r.reason}});
  Json& alive = json["alive"] = Json::array();
  for (const auto& [stage, distances] : line.alive) {
    Json numbers = Json::array();
    for (const double d : distances) numbers.push_back(rounded(d, 1e-4));
    alive.push_back({stage, std::move(numbers)});
  }
  if (line.first)
    json["first"] = {
        {"time_ms", line.first->time_ms}, {"hypotheses", line.first->hypotheses}, {"right", line.first->right}};
  if (!line.memory_mib.empty()) json["memory_mib"] = line.memory_mib;
  return json.dump();
}

RunFolder read_run(const std::string& folder) {
  RunFolder run;
  if (!fs::is_directory(folder)) return run;
  std::vector<fs::path> files;
  for (const auto& entry : fs::directory_iterator{folder})
    if (entry.path().extension() == ".jsonl") files.push_back(entry.path());
  std::ranges::sort(files);
  for (const fs::path& file : files) {
    std::ifstream in{file};
    std::string text;
    for (std::size_t number = 1; std::getline(in, text); ++number) {
      const Json json = Json::parse(text, nullptr, false);
      if (json.is_discarded()) continue;  // the run was stopped while it wrote
      if (json.contains("commit")) {
        const RunHeader header{json.at("commit"), json.at("options")};
        if (run.header && *run.header != header)
          throw std::runtime_error{file.string() + ":" + std::to_string(number) + ": made as " + to_json(header) +
                                   ", other files of the folder as " + to_json(*run.header) +
                                   "; runs do not mix: use another folder"};
        run.header = header;
        continue;
      }
      SceneLine line = to_scene(json);
      run.scenes.insert_or_assign(line.key(), std::move(line));
    }
  }
  return run;
}
}  // namespace binpick::bench
