#pragma once

#include <string>

namespace binpick::plc {
/// docs/plc-registers.md: map, handshake, codes and a pick step by step, made from the tables that the cell runs on.
std::string registers_page();
}  // namespace binpick::plc
