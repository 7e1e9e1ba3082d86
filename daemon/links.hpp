#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "base/clock.hpp"
#include "daemon/cell.hpp"
#include "drivers/link/can.hpp"
#include "drivers/link/loop.hpp"
#include "drivers/link/tcp.hpp"

namespace binpick::daemon {
/// The cell's sessions on their sockets: what EmulatedCell does in memory, done by descriptors.
class Links {
 public:
  /// Throws std::runtime_error when an address cannot be listened on.
  Links(drivers::link::Loop& loop, Cell& cell);

  void on_deadline(TimePoint now);  ///< Links' own timers: connecting, retries.
  std::optional<TimePoint> deadline() const;
  void flush(TimePoint now);  ///< After Cell::run: sends what the sessions have to say.

 private:
  drivers::link::ServerPeer one_robot(drivers::link::ConnectionId& counts, std::function<void(TimePoint)> on_connected,
                                      std::function<void(ByteView, TimePoint)> on_bytes,
                                      std::function<void(TimePoint)> on_disconnected,
                                      std::function<Bytes()> take_output);
  void open_poses(drivers::link::Loop& loop);
  static void tell(const char* device, const std::string& address, const std::string& error, std::string& told);
  void open_plc(drivers::link::Loop& loop);

  Cell& cell_;
  std::optional<drivers::link::TcpServer> plc_server_;  // one of the two, as plc.role says
  std::optional<drivers::link::TcpClient> plc_client_;
  bool plc_connected_ = false;                     // as last seen
  std::string plc_trouble_;                        // why not
  std::unique_ptr<drivers::link::CanLink> pivot_;  // null: the robot carries the scanner
  std::unique_ptr<drivers::link::DeviceLink> scanner_;
  std::optional<drivers::link::TcpServer> robot_;
  drivers::link::ConnectionId robot_connection_ = 0;     // the one that counts; 0: none
  std::optional<drivers::link::TcpClient> pose_client_;  // one of the two, where the robot carries the scanner
  std::optional<drivers::link::TcpServer> pose_server_;
  drivers::link::ConnectionId pose_connection_ = 0;
  std::string scanner_trouble_, pose_trouble_;  // why not, as last told
};
}  // namespace binpick::daemon
