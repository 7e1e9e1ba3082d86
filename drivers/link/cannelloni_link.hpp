#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "drivers/link/can.hpp"
#include "drivers/link/udp_link.hpp"

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

  void on_deadline(TimePoint now) override { udp_.on_deadline(now); }
  std::optional<TimePoint> deadline() const override { return udp_.deadline(); }
  void flush(TimePoint now) override { udp_.flush(now); }

  std::uint16_t local_port() const { return udp_.local_port(); }  ///< Really bound; 0 while the socket is not open.

  struct Counters {
    std::uint64_t datagrams = 0, lost = 0, bad = 0, strangers = 0, fd_frames = 0, unsent = 0;
  };
  Counters counters() const;

 private:
  DatagramPeer datagrams();
  void on_datagram(ByteView bytes, TimePoint received);
  std::vector<Bytes> take_datagrams();

  std::vector<CanFilter> filters_;
  CanPeer peer_;
  std::uint8_t sequence_ = 0;
  std::optional<std::uint8_t> sequence_received_;
  Counters counters_;
  UdpLink udp_;
};
}  // namespace binpick::drivers::link
