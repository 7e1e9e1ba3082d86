#pragma once

#include <cstdint>
#include <deque>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "drivers/link/can.hpp"
#include "drivers/link/socket.hpp"
#include "drivers/link/tcp.hpp"

namespace binpick::drivers::link {
/// A CAN bus over UDP. UDP has no connection: it is up as soon as its socket stands, and a peer that is away looks like
/// a bus on which nobody answers.
class CannelloniLink final : public CanLink {
 public:
  /// Talks to `remote`; datagrams from other addresses are dropped and counted. Opens in on_deadline and retries.
  CannelloniLink(Loop& loop, Endpoint remote, std::vector<CanFilter> filters, CanPeer peer, std::uint16_t listen_port);
  /// The other end, for emulated buses: binds `listen` at once and answers whoever spoke last. Throws
  /// std::runtime_error when it cannot bind.
  CannelloniLink(Loop& loop, const Endpoint& listen, CanPeer peer);
  ~CannelloniLink() override;
  CannelloniLink(const CannelloniLink&) = delete;
  CannelloniLink& operator=(const CannelloniLink&) = delete;

  void on_deadline(TimePoint now) override;
  std::optional<TimePoint> deadline() const override { return deadline_; }
  void flush(TimePoint now) override;

  std::uint16_t local_port() const;  ///< Really bound; 0 while the socket is not open.

  struct Counters {
    std::uint64_t datagrams = 0, lost = 0, bad = 0, strangers = 0, fd_frames = 0, unsent = 0;
  };
  const Counters& counters() const { return counters_; }

 private:
  void open(TimePoint now);
  bool bind_to(const SocketAddress& address, std::string& why);
  void close(TimePoint now, const std::string& why);
  void receive(TimePoint now);
  void on_datagram(ByteView bytes, const SocketAddress& from, TimePoint received);

  Loop& loop_;
  Endpoint endpoint_;
  std::vector<CanFilter> filters_;
  CanPeer peer_;
  std::uint16_t listen_port_ = 0;
  bool learns_remote_ = false;
  int fd_ = -1;
  bool up_ = false;
  std::optional<SocketAddress> remote_;
  std::unique_ptr<Resolver> resolver_;
  std::optional<TimePoint> deadline_ = TimePoint{};  // at once
  std::string last_why_;
  std::uint8_t sequence_ = 0;
  std::optional<std::uint8_t> sequence_received_;
  Counters counters_;
};
}  // namespace binpick::drivers::link
