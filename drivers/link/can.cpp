#include "drivers/link/can.hpp"

#include <net/if.h>
#include <stdexcept>

#include "drivers/link/can_socket.hpp"
#include "drivers/link/cannelloni_link.hpp"
#include "drivers/link/tcp.hpp"

namespace binpick::drivers::link {
std::unique_ptr<CanLink> open_can(Loop& loop, const std::string& address, std::vector<CanFilter> filters, CanPeer peer,
                                  std::uint16_t listen_port) {
  constexpr std::string_view kScheme = "cannelloni://";
  if (address.starts_with(kScheme)) {
    auto endpoint = parse_endpoint(std::string_view(address).substr(kScheme.size()));
    if (!endpoint) throw std::runtime_error("CAN address " + endpoint.error());
    if (endpoint->host.empty() || endpoint->port == 0)
      throw std::runtime_error("CAN address \"" + address + "\": write cannelloni://HOST:PORT");
    return std::make_unique<CannelloniLink>(loop, std::move(*endpoint), std::move(filters), std::move(peer),
                                            listen_port);
  }
  const bool name_ok =
      !address.empty() && address.size() < IFNAMSIZ && address.find_first_of("/: \t") == std::string::npos;
  if (!name_ok)
    throw std::runtime_error("CAN address \"" + address +
                             "\" is neither an interface (can0) nor cannelloni://HOST:PORT");
  return std::make_unique<CanSocket>(loop, address, std::move(filters), std::move(peer));
}
}  // namespace binpick::drivers::link
