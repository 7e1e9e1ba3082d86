#pragma once

#include <array>
#include <chrono>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "plc/options.hpp"

/// Sources for the PLC's engineering tool: register map and handshake as a program, made from the tables that the cell
/// runs on (plc/registers.hpp, plc/handshake.hpp, plc/counterpart.hpp). Same options, same bytes; all of it is ASCII.
namespace binpick::plc {
struct ExportOptions {
  LineRole role = LineRole::Server;                   ///< The cell's; the PLC is the other.
  std::array<std::uint8_t, 4> host{192, 168, 0, 20};  ///< The cell controller's IPv4 address, as the PLC sees it.
  std::uint16_t port = 502;                           ///< Of the server, the cell's or the PLC's.
  std::uint16_t base_address = 0;
  std::optional<PoseConvention> pose_convention;  ///< For the comments; the program reads the register.
  std::chrono::milliseconds poll{50};
  std::chrono::milliseconds cell_timeout{3000};     ///< The cell's heartbeat unchanged for this long: no line.
  std::chrono::milliseconds answer_timeout{25000};  ///< Longer than the cell's scan and detection time-outs together.
};

struct ExportFile {
  std::string name;
  std::string content;
};

/// TIA Portal, S7-1200/1500: one external source with types, data blocks and the function block.
std::vector<ExportFile> export_s7(const ExportOptions& options);
/// Studio 5000: program and types as L5X, tags as CSV, the handshake as structured text.
std::vector<ExportFile> export_logix(const ExportOptions& options);
}  // namespace binpick::plc
