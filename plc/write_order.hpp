#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "plc/registers.hpp"

namespace binpick::plc {
using Map = std::span<const std::uint16_t, kMapLength>;

/// One write into the PLC's registers, by offsets of the map.
struct Write {
  std::uint16_t first = 0;
  std::vector<std::uint16_t> words;
};

/// What to write next so that `there`, which the PLC holds, becomes `ours`, in the blocks that the cell writes. The
/// PLC's program runs between two writes, and may run in the midst of one: so flags fall first, in a write of their
/// one word; then come the words that they speak for; then flags rise, again in one word. A result that changes is not
/// valid meanwhile. nullopt: nothing differs. `everything`: both blocks once more, whatever is there.
std::optional<Write> next_write(Map there, Map ours, bool everything);
}  // namespace binpick::plc
