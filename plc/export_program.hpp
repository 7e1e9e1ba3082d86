#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "plc/export.hpp"
#include "plc/export_dialect.hpp"
#include "plc/registers.hpp"

/// The handshake program that all exports share, written once and spoken in the make's own structured text.
namespace binpick::plc {
enum class Role { Input, Output, Inner };

/// A variable of the program. Its type is one of bool, number (one word), timer, request, status, result.
struct Variable {
  enum class Kind { Bool, Number, Word, Timer, Request, Status, Result };
  std::string_view name;
  Role role;
  Kind kind;
  std::string_view help;
};
std::span<const Variable> program_variables();

/// One block of the map; offsets of its members are those of the map.
struct Block {
  std::string_view type;  ///< Name of the structure in the exports.
  std::uint16_t first;
  std::uint16_t length;
  std::string_view help;
  std::string_view help_asked;  ///< Where the cell is the client.
};
std::string_view help_of(const Block& block, const ExportOptions& options);
std::span<const Block> map_blocks();
std::vector<Register> registers_of(const Block& block);
/// "40018 (word 17), bits: 0 ready, 1 ack. Status bits." as it stands beside a member.
std::string comment_of(const Register& r, const ExportOptions& options);

/// What the generated program is, the codes that it hands on, and how to use it; lines without comment marks.
std::vector<std::string> program_head(const ExportOptions& options);
/// The statements, without declarations and without the transfer of the blocks.
std::string program_body(Dialect dialect, const ExportOptions& options);
}  // namespace binpick::plc
