#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <vector>

#include "base/bytes.hpp"
#include "base/clock.hpp"
#include "plc/modbus_guard.hpp"
#include "plc/modbus_reply.hpp"

/// Many Modbus/TCP connections to one set of words: who may connect, who may write, whose turn it is. No socket.
namespace binpick::plc::modbus {
using ConnectionId = std::uint32_t;

/// A writer that has sent no whole frame for this long loses its place to the next one who writes.
inline constexpr Duration kWriterSilence = std::chrono::seconds(2);
/// At the connection cap, a connection without a whole frame for this long gives way to a new one.
inline constexpr Duration kIdleAtCap = std::chrono::seconds(5);
/// Frames of one connection that are answered before the others get their turn.
inline constexpr int kFramesPerTurn = 8;

struct ServerOptions {
  std::vector<std::string> allow;
  std::size_t connections_max = 8;
};

/// What the server tells its owner, in the middle of on_bytes or on_deadline, frame by frame.
struct ServerCalls {
  std::function<void(WrittenRange, TimePoint)> on_written;  ///< The words are already changed.
  std::function<void(TimePoint)> on_writer_gone;            ///< Closed, or another took its place.
  std::function<void(const std::string& address, TimePoint)> on_second_writer;
  std::function<void(TimePoint)> on_second_writer_gone;
};

class Server {
 public:
  Server(const ServerOptions& options, const Limits& limits, ServerCalls calls);

  bool on_accept(ConnectionId id, const std::string& address, std::uint16_t port, TimePoint now);
  void on_bytes(ConnectionId id, ByteView bytes, TimePoint now);
  void on_closed(ConnectionId id, TimePoint now);
  Bytes take_output(ConnectionId id);
  bool wants_close(ConnectionId id) const;
  void on_deadline(TimePoint now);
  /// At once while whole frames wait for their turn; else never.
  std::optional<TimePoint> deadline() const;

  /// In force for new connections; one that is no longer allowed is closed.
  void set_options(const ServerOptions& options);
  std::size_t connections() const { return connections_.size(); }
  std::span<std::uint16_t> words() { return reply_.words(); }
  std::span<const std::uint16_t> words() const { return reply_.words(); }

 private:
  struct Connection {
    std::string address;
    std::uint16_t port = 0;
    TimePoint last_frame;
    FrameBuffer buffer;
    Bytes output;
    bool closing = false;
    bool refused_writes = false;
  };
  bool allowed(const std::string& address) const;
  void serve(ConnectionId id, Connection& connection, TimePoint now);
  void answer(ConnectionId id, Connection& connection, ByteView frame, TimePoint now);
  bool may_write(ConnectionId id, Connection& connection, TimePoint now);
  bool first_time(std::set<std::string>& told, const std::string& address);

  ServerOptions options_;
  Limits limits_;
  ServerCalls calls_;
  Reply reply_;
  std::map<ConnectionId, Connection> connections_;
  std::optional<ConnectionId> writer_;
  std::optional<TimePoint> waiting_since_;  // whole frames wait for their turn
  std::set<std::string> told_strangers_, told_full_, told_writers_, told_frames_;
};
}  // namespace binpick::plc::modbus
