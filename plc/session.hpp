#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>

#include "base/bytes.hpp"
#include "base/clock.hpp"
#include "plc/alarms.hpp"
#include "plc/events.hpp"
#include "plc/handshake.hpp"
#include "plc/options.hpp"

/// The PLC's side of the cell: the line in either role, register image and pick handshake, without a socket.
namespace binpick::plc {
using ConnectionId = std::uint32_t;

/// Everything the PLC can see or say. In the role of a server pure but for a private socket pair through which
/// libmodbus answers.
class Session {
 public:
  /// `boot_count` differs from that of the last start: the PLC sees the restart.
  Session(const Options& options, std::uint16_t boot_count);
  ~Session();
  Session(Session&&) noexcept;
  Session& operator=(Session&&) noexcept;

  // The Modbus world of a server, one call per connection event (drivers/link/tcp.hpp, TcpServer). Only in this role.
  bool on_accept(ConnectionId id, const std::string& address, std::uint16_t port, TimePoint now);
  void on_bytes(ConnectionId id, ByteView bytes, TimePoint now);
  void on_closed(ConnectionId id, TimePoint now);
  Bytes take_output(ConnectionId id);
  bool wants_close(ConnectionId id) const;

  // The Modbus world of a client (TcpClient). Only in this role.
  void on_connected(TimePoint now);
  void on_bytes(ByteView bytes, TimePoint now);
  void on_disconnected(TimePoint now);
  Bytes take_output();
  bool take_reopen();  ///< True once when the connection must be dropped and opened anew.

  void on_deadline(TimePoint now);
  std::optional<TimePoint> deadline() const;
  std::optional<Event> take_event();

  // The cell's world.
  void set_not_ready(std::uint16_t device_reasons, TimePoint now);  ///< NotReady bits of devices; 0: all there.
  bool robot_clear() const;
  void on_scan_done(TimePoint now);                       ///< Robot may enter; detection runs.
  void publish(const PickResult& result, TimePoint now);  ///< Ends the cycle with its result.
  void fault(Alarm alarm, TimePoint now);                 ///< Ends the cycle, if one runs, with a fault; needs a reset.
  void raise(Alarm alarm, TimePoint now);                 ///< An alarm that does not stop the cell.
  void clear(Alarm alarm, TimePoint now);                 ///< Its cause has gone.
  void reconfigure(const Options& options, TimePoint now);  ///< Between cycles: ids, allow-list, time-outs.

  State state() const;
  /// Nothing is left to be said: the PLC has all words, or reads them itself, or is not there.
  bool told() const;
  std::uint16_t register_at(std::uint16_t offset) const;  ///< Word of the map, for tests and records.

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};
}  // namespace binpick::plc
