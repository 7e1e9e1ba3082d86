#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

#include "base/bytes.hpp"
#include "base/clock.hpp"
#include "base/expected.hpp"
#include "drivers/link/device_link.hpp"
#include "drivers/link/loop.hpp"

/// TCP links: the only code that owns TCP sockets. They pump a session's face and know nothing of what the bytes mean.
namespace binpick::drivers::link {
struct Endpoint {
  std::string host;  ///< Name, IPv4 or IPv6 address; empty or "0.0.0.0" for any when listening.
  std::uint16_t port = 0;
};
std::string to_string(const Endpoint& endpoint);
/// "host:port", "[v6]:port"; an error says what is wrong with the text.
Expected<Endpoint, std::string> parse_endpoint(std::string_view text);

struct SocketAddress;
class Resolver;

/// A session's face as a client link pumps it. Output is taken after each call and by flush(). A callback may call
/// reopen() or flush(), but must not destroy the link.
struct StreamPeer {
  std::function<void(TimePoint)> on_connected;
  std::function<void(ByteView, TimePoint)> on_bytes;
  std::function<void(TimePoint)> on_disconnected;
  std::function<Bytes()> take_output;
};

struct TcpClientOptions {
  Duration connect_timeout = std::chrono::seconds(2);
  /// Doubles up to retry_max (a long back-off keeps a cell down), until a connection has stood for five seconds.
  Duration retry_first = std::chrono::milliseconds(200);
  Duration retry_max = std::chrono::seconds(1);
  std::size_t unsent_bytes_max = 1 << 20;  ///< A peer that does not read is dropped.
};

/// Connects, reconnects for ever with a capped back-off, moves bytes. TCP_NODELAY, keep-alive and TCP_USER_TIMEOUT are
/// set: a peer that lost its power is noticed within about 3 s. A host name is resolved in a thread of its own.
class TcpClient final : public DeviceLink {
 public:
  TcpClient(Loop& loop, Endpoint endpoint, StreamPeer peer, TcpClientOptions options = {});
  ~TcpClient() override;
  TcpClient(const TcpClient&) = delete;
  TcpClient& operator=(const TcpClient&) = delete;

  void on_deadline(TimePoint now) override;  ///< Starts or gives up a connection attempt when it is time.
  std::optional<TimePoint> deadline() const override;
  void flush(TimePoint now) override;
  void reopen(TimePoint now) override;  ///< Reconnects after the pause that has come up.
  bool connected() const;
  std::string last_error() const override;  ///< Why the last attempt failed ("connection refused").

 private:
  enum class State { Waiting, Resolving, Connecting, Connected };
  void start(TimePoint now);
  void on_resolved(TimePoint now);
  void connect_to(const SocketAddress& address, TimePoint now);
  void on_connect_done(TimePoint now);
  void drop(TimePoint now, const std::string& why);
  void on_event(std::uint32_t events, TimePoint now);
  void receive(TimePoint now);

  Loop& loop_;
  Endpoint endpoint_;
  StreamPeer peer_;
  TcpClientOptions options_;
  State state_ = State::Waiting;
  int fd_ = -1;
  Duration retry_;
  TimePoint connected_at_{};
  std::optional<TimePoint> deadline_ = TimePoint{};  // at once
  std::size_t attempts_ = 0;                         // a name with several addresses is tried in turn
  std::unique_ptr<Resolver> resolver_;
  Bytes unsent_;
  bool wants_write_ = false;
  std::string last_error_;
};

using ConnectionId = std::uint32_t;

/// A server's face. The link numbers connections from 1; a number is never used twice. Output is taken after each call
/// and by flush(). A callback may call close() or flush(), but must not destroy the server.
struct ServerPeer {
  /// False closes the stranger at once, and on_closed is not called for it. `address` is the numeric peer address,
  /// IPv4-mapped IPv6 already unmapped. With newest_wins, on_closed of the connection that had to give way follows.
  std::function<bool(ConnectionId, const std::string& address, std::uint16_t port, TimePoint)> on_accept;
  std::function<void(ConnectionId, ByteView, TimePoint)> on_bytes;
  std::function<void(ConnectionId, TimePoint)> on_closed;
  std::function<Bytes(ConnectionId)> take_output;
  std::function<bool(ConnectionId)> wants_close;  ///< May be empty: never.
};

struct TcpServerOptions {
  std::size_t connections_max = 16;
  bool newest_wins = false;  ///< At the limit, the oldest connection is closed for a new one (a robot that reconnects).
  std::size_t unsent_bytes_max = 1 << 20;  ///< A peer that does not read is dropped.
};

class TcpServer {
 public:
  /// Throws std::runtime_error with the address and the reason when it cannot listen.
  TcpServer(Loop& loop, const Endpoint& listen, ServerPeer peer, TcpServerOptions options = {});
  ~TcpServer();
  TcpServer(const TcpServer&) = delete;
  TcpServer& operator=(const TcpServer&) = delete;

  std::uint16_t port() const;  ///< The port really bound (listen on 0 to have one chosen).
  void flush(TimePoint now);   ///< Sends what the session has to say; after a shortage of descriptors, listens again.
  void close(ConnectionId id, TimePoint now);
  std::size_t connections() const;

 private:
  struct Connection {
    int fd = -1;
    Bytes unsent;
    bool wants_write = false;
  };
  void accept_all(TimePoint now);
  bool accept_one(TimePoint now);
  void refuse_one(TimePoint now);
  void on_event(ConnectionId id, std::uint32_t events, TimePoint now);
  void receive(ConnectionId id, TimePoint now);
  void flush(ConnectionId id, TimePoint now);

  Loop& loop_;
  ServerPeer peer_;
  TcpServerOptions options_;
  int listen_fd_ = -1;
  int spare_fd_ = -1;  // given up when descriptors run out, so that a caller can be taken and turned away
  std::optional<TimePoint> accept_paused_until_;
  bool full_logged_ = false;
  bool starved_logged_ = false;
  ConnectionId next_id_ = 1;
  std::map<ConnectionId, Connection> connections_;
};
}  // namespace binpick::drivers::link
