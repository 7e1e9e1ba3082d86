#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "base/bytes.hpp"
#include "base/clock.hpp"
#include "drivers/link/loop.hpp"
#include "drivers/link/socket.hpp"
#include "drivers/link/tcp.hpp"

namespace binpick::drivers::link {
/// A session's face as a UDP link pumps it: whole datagrams. Frames are taken after each call and by flush(). A
/// callback may call reopen() or flush(), but must not destroy the link.
struct DatagramPeer {
  std::function<void(TimePoint)> on_connected;  ///< The socket is open. UDP does not tell whether anybody is there.
  std::function<void(ByteView, TimePoint)> on_frame;  ///< One datagram, with the kernel's time of its arrival.
  std::function<void(const std::string& why, TimePoint)> on_disconnected;  ///< Opened again after a second.
  std::function<std::vector<Bytes>()> take_frames;
  std::function<void()> on_other_peer;  ///< Somebody else speaks now (listening link). May be empty.
};

/// UDP with one peer; others are not heard.
class UdpLink final : public DeviceLink {
 public:
  /// Talks to `remote`; its answers may come from any of its ports. Opens in on_deadline and retries. `listen_port` is
  /// our own, 0: any; some devices answer to one port only.
  UdpLink(Loop& loop, Endpoint remote, DatagramPeer peer, std::uint16_t listen_port = 0);
  /// The other end, for emulated devices: binds `listen` at once and answers whoever spoke last. Throws
  /// std::runtime_error when it cannot bind.
  UdpLink(Loop& loop, const Endpoint& listen, DatagramPeer peer, const char* what);
  ~UdpLink() override;
  UdpLink(const UdpLink&) = delete;
  UdpLink& operator=(const UdpLink&) = delete;

  void on_deadline(TimePoint now) override;
  std::optional<TimePoint> deadline() const override { return deadline_; }
  void flush(TimePoint now) override;
  void reopen(TimePoint now) override;
  std::string last_error() const override { return last_why_; }

  std::uint16_t local_port() const;  ///< Really bound; 0 while the socket is not open.

  struct Counters {
    std::uint64_t strangers = 0, unsent = 0, cut = 0;  ///< Not from the peer; not taken by the kernel; too long.
  };
  const Counters& counters() const { return counters_; }

 private:
  void open(TimePoint now);
  bool bind_to(const SocketAddress& address, std::string& why);
  void close(TimePoint now, const std::string& why);
  void receive(TimePoint now);
  bool is_from_peer(const SocketAddress& from);
  bool send(const Bytes& datagram);

  Loop& loop_;
  Endpoint endpoint_;
  DatagramPeer peer_;
  std::uint16_t listen_port_ = 0;
  bool learns_remote_ = false;
  int fd_ = -1;
  bool up_ = false;
  std::optional<SocketAddress> remote_;
  std::unique_ptr<Resolver> resolver_;
  std::optional<TimePoint> deadline_ = TimePoint{};  // at once
  std::string last_why_;
  Counters counters_;
};
}  // namespace binpick::drivers::link
