#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "base/clock.hpp"
#include "config/config.hpp"
#include "daemon/cycle/detection.hpp"
#include "drivers/sweep/sweep.hpp"
#include "plc/alarms.hpp"
#include "plc/events.hpp"

/// What a cycle leaves behind, as values (docs/records.md). Its file: record_codec.hpp.
namespace binpick::daemon {
struct RecordOrigin {
  std::string version;           ///< Of the binpick that wrote it.
  std::uint16_t boot_count = 0;  ///< 0: written by `binpick scan`, which makes no cycles.
  std::uint64_t cycle_id = 0;
  std::int64_t unix_ms = 0;  ///< When it was written, by the machine's clock.
};

/// What the cell ran on.
struct RecordedCell {
  config::FileText cell;
  std::vector<config::FileText> parts;  ///< Each file once.
  struct KnowledgeBase {
    std::string path;
    std::uint64_t checksum = 0;  ///< 0: not opened.
  };
  std::vector<KnowledgeBase> knowledge_bases;  ///< One for each recipe.
};

/// What was asked for, and how it was to be looked for.
struct RecordedRequest {
  plc::PickRequest request;
  std::uint32_t supply = 0, recipe = 0;  ///< Indices in the configuration.
};

/// Raw profiles with where the carrier was, as the sweep handed them out. Times are of the daemon's own monotonic
/// clock.
struct RecordedScan {
  std::vector<drivers::sweep::RegisteredProfile> profiles;
  drivers::sweep::Done figures;
};

/// How the cycle ended.
struct RecordedAnswer {
  plc::ResultCode code = plc::ResultCode::None;  ///< None: no answer, the cycle ended without.
  plc::Alarm alarm = plc::Alarm::None;           ///< Of a cycle that ended by a fault.
  std::uint16_t pick_id = 0;
  std::optional<std::uint32_t> reachable{};  ///< The grasp that was answered: of the result's choice.
  std::vector<std::uint16_t> registers{};    ///< The whole map, as the PLC then read it.
  TimePoint requested_at{}, last_profile_at{}, answered_at{};
};

struct Record {
  RecordOrigin origin;
  RecordedCell cell;
  std::optional<RecordedRequest> request;
  std::optional<RecordedScan> scan;
  std::optional<std::uint64_t> scan_of_cycle;  ///< Instead of a scan: answered from that one's, of the same start.
  std::optional<DetectResult> result;
  std::optional<RecordedAnswer> answer;
};

/// The beginning of a record: which cycle, by which binpick, and the texts and knowledge bases that the cell ran on.
Record begun_record(const CellData& cell, std::uint16_t boot_count, std::uint64_t cycle_id);
}  // namespace binpick::daemon
