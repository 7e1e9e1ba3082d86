#pragma once

#include <chrono>
#include <cstdint>
#include <string>
#include <vector>

#include "plc/words.hpp"

/// What the cell file says of the line to the PLC.
namespace binpick::plc {
/// What the cell is on the line: the server that the PLC asks, or the client of a server that the PLC has.
enum class LineRole { Server, Client };

enum class PoseConvention {
  UniversalRobots,
  Fanuc,
  Kawasaki
};  ///< m + rotation vector; mm + W P R deg; mm + O A T deg.

struct Options {
  LineRole role = LineRole::Server;
  WordOrder word_order = WordOrder::HighWordFirst;
  PoseConvention pose_convention = PoseConvention::UniversalRobots;
  std::uint16_t base_address = 0;  ///< Modbus address (0-based) of register 0 of the map.
  // As server.
  std::vector<std::string> allow;  ///< Peer addresses that may connect; loopback always may.
  std::size_t connections_max = 8;
  // As client.
  std::string address;         ///< "host:port" of the PLC's server.
  std::uint8_t unit_id = 255;  ///< In every request, and expected in every reply.
  std::chrono::milliseconds poll{20};
  std::chrono::milliseconds reply_timeout{1000};

  std::chrono::milliseconds heartbeat_timeout{
      3000};  ///< PLC's heartbeat word unchanged for this long: alarm. 0: not watched.
  std::chrono::milliseconds scan_timeout{15000};
  std::chrono::milliseconds detect_timeout{5000};
  bool awaits_robot_clear = true;       ///< False: the robot carries the scanner, and robot_clear means nothing.
  std::vector<std::uint16_t> part_ids;  ///< Recipes that exist; another id is a result code.
  std::vector<std::uint16_t> supply_ids;
};
}  // namespace binpick::plc
