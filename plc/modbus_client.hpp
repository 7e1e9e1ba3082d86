#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "base/bytes.hpp"
#include "base/clock.hpp"
#include "plc/modbus_guard.hpp"
#include "plc/modbus_request.hpp"
#include "plc/registers.hpp"

/// The map in the PLC's own Modbus server: read in every poll, and written until it holds what the cell has to say. One
/// request is under way at a time. No socket.
namespace binpick::plc::modbus {
/// After a failure the next connection is left alone for this long before it is spoken to; doubles up to kPauseMax.
inline constexpr Duration kPauseFirst = std::chrono::milliseconds(200), kPauseMax = std::chrono::seconds(2);

struct ClientOptions {
  std::string address;  ///< Of the PLC's server, for the log.
  std::uint8_t unit = 255;
  std::uint16_t first = 0;  ///< Modbus address of the map.
  Duration poll = std::chrono::milliseconds(20);
  Duration reply_timeout = std::chrono::seconds(1);
};

/// What the client tells its owner, in the middle of on_bytes and the like.
struct ClientCalls {
  /// The server has answered on this connection.
  std::function<void(TimePoint)> on_talking;
  /// What stood in the request block before this connection was told anything: no request of its program may be
  /// believed yet.
  std::function<void(std::span<const std::uint16_t> request, TimePoint)> on_first_look;
  /// The request block as the PLC's program has it, in every poll; two reads agree in all but the heartbeat.
  std::function<void(std::span<const std::uint16_t> request, TimePoint)> on_request;
  /// After on_talking: the connection has failed.
  std::function<void(TimePoint)> on_lost;
};

class Client {
 public:
  /// `words`: the map as the cell has it, kMapLength of them; they outlive this.
  Client(ClientOptions options, std::span<const std::uint16_t> words, ClientCalls calls);

  void on_connected(TimePoint now);
  void on_bytes(ByteView bytes, TimePoint now);
  void on_disconnected(TimePoint now);
  void on_deadline(TimePoint now);
  std::optional<TimePoint> deadline() const;
  Bytes take_output() { return std::exchange(output_, {}); }
  bool take_reopen() { return std::exchange(reopen_, false); }

  bool talking() const { return talking_; }
  /// The PLC holds all words as they are now, or is not there.
  bool told() const;

 private:
  enum class Step { Closed, Pause, Reading, Writing };
  using Words = std::array<std::uint16_t, kMapLength>;
  Words ours() const;
  void send(Request request, TimePoint now);
  void read(TimePoint now);
  void tell(const std::string& what);
  void on_reply(ByteView frame, TimePoint now);
  void on_read(const std::vector<std::uint16_t>& words, TimePoint now);
  void on_written();
  void go_on(TimePoint now);
  void fail(const std::string& what, TimePoint now);
  void end(TimePoint now);

  ClientOptions options_;
  std::span<const std::uint16_t> words_;
  ClientCalls calls_;
  Step step_ = Step::Closed;
  FrameBuffer buffer_;
  Bytes output_;
  bool reopen_ = false;
  bool talking_ = false;         // this connection has answered
  bool blocks_written_ = false;  // both, on this connection
  bool believed_ = false;        // nothing differed since: from here on the PLC is believed
  bool confirming_ = false;      // the second read of this poll
  Request request_;              // under way while Reading or Writing
  std::uint16_t transaction_ = 0;
  Words there_{};                                                       // what the PLC holds, as last read and written
  std::optional<std::array<std::uint16_t, kRequestLength>> candidate_;  // read once, believed when read again
  TimePoint poll_began_{}, reply_due_{}, next_poll_{};
  Duration pause_{0};           // before the next connection is spoken to
  std::set<std::string> told_;  // kinds of lines, a handful
};
}  // namespace binpick::plc::modbus
