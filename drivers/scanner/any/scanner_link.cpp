#include "drivers/scanner/any/scanner_link.hpp"

#include <stdexcept>

#include "drivers/link/tcp.hpp"
#include "drivers/link/udp_link.hpp"

namespace binpick::drivers::scanner {
std::unique_ptr<link::DeviceLink> open_link(link::Loop& loop, const std::string& address, std::uint16_t listen_port,
                                            Scanner& scanner) {
  const auto endpoint = link::parse_endpoint(address);
  if (!endpoint) throw std::runtime_error("scanner.address: " + endpoint.error());
  const auto on_connected = [&scanner](TimePoint now) { scanner.on_connected(now); };
  const auto on_bytes = [&scanner](ByteView bytes, TimePoint now) { scanner.on_bytes(bytes, now); };
  if (!scanner.by_datagrams())
    return std::make_unique<link::TcpClient>(
        loop, *endpoint,
        link::StreamPeer{.on_connected = on_connected,
                         .on_bytes = on_bytes,
                         .on_disconnected = [&scanner](TimePoint now) { scanner.on_disconnected(now); },
                         .take_output = [&scanner] { return scanner.take_output(); }});
  return std::make_unique<link::UdpLink>(
      loop, *endpoint,
      link::DatagramPeer{
          .on_connected = on_connected,
          .on_frame = on_bytes,
          .on_disconnected = [&scanner](const std::string&, TimePoint now) { scanner.on_disconnected(now); },
          .take_frames = [&scanner] { return scanner.take_frames(); },
          .on_other_peer = {}},
      listen_port);
}
}  // namespace binpick::drivers::scanner
