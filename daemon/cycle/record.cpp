#include "daemon/cycle/record.hpp"

#include <algorithm>

namespace binpick::daemon {
namespace {
RecordedCell recorded(const CellData& cell) {
  RecordedCell record;
  record.cell = {cell.config.path, cell.config.text};
  for (const auto& recipe : cell.config.recipes) {
    const auto known = [&](const config::FileText& file) { return file.path == recipe.part.path; };
    if (std::ranges::none_of(record.parts, known)) record.parts.push_back({recipe.part.path, recipe.part.text});
    const std::size_t n = record.knowledge_bases.size();
    const std::uint64_t checksum = n < cell.knowledge_bases.size() ? cell.knowledge_bases[n].checksum() : 0;
    record.knowledge_bases.push_back({recipe.knowledge_base, checksum});
  }
  return record;
}
}  // namespace

Record begun_record(const CellData& cell, std::uint16_t boot_count, std::uint64_t cycle_id) {
  Record record;
  record.origin = {BINPICK_VERSION, boot_count, cycle_id, 0};
  record.cell = recorded(cell);
  return record;
}
}  // namespace binpick::daemon
