#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

/// What a production run writes down: for each part a file of JSON lines, a header first, one line per request, one at
/// the end of each bin. A bin without its end is no bin: it is run again, and, as its seed is its number, it is the
/// same.
namespace binpick::bench {
/// A device that failed during a request, and what became of it.
struct FaultRecord {
  std::string device, name, phase;
  bool reached = true;  ///< False: the request ended before its phase came, and nothing failed.
  double lasted_s = 0;
  std::string alarms;           ///< That the PLC read, numbers.
  double recovered_s = 0;       ///< From the device being healed to the handshake being idle and ready.
  bool handshake_lost = false;  ///< Not without an abort or a restart.
};

struct RequestRecord {
  std::uint64_t bin = 0;
  int request = 0;      ///< In its bin, from 0 on.
  std::string answer;   ///< "pick", "empty", "nothing_found", "not_reachable", or "alarm 203", "no answer".
  bool scanned = true;  ///< False: from the scan before.
  int left_before = 0;  ///< Objects in the bin.
  double error_mm = 0, error_deg = 0;  ///< Of a pick: to the nearest true object.
  bool wrong = false;                  ///< Beyond the class's limit.
  std::string grip;                    ///< "taken", "missed", "collision"; empty: no pick, or the robot never closed.
  std::string why;                     ///< Of a grip that failed, or of "not_reachable", in words.
  std::string grasp;                   ///< The nearest one's name.
  bool retry = false;                  ///< An object that was failed on before.
  double score = 0;
  int found = 0;  ///< Detections.
  std::uint64_t hypotheses = 0;
  double detection_ms = 0;
  double first_ms = 0;  ///< Until the first valid pose; 0: none.
  std::uint64_t first_hypotheses = 0;
  double scan_s = 0;   ///< Virtual: from the request to its answer.
  double robot_s = 0;  ///< Virtual: from the answer to the robot's report.
  std::optional<FaultRecord> fault;
  bool closed_wrong = false;  ///< In a run with faults: the gripper closed at a wrong pose, whoever sent it there.
  std::string
      cause;  ///< Of a wrong pose or a false "empty" at a fault or after it: "scene" (the same without), "fault".
  double place_mm = 0, place_deg = 0;  ///< Of a supply that was located: how far off.
};

struct BinRecord {
  std::uint64_t bin = 0;
  int objects = 0, left = 0;
  int takeable = 0;  ///< Of those left: a grasp of theirs would pass the gripper's check in its true pose.
  std::string end;   ///< The answer that ended it, or "given up".
  double cpu_s = 0;  ///< Of this process, for the whole bin.
};

struct PartRun {
  std::string header;  ///< How it was made, as JSON.
  std::vector<RequestRecord> requests;
  std::vector<BinRecord> bins;
  int picks() const;  ///< Poses sent.
};

std::string to_json(const RequestRecord& record);
std::string to_json(const BinRecord& record);

/// Complete bins only; a line that was cut short is none. No file: an empty run. Throws std::runtime_error where the
/// header is another one.
PartRun read_part_run(const std::string& path, const std::string& header);
/// Writes the run anew, whole bins only, by renaming.
void write_part_run(const std::string& path, const PartRun& run);
/// Adds a bin.
void append_bin(const std::string& path, const std::vector<RequestRecord>& requests, const BinRecord& bin);
}  // namespace binpick::bench
