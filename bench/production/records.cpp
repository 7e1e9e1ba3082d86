#include "bench/production/records.hpp"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <set>
#include <stdexcept>

namespace binpick::bench {
namespace {
using Json = nlohmann::json;

double rounded(double value, double step) { return std::isfinite(value) ? std::round(value / step) * step : 0; }

FaultRecord to_fault(const Json& json) {
  FaultRecord f;
  json.at("device").get_to(f.device);
  json.at("name").get_to(f.name);
  json.at("phase").get_to(f.phase);
  json.at("reached").get_to(f.reached);
  json.at("lasted_s").get_to(f.lasted_s);
  json.at("alarms").get_to(f.alarms);
  json.at("recovered_s").get_to(f.recovered_s);
  json.at("handshake_lost").get_to(f.handshake_lost);
  return f;
}

Json to_json(const FaultRecord& f) {
  return {{"device", f.device},
          {"name", f.name},
          {"phase", f.phase},
          {"reached", f.reached},
          {"lasted_s", rounded(f.lasted_s, 1e-3)},
          {"alarms", f.alarms},
          {"recovered_s", rounded(f.recovered_s, 1e-3)},
          {"handshake_lost", f.handshake_lost}};
}

RequestRecord to_request(const Json& json) {
  RequestRecord r;
  json.at("bin").get_to(r.bin);
  json.at("request").get_to(r.request);
  json.at("answer").get_to(r.answer);
  json.at("scanned").get_to(r.scanned);
  json.at("left_before").get_to(r.left_before);
  json.at("scan_s").get_to(r.scan_s);
  json.at("found").get_to(r.found);
  json.at("hypotheses").get_to(r.hypotheses);
  json.at("detection_ms").get_to(r.detection_ms);
  json.at("first_ms").get_to(r.first_ms);
  json.at("first_hypotheses").get_to(r.first_hypotheses);
  if (json.contains("fault")) r.fault = to_fault(json["fault"]);
  r.closed_wrong = json.value("closed_wrong", false);
  r.cause = json.value("cause", "");
  r.place_mm = json.value("place_mm", 0.0);
  r.place_deg = json.value("place_deg", 0.0);
  r.why = json.value("why", "");
  if (r.answer != "pick") return r;
  json.at("error_mm").get_to(r.error_mm);
  json.at("error_deg").get_to(r.error_deg);
  json.at("wrong").get_to(r.wrong);
  json.at("grip").get_to(r.grip);
  json.at("grasp").get_to(r.grasp);
  json.at("retry").get_to(r.retry);
  json.at("score").get_to(r.score);
  json.at("robot_s").get_to(r.robot_s);
  return r;
}

BinRecord to_bin(const Json& json) {
  BinRecord bin;
  json.at("bin").get_to(bin.bin);
  json.at("objects").get_to(bin.objects);
  json.at("left").get_to(bin.left);
  json.at("takeable").get_to(bin.takeable);
  json.at("end").get_to(bin.end);
  json.at("cpu_s").get_to(bin.cpu_s);
  return bin;
}
}  // namespace

int PartRun::picks() const { return static_cast<int>(std::ranges::count(requests, "pick", &RequestRecord::answer)); }

std::string to_json(const RequestRecord& r) {
  Json json{{"bin", r.bin},
            {"request", r.request},
            {"answer", r.answer},
            {"scanned", r.scanned},
            {"left_before", r.left_before},
            {"scan_s", rounded(r.scan_s, 1e-3)},
            {"found", r.found},
            {"hypotheses", r.hypotheses},
            {"detection_ms", rounded(r.detection_ms, 0.1)},
            {"first_ms", rounded(r.first_ms, 0.1)},
            {"first_hypotheses", r.first_hypotheses}};
  if (r.fault) json["fault"] = to_json(*r.fault);
  if (r.closed_wrong) json["closed_wrong"] = true;
  if (!r.cause.empty()) json["cause"] = r.cause;
  if (!r.why.empty()) json["why"] = r.why;
  if (r.place_mm > 0) json.update({{"place_mm", rounded(r.place_mm, 1e-3)}, {"place_deg", rounded(r.place_deg, 1e-3)}});
  if (r.answer == "pick")
    json.update({{"error_mm", rounded(r.error_mm, 1e-3)},
                 {"error_deg", rounded(r.error_deg, 1e-3)},
                 {"wrong", r.wrong},
                 {"grip", r.grip},
                 {"grasp", r.grasp},
                 {"retry", r.retry},
                 {"score", rounded(r.score, 1e-4)},
                 {"robot_s", rounded(r.robot_s, 1e-3)}});
  return json.dump();
}

std::string to_json(const BinRecord& bin) {
  return Json{{"bin", bin.bin},           {"objects", bin.objects}, {"left", bin.left},
              {"takeable", bin.takeable}, {"end", bin.end},         {"cpu_s", rounded(bin.cpu_s, 1e-3)}}
      .dump();
}

PartRun read_part_run(const std::string& path, const std::string& header) {
  PartRun run{header, {}, {}};
  std::ifstream in{path};
  std::string text;
  if (!std::getline(in, text)) return run;
  if (text != header)
    throw std::runtime_error(path + ": made as " + text + ", this run would be " + header +
                             "; runs do not mix: remove it or use another --out");
  std::set<std::uint64_t> ended;
  while (std::getline(in, text)) {
    const Json json = Json::parse(text, nullptr, false);
    if (json.is_discarded()) continue;  // stopped while it wrote
    if (json.contains("answer")) {
      run.requests.push_back(to_request(json));
    } else {
      run.bins.push_back(to_bin(json));
      ended.insert(run.bins.back().bin);
    }
  }
  std::erase_if(run.requests, [&](const RequestRecord& r) { return !ended.contains(r.bin); });
  return run;
}

void write_part_run(const std::string& path, const PartRun& run) {
  const std::string fresh = path + ".new";
  {
    std::ofstream out{fresh};
    out << run.header << '\n';
    for (const BinRecord& bin : run.bins) {
      for (const RequestRecord& request : run.requests)
        if (request.bin == bin.bin) out << to_json(request) << '\n';
      out << to_json(bin) << '\n';
    }
    if (!out.flush()) throw std::runtime_error(fresh + ": cannot be written; check folder and free space");
  }
  std::filesystem::rename(fresh, path);
}

void append_bin(const std::string& path, const std::vector<RequestRecord>& requests, const BinRecord& bin) {
  std::ofstream out{path, std::ios::app};
  for (const RequestRecord& request : requests) out << to_json(request) << '\n';
  out << to_json(bin) << '\n';
  if (!out.flush()) throw std::runtime_error(path + ": cannot be written; check folder and free space");
}
}  // namespace binpick::bench
