#pragma once

#include <string>
#include <string_view>

#include "plc/export.hpp"

/// Structured text as the makers of PLCs write it, from one common text: `@x` is a variable of the program, `[ready]` a
/// bit of the register named before it, `{Idle}` the number of a step, `$length` a constant of the map, `.Q` the output
/// of a timer. A line `!timer NAME PRESET CONDITION` calls a timer, `!copy TO FROM` copies a structure, `!next` counts
/// the sequence number up.
namespace binpick::plc {
enum class Dialect { S7, Logix };

std::string spoken(Dialect dialect, const ExportOptions& options, std::string_view text);

/// Typographic characters of the tables' texts as ASCII.
std::string ascii(std::string_view text);
/// Each line ends with CR LF, as the makers' tools write it.
std::string crlf(std::string_view text);
}  // namespace binpick::plc
