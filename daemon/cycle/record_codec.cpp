#include "daemon/cycle/record_codec.hpp"

#include <algorithm>
#include <array>

#include "base/crc32.hpp"
#include "base/overloaded.hpp"
#include "daemon/cycle/record_bytes.hpp"
#include "vision/file.hpp"

namespace binpick::daemon {
namespace {
using Kind = RecordError::Kind;
constexpr std::string_view kMagic = "BINPICKR";
constexpr std::size_t kHeaderBytes = 12;
constexpr std::size_t kSectionOverhead = 12;  // name, length, checksum
constexpr std::size_t kIsometryBytes = 96;

// ---- Each kind of value: its fields out, and in.

void put(FieldWriter& out, const RecordOrigin& origin) {
  out.text(origin.version);
  out.number(origin.boot_count);
  out.number(origin.cycle_id);
  out.number(origin.unix_ms);
}
void take(FieldReader& in, RecordOrigin& origin) {
  in.text(origin.version);
  in.number(origin.boot_count);
  in.number(origin.cycle_id);
  in.number(origin.unix_ms);
}

void put(FieldWriter& out, const config::FileText& file) {
  out.text(file.path);
  out.text(file.text);
}
void take(FieldReader& in, config::FileText& file) {
  in.text(file.path);
  in.text(file.text);
}

void put(FieldWriter& out, const RecordedCell& cell) {
  put(out, cell.cell);
  out.list(cell.parts, [](FieldWriter& o, const config::FileText& file) { put(o, file); });
  out.list(cell.knowledge_bases, [](FieldWriter& o, const RecordedCell::KnowledgeBase& base) {
    o.text(base.path);
    o.number(base.checksum);
  });
}
void take(FieldReader& in, RecordedCell& cell) {
  take(in, cell.cell);
  in.list(cell.parts, 8, [](FieldReader& i, config::FileText& file) { take(i, file); });
  in.list(cell.knowledge_bases, 12, [](FieldReader& i, RecordedCell::KnowledgeBase& base) {
    i.text(base.path);
    i.number(base.checksum);
  });
}

void put(FieldWriter& out, const RecordedRequest& request) {
  out.number(request.request.sequence);
  out.number(request.request.part_id);
  out.number(request.request.supply_id);
  out.number(request.supply);
  out.number(request.recipe);
  out.number(request.request.new_scan);
}
void take(FieldReader& in, RecordedRequest& request) {
  in.number(request.request.sequence);
  in.number(request.request.part_id);
  in.number(request.request.supply_id);
  in.number(request.supply);
  in.number(request.recipe);
  in.number(request.request.new_scan);
}

enum class CarrierKind : std::uint8_t { Pivot, Robot };

void put(FieldWriter& out, const drivers::sweep::RegisteredProfile& registered) {
  const auto& profile = registered.profile;
  out.time(profile.measured_at);
  out.time(profile.received_at);
  out.number(profile.counter);
  out.number(profile.encoder);
  std::visit(Overloaded{
                 [&](const Angle& angle) {
                   out.number(CarrierKind::Pivot);
                   out.number(angle.in_rad());
                 },
                 [&](const Transform<frame::Base, frame::Flange>& T_base_flange) {
                   out.number(CarrierKind::Robot);
                   out.isometry(T_base_flange.iso);
                 },
             },
             registered.carrier);
  const std::size_t n = std::min(profile.x_mm.size(), profile.z_mm.size());
  out.count(n);
  for (std::size_t i = 0; i < n; ++i) {
    out.number(profile.x_mm[i]);
    out.number(profile.z_mm[i]);
  }
}
void take(FieldReader& in, drivers::sweep::RegisteredProfile& registered) {
  auto& profile = registered.profile;
  in.time(profile.measured_at);
  in.time(profile.received_at);
  in.number(profile.counter);
  in.number(profile.encoder);
  CarrierKind kind{};
  in.choice(kind, CarrierKind::Robot);
  if (kind == CarrierKind::Pivot) {
    registered.carrier = Angle::rad(in.number<double>());
  } else {
    in.isometry(registered.carrier.emplace<Transform<frame::Base, frame::Flange>>().iso);
  }
  const std::size_t n = in.count(8);
  profile.x_mm.resize(n);
  profile.z_mm.resize(n);
  for (std::size_t i = 0; i < n; ++i) {
    in.number(profile.x_mm[i]);
    in.number(profile.z_mm[i]);
  }
}

void put(FieldWriter& out, const RecordedScan& scan) {
  out.duration(scan.figures.duration);
  out.number(static_cast<std::uint64_t>(scan.figures.profiles));
  out.number(static_cast<std::uint64_t>(scan.figures.profiles_without_pose));
  out.number(scan.figures.profiles_lost);
  out.list(scan.profiles, [](FieldWriter& o, const auto& registered) { put(o, registered); });
}
void take(FieldReader& in, RecordedScan& scan) {
  in.duration(scan.figures.duration);
  scan.figures.profiles = in.number<std::uint64_t>();
  scan.figures.profiles_without_pose = in.number<std::uint64_t>();
  in.number(scan.figures.profiles_lost);
  in.list(scan.profiles, 35, [](FieldReader& i, auto& registered) { take(i, registered); });
}

void put(FieldWriter& out, const vision::Evidence& evidence) {
  out.list(evidence.clues, [](FieldWriter& o, float clue) { o.number(clue); });
}
void take(FieldReader& in, vision::Evidence& evidence) {
  std::vector<float> clues;
  in.list(clues, 4, [](FieldReader& i, float& clue) { i.number(clue); });
  std::copy_n(clues.begin(), std::min(clues.size(), evidence.clues.size()), evidence.clues.begin());
}

void put(FieldWriter& out, const vision::Detection& detection) {
  out.isometry(detection.T_supply_object.iso);
  out.number(detection.score);
  out.number(detection.visible_fraction);
  for (const double value : detection.covariance.reshaped()) out.number(value);
  put(out, detection.evidence);
}
void take(FieldReader& in, vision::Detection& detection) {
  in.isometry(detection.T_supply_object.iso);
  in.number(detection.score);
  in.number(detection.visible_fraction);
  for (double& value : detection.covariance.reshaped()) in.number(value);
  take(in, detection.evidence);
}

void put(FieldWriter& out, const vision::Rejection& rejection) {
  out.isometry(rejection.T_supply_object.iso);
  out.number(rejection.score);
  out.text(rejection.reason);
  put(out, rejection.evidence);
}
void take(FieldReader& in, vision::Rejection& rejection) {
  in.isometry(rejection.T_supply_object.iso);
  in.number(rejection.score);
  in.text(rejection.reason);
  take(in, rejection.evidence);
}

void put(FieldWriter& out, const vision::DetectionReport& report) {
  out.list(report.detections, [](FieldWriter& o, const auto& detection) { put(o, detection); });
  out.list(report.rejected, [](FieldWriter& o, const auto& rejection) { put(o, rejection); });
  out.number(static_cast<std::uint64_t>(report.maxima));
  out.number(static_cast<std::uint64_t>(report.hypotheses));
  out.number(report.cut_short);
  out.number(report.time_ms);
  out.list(report.stages_ms, [](FieldWriter& o, const auto& stage) {
    o.text(stage.first);
    o.number(stage.second);
  });
  out.number(report.first.has_value());
  const vision::FirstValid first = report.first.value_or(vision::FirstValid{});
  out.isometry(first.T_supply_object.iso);
  out.number(first.time_ms);
  out.number(static_cast<std::uint64_t>(first.hypotheses));
}
void take(FieldReader& in, vision::DetectionReport& report) {
  in.list(report.detections, kIsometryBytes, [](FieldReader& i, auto& detection) { take(i, detection); });
  in.list(report.rejected, kIsometryBytes, [](FieldReader& i, auto& rejection) { take(i, rejection); });
  report.maxima = in.number<std::uint64_t>();
  report.hypotheses = in.number<std::uint64_t>();
  in.number(report.cut_short);
  in.number(report.time_ms);
  std::vector<std::pair<std::string, double>> stages;
  in.list(stages, 12, [](FieldReader& i, auto& stage) {
    i.text(stage.first);
    i.number(stage.second);
  });
  report.stages_ms = {stages.begin(), stages.end()};
  const bool has_first = in.number<bool>();
  vision::FirstValid first;
  in.isometry(first.T_supply_object.iso);
  in.number(first.time_ms);
  first.hypotheses = in.number<std::uint64_t>();
  if (has_first) report.first = first;
}

void put(FieldWriter& out, const vision::GraspChoice& choice) {
  out.list(choice.reachable, [](FieldWriter& o, const vision::Reachable& reachable) {
    o.number(static_cast<std::uint32_t>(reachable.detection));
    o.number(static_cast<std::uint32_t>(reachable.grasp));
    o.isometry(reachable.T_supply_grasp.iso);
    o.isometry(reachable.T_supply_approach.iso);
    o.number(reachable.clearance_mm);
    o.isometry(reachable.T_supply_retreat.iso);
    o.number(reachable.covered_mm);
    o.number(reachable.is_tight);
    o.number(reachable.is_aslant);
  });
  out.list(choice.unreachable, [](FieldWriter& o, const vision::Unreachable& unreachable) {
    o.number(static_cast<std::uint32_t>(unreachable.detection));
    o.number(static_cast<std::uint8_t>(unreachable.why));
    o.text(unreachable.reason);
  });
  out.list(choice.rejected, [](FieldWriter& o, const vision::RejectedGrasp& rejected) {
    o.number(static_cast<std::uint32_t>(rejected.detection));
    o.number(static_cast<std::uint32_t>(rejected.grasp));
    o.number(static_cast<std::uint32_t>(rejected.pose));
    o.number(static_cast<std::uint8_t>(rejected.why));
    o.number(rejected.value);
    o.number(rejected.limit);
    o.text(rejected.place);
  });
}
void take(FieldReader& in, vision::GraspChoice& choice) {
  in.list(choice.reachable, 16 + 2 * kIsometryBytes, [](FieldReader& i, vision::Reachable& reachable) {
    reachable.detection = i.number<std::uint32_t>();
    reachable.grasp = i.number<std::uint32_t>();
    i.isometry(reachable.T_supply_grasp.iso);
    i.isometry(reachable.T_supply_approach.iso);
    i.number(reachable.clearance_mm);
    i.isometry(reachable.T_supply_retreat.iso);
    i.number(reachable.covered_mm);
    i.number(reachable.is_tight);
    i.number(reachable.is_aslant);
  });
  in.list(choice.unreachable, 9, [](FieldReader& i, vision::Unreachable& unreachable) {
    unreachable.detection = i.number<std::uint32_t>();
    unreachable.why = static_cast<vision::Obstacle>(i.number<std::uint8_t>());
    i.text(unreachable.reason);
  });
  in.list(choice.rejected, 33, [](FieldReader& i, vision::RejectedGrasp& rejected) {
    rejected.detection = i.number<std::uint32_t>();
    rejected.grasp = i.number<std::uint32_t>();
    rejected.pose = i.number<std::uint32_t>();
    rejected.why = static_cast<vision::Obstacle>(i.number<std::uint8_t>());
    i.number(rejected.value);
    i.number(rejected.limit);
    i.text(rejected.place);
  });
}

void put(FieldWriter& out, const DetectResult& result) {
  out.number(result.cycle_id);
  out.text(result.error);
  out.text(result.loops);
  out.number(result.supply_empty);
  out.number(result.fill.share);
  out.number(result.fill.occupied_mm2);
  out.number(result.fill.measured);
  put(out, result.report);
  put(out, result.choice);
  out.text(result.not_located);
  out.isometry(result.place.T_said_found);
  out.number(result.place.turn_rad);
  out.number(static_cast<std::int32_t>(result.place.walls));
}
void take(FieldReader& in, DetectResult& result) {
  in.number(result.cycle_id);
  in.text(result.error);
  in.text(result.loops);
  in.number(result.supply_empty);
  in.number(result.fill.share);
  in.number(result.fill.occupied_mm2);
  in.number(result.fill.measured);
  take(in, result.report);
  take(in, result.choice);
  in.text(result.not_located);
  in.isometry(result.place.T_said_found);
  in.number(result.place.turn_rad);
  result.place.walls = in.number<std::int32_t>();
}

void put(FieldWriter& out, const RecordedAnswer& answer) {
  out.number(answer.code);
  out.number(answer.alarm);
  out.number(answer.pick_id);
  out.count(answer.registers.size());
  for (const std::uint16_t word : answer.registers) out.number(word);
  out.time(answer.requested_at);
  out.time(answer.last_profile_at);
  out.time(answer.answered_at);
  out.number(answer.reachable ? static_cast<std::int32_t>(*answer.reachable) : -1);
}
void take(FieldReader& in, RecordedAnswer& answer) {
  in.number(answer.code);
  in.number(answer.alarm);
  in.number(answer.pick_id);
  answer.registers.resize(in.count(2));
  for (std::uint16_t& word : answer.registers) in.number(word);
  in.time(answer.requested_at);
  in.time(answer.last_profile_at);
  in.time(answer.answered_at);
  std::int32_t reachable = -1;
  in.number(reachable);
  if (reachable >= 0) answer.reachable = static_cast<std::uint32_t>(reachable);
}

void put(FieldWriter& out, const std::uint64_t& cycle) { out.number(cycle); }
void take(FieldReader& in, std::uint64_t& cycle) { in.number(cycle); }

// ---- Sections.

constexpr std::string_view kOrigin = "orig", kCell = "cell", kRequest = "requ", kScan = "scan", kFrom = "from",
                           kResult = "resu", kAnswer = "answ", kEnd = "end.";

template <class Value>
void put_section(Bytes& file, std::string_view name, const Value& value) {
  FieldWriter out;
  put(out, value);
  const Bytes content = out.take();
  const std::size_t begin = file.size();
  append(file, as_bytes(name));
  append_le(file, static_cast<std::uint32_t>(content.size()));
  append(file, content);
  append_le(file, crc32(ByteView{file}.subspan(begin)));
}
template <class Value>
void put_section(Bytes& file, std::string_view name, const std::optional<Value>& value) {
  if (value) put_section(file, name, *value);
}

struct Nothing {};
void put(FieldWriter&, const Nothing&) {}

auto failed(Kind kind, std::string text) { return unexpected(RecordError{kind, std::move(text)}); }

struct FoundSection {
  std::string_view name;
  ByteView content;
};

std::string at_byte(std::size_t at) { return " at byte " + std::to_string(at); }

/// The section at byte `at` of a file of which `last_whole` is the last section that is whole.
Expected<FoundSection, RecordError> section_at(ByteView bytes, std::size_t at, std::string_view last_whole) {
  const std::size_t left = bytes.size() - at;
  const std::string after =
      last_whole.empty() ? "before its first section" : "after its section " + std::string{last_whole};
  if (left < 8) return failed(Kind::CutOff, "is cut off " + after);
  const std::size_t length = read_le<std::uint32_t>(bytes, at + 4);
  if (left - 8 < length || left - 8 - length < 4) return failed(Kind::CutOff, "is cut off " + after);
  if (crc32(bytes.subspan(at, 8 + length)) != read_le<std::uint32_t>(bytes, at + 8 + length))
    return failed(Kind::Damaged, "is damaged: a checksum is wrong" + at_byte(at));
  return FoundSection{as_text(bytes.subspan(at, 4)), bytes.subspan(at + 8, length)};
}

/// Whether the section's content could be understood.
template <class Value>
bool take_section(const FoundSection& section, Value& value) {
  FieldReader in{section.content};
  take(in, value);
  return !in.bad();
}

bool take_section(const FoundSection& section, Record& record) {
  if (section.name == kOrigin) return take_section(section, record.origin);
  if (section.name == kCell) return take_section(section, record.cell);
  if (section.name == kRequest) return take_section(section, record.request.emplace());
  if (section.name == kScan) return take_section(section, record.scan.emplace());
  if (section.name == kFrom) return take_section(section, record.scan_of_cycle.emplace());
  if (section.name == kResult) return take_section(section, record.result.emplace());
  if (section.name == kAnswer) return take_section(section, record.answer.emplace());
  return true;  // of a later version
}
}  // namespace

Bytes encode(const Record& record) {
  Bytes file;
  if (record.scan && !record.scan->profiles.empty())
    file.reserve(record.scan->profiles.size() * (64 + 8 * record.scan->profiles.front().profile.x_mm.size()));
  append(file, as_bytes(kMagic));
  append_le(file, kRecordVersion);
  put_section(file, kOrigin, record.origin);
  put_section(file, kCell, record.cell);
  put_section(file, kRequest, record.request);
  put_section(file, kScan, record.scan);
  put_section(file, kFrom, record.scan_of_cycle);
  put_section(file, kResult, record.result);
  put_section(file, kAnswer, record.answer);
  put_section(file, kEnd, Nothing{});
  return file;
}

Expected<Record, RecordError> decode(ByteView bytes) {
  const std::string_view begin = as_text(bytes.first(std::min(bytes.size(), kMagic.size())));
  if (bytes.size() < kHeaderBytes && kMagic.starts_with(begin))
    return failed(Kind::CutOff, bytes.empty() ? "is empty: it was cut off" : "is cut off in its first bytes");
  if (begin != kMagic) return failed(Kind::NotARecord, "is no record of binpick");
  if (const auto version = read_le<std::uint32_t>(bytes, kMagic.size()); version != kRecordVersion)
    return failed(Kind::Version, "has format version " + std::to_string(version) + ", this binpick knows " +
                                     std::to_string(kRecordVersion) + "; use a binpick of its time");
  Record record;
  std::string_view last_whole;
  for (std::size_t at = kHeaderBytes;;) {
    const auto section = section_at(bytes, at, last_whole);
    if (!section) return unexpected(section.error());
    if (last_whole.empty() && section->name != kOrigin)
      return failed(Kind::Content, "does not begin with where it comes from");
    if (!take_section(*section, record))
      return failed(Kind::Content, "says something impossible in its section" + at_byte(at));
    at += kSectionOverhead + section->content.size();
    last_whole = section->name;
    if (section->name != kEnd) continue;
    if (at == bytes.size()) return record;
    return failed(Kind::Damaged, "goes on behind its end" + at_byte(at));
  }
}

Expected<Record, RecordError> read_record(const std::string& path) {
  const auto bytes = vision::read_file(path);
  if (!bytes) return failed(Kind::CannotRead, bytes.error());
  return decode(*bytes).map_error([&](RecordError error) {
    error.text = path + " " + error.text;
    return error;
  });
}
}  // namespace binpick::daemon
