#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <netinet/in.h>
#include <string>
#include <sys/socket.h>
#include <vector>

#include "base/bytes.hpp"
#include "base/clock.hpp"
#include "base/expected.hpp"
#include "drivers/link/loop.hpp"

/// What client and server links share: addresses, socket options, sending. Private to drivers/link.
namespace binpick::drivers::link {
struct SocketAddress {
  sockaddr_storage storage{};
  socklen_t length = 0;
  int family() const { return storage.ss_family; }
  const sockaddr* raw() const { return reinterpret_cast<const sockaddr*>(&storage); }
  sockaddr* raw() { return reinterpret_cast<sockaddr*>(&storage); }
};

/// The numeric address without its port; ::ffff:192.0.2.1 is written as 192.0.2.1.
std::string address_text(const SocketAddress& address);
std::uint16_t port_of(const SocketAddress& address);

/// Addresses of a host, in the order in which they should be tried. `numeric_only` never asks a name server.
Expected<std::vector<SocketAddress>, std::string> resolve(const std::string& host, std::uint16_t port,
                                                          bool numeric_only, bool passive);

/// resolve() in a thread of its own. The thread outlives a Resolver that is destroyed early and then ends in silence.
class Resolver {
 public:
  Resolver(Loop& loop, const std::string& host, std::uint16_t port, std::function<void(TimePoint)> on_done);
  ~Resolver();
  Resolver(const Resolver&) = delete;
  Resolver& operator=(const Resolver&) = delete;
  Expected<std::vector<SocketAddress>, std::string> take_result();

 private:
  struct Shared;
  Loop& loop_;
  std::shared_ptr<Shared> shared_;
};

/// Why a port of our own could not be had, and what to do.
std::string no_port_text(int error);

/// No Nagle delay, keep-alive after 3 s of silence, and unacknowledged bytes are given up after 3 s: a peer that lost
/// its power sends no FIN.
void set_stream_options(int fd);

enum class Sent { All, Some, Failed };
/// Sends as much as the socket takes and removes it from `unsent`. Failed: errno says why.
Sent send_some(int fd, Bytes& unsent);

/// Bytes read per wake-up and descriptor, so that one busy peer does not keep the others waiting.
inline constexpr std::size_t kReadBytesMax = 64 * 1024;
}  // namespace binpick::drivers::link
