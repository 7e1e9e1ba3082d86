#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <string_view>

#include "config/config.hpp"

/// Any bytes as a cell or a part file: values in range, or findings that can be shown. A good file loads again, the
/// same.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* bytes, std::size_t size) {
  using namespace binpick::config;
  if (size == 0) return 0;
  const std::string_view text{reinterpret_cast<const char*>(bytes + 1), size - 1};
  const auto shown = [](const std::vector<Diagnostic>& findings) {
    if (findings.empty()) std::abort();
    for (const auto& finding : findings)
      if (finding.message.empty() || to_string(finding).size() < finding.message.size()) std::abort();
  };
  if ((bytes[0] & 1) != 0) {
    const auto part = load_part_text(BINPICK_SOURCE_DIR "/config/part.toml", text);
    if (!part) shown(part.error());
    return 0;
  }
  const auto cell = load_text(BINPICK_SOURCE_DIR "/config/cell.toml", text);
  if (!cell) {
    shown(cell.error());
    return 0;
  }
  if (cell->supplies.empty() || cell->recipes.empty() || !needs_restart(*cell, *cell).empty()) std::abort();
  return 0;
}
