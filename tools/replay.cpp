#include "daemon/cycle/replay.hpp"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>

#include "daemon/cycle/record_codec.hpp"
#include "tools/commands.hpp"
#include "tools/output.hpp"
#include "tools/report_json.hpp"
#include "vision/draw.hpp"
#include "vision/kernels.hpp"

/// binpick replay FILE…: recorded cycles once more, by the same code: the same result, or what differs.
namespace binpick::tools {
namespace {
namespace kernels = vision::kernels;

struct ReplayOrder {
  std::vector<std::string> files;
  daemon::ReplayChanges changes;
  std::string loops, json, image;
  bool changed() const { return !changes.part.empty() || !changes.knowledge_base.empty(); }
};

int complain(int status, const std::string& text) {
  std::fprintf(stderr, "binpick replay: %s\n", text.c_str());
  return status;
}

/// Files as they are, folders as the records in them, in the order of their names.
std::vector<std::string> records_of(const std::vector<std::string>& given) {
  namespace fs = std::filesystem;
  std::vector<std::string> files;
  for (const auto& path : given) {
    std::error_code failure;
    if (!fs::is_directory(path, failure)) {
      files.push_back(path);
      continue;
    }
    const auto begin = static_cast<std::ptrdiff_t>(files.size());
    for (const auto& entry : fs::directory_iterator{path, failure})
      if (entry.path().filename().string().find(".bpr") != std::string::npos) files.push_back(entry.path().string());
    std::sort(files.begin() + begin, files.end());
  }
  return files;
}

/// Takes the inner loops into use that the result was made on, or those that are asked for. Empty: done; else why not.
std::string take_loops(const std::string& wanted) {
  if (wanted.empty()) return {};
  const kernels::Table* loops = kernels::find(wanted);
  if (loops == nullptr)
    return "was made on the loops " + wanted +
           ", which this machine does not have; see with --loops portable how near "
           "those come";
  kernels::use(*loops);
  return {};
}

std::string summary_of(const daemon::DetectResult& result) {
  if (!result.error.empty()) return "failed: " + result.error;
  if (!result.not_located.empty()) return "supply not located: " + result.not_located;
  return std::to_string(result.report.detections.size()) + " found, " + std::to_string(result.choice.reachable.size()) +
         " reachable";
}

enum class Outcome {
  Identical,
  Differs,
  CutShort,     ///< By detection.deadline_ms then; a replay takes its time and may well find more.
  WithoutThen,  ///< The cycle ended without a result.
  Skipped,
};

/// What came of all records.
struct Replays {
  std::map<Outcome, std::size_t> counts;
  nlohmann::json list = nlohmann::json::array();
  bool drawn = true;  ///< The picture that was asked for.
};

const char* name_of(Outcome outcome) {
  switch (outcome) {
    case Outcome::Identical:
      return "identical";
    case Outcome::Differs:
      return "differs";
    case Outcome::CutShort:
      return "cut short by its deadline then, with more time";
    case Outcome::WithoutThen:
      return "ended without a result then";
    case Outcome::Skipped:
      break;
  }
  return "skipped";
}

Outcome outcome_of(const std::optional<daemon::DetectResult>& then, bool same) {
  if (!then) return Outcome::WithoutThen;
  if (same) return Outcome::Identical;
  return then->report.cut_short ? Outcome::CutShort : Outcome::Differs;
}

nlohmann::json choice_to_json(const vision::GraspChoice& choice, const std::vector<vision::Grasp>& grasps) {
  nlohmann::json reachable = nlohmann::json::array(), unreachable = nlohmann::json::array();
  for (const auto& one : choice.reachable)
    reachable.push_back({{"detection", one.detection},
                         {"grasp", grasps[one.grasp].name},
                         {"T_supply_grasp", rows_of(one.T_supply_grasp.iso.matrix())},
                         {"T_supply_approach", rows_of(one.T_supply_approach.iso.matrix())},
                         {"T_supply_retreat", rows_of(one.T_supply_retreat.iso.matrix())},
                         {"is_aslant", one.is_aslant},
                         {"covered_mm", one.covered_mm}});
  for (const auto& one : choice.unreachable)
    unreachable.push_back({{"detection", one.detection}, {"reason", one.reason}});
  return {{"reachable", reachable}, {"unreachable", unreachable}};
}

Outcome replay_one(const std::string& file, const ReplayOrder& order, Replays& all) {
  const auto skip = [&](const std::string& why) {
    std::fprintf(stderr, "binpick replay: skipped: %s\n", why.c_str());
    all.list.push_back({{"file", file}, {"skipped", why}});
    return Outcome::Skipped;
  };
  const auto record = daemon::read_record(file);
  if (!record) return skip(record.error().text);
  const std::string loops = !order.loops.empty() ? order.loops : record->result ? record->result->loops : "";
  if (const auto trouble = take_loops(loops); !trouble.empty()) return skip(file + " " + trouble);
  const auto replayed = daemon::replay(*record, order.changes);
  if (!replayed) return skip(file + " " + replayed.error());
  const daemon::DetectResult& now = replayed->result;
  const auto& base = replayed->request.cell->knowledge_bases[replayed->request.recipe];
  const auto& part = replayed->request.cell->config.recipes[replayed->request.recipe].part;

  const auto lines = record->result ? daemon::differences(*record->result, now) : std::vector<std::string>{};
  const Outcome outcome = outcome_of(record->result, lines.empty());
  nlohmann::json entry = to_json(base.part_name(), now.report);
  entry["file"] = file;
  entry["cycle"] = record->origin.cycle_id;
  entry["boot_count"] = record->origin.boot_count;
  entry["binpick"] = record->origin.version;
  entry["loops"] = now.loops;
  entry["cut_short"] = record->result && record->result->report.cut_short;
  entry["identical"] = outcome == Outcome::Identical;
  entry["differences"] = lines;
  entry.update(choice_to_json(now.choice, part.grasps));
  all.list.push_back(entry);

  if (order.json != "-") {
    std::printf("%s: cycle %llu of start %u: %s: %s (%s loops, %.0f ms)\n", file.c_str(),
                static_cast<unsigned long long>(record->origin.cycle_id), record->origin.boot_count, name_of(outcome),
                summary_of(now).c_str(), now.loops.c_str(), now.report.time_ms);
    for (const auto& line : lines) std::printf("  %s\n", line.c_str());
  }
  if (!order.image.empty()) {
    const auto* chosen = now.choice.reachable.empty() ? nullptr : &now.choice.reachable.front();
    const auto drawn = vision::draw_report(order.image, replayed->request.image, base, now.report, chosen,
                                           part.gripper ? &*part.gripper : nullptr,
                                           chosen != nullptr ? &part.grasps[chosen->grasp] : nullptr);
    if (!drawn) complain(1, drawn.error());
    all.drawn = drawn.has_value();
  }
  return outcome;
}

void tell(std::map<Outcome, std::size_t>& counts, std::size_t files) {
  std::printf("%zu records: %zu identical, %zu differ, %zu skipped", files, counts[Outcome::Identical],
              counts[Outcome::Differs], counts[Outcome::Skipped]);
  if (counts[Outcome::CutShort] > 0) std::printf(", %zu cut short by their deadline then", counts[Outcome::CutShort]);
  if (counts[Outcome::WithoutThen] > 0) std::printf(", %zu without a result then", counts[Outcome::WithoutThen]);
  std::printf("\n");
}

int run(const ReplayOrder& order) {
  const auto files = records_of(order.files);
  if (files.empty()) return complain(2, "no record is there; they lie in record.dir of the cell file");
  if (files.size() > 1 && !order.image.empty()) return complain(2, "--image is of one record; name one");
  for (const std::string& path : {order.image, order.json == "-" ? std::string{} : order.json})
    if (const auto trouble = path.empty() ? path : cannot_be_written(path); !trouble.empty())
      return complain(1, trouble);
  Replays all;
  for (const auto& file : files) ++all.counts[replay_one(file, order, all)];
  if (order.json == "-") {
    std::printf("%s\n", all.list.dump(2).c_str());
  } else {
    if (!order.json.empty()) {
      std::ofstream out{order.json};
      out << all.list.dump(2) << '\n';
      if (!out.flush()) return complain(1, order.json + ": cannot be written; check that the folder has room");
    }
    if (files.size() > 1) tell(all.counts, files.size());
  }
  if (all.counts[Outcome::Skipped] == files.size() || !all.drawn) return 1;
  return all.counts[Outcome::Differs] > 0 && !order.changed() ? 1 : 0;
}
}  // namespace

void add_replay(CLI::App& app, int& exit_status) {
  auto order = std::make_shared<ReplayOrder>();
  CLI::App* command = app.add_subcommand("replay", "Repeats recorded cycles: the same result, or what differs.");
  command->add_option("FILE", order->files, "records, or folders of them (record.dir)")->required();
  command->add_option("--part", order->changes.part, "what this part file would have made of it");
  command->add_option("--knowledge-base", order->changes.knowledge_base,
                      "instead of the recorded one, by whatever name it has here");
  command->add_option("--loops", order->loops, "inner loops to run on (default: those of the record)")
      ->check(CLI::IsMember({"avx2", "portable"}));
  command->add_option("--json", order->json, "write the outcome to this file; -: to stdout, without the lines");
  command->add_option("--image", order->image, "write the depth image with the detections drawn over it (PNG)");
  command->callback([order, &exit_status] { exit_status = run(*order); });
}
}  // namespace binpick::tools
