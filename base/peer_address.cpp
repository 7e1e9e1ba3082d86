#include "base/peer_address.hpp"

#include <algorithm>
#include <arpa/inet.h>
#include <array>

namespace binpick {
namespace {
bool loopback(const std::string& canonical) {
  in_addr v4{};
  if (inet_pton(AF_INET, canonical.c_str(), &v4) == 1) return (ntohl(v4.s_addr) >> 24) == 127;
  return canonical == "::1";
}
}  // namespace

std::string canonical_address(const std::string& address) {
  std::array<char, INET6_ADDRSTRLEN> text{};
  in_addr v4{};
  if (inet_pton(AF_INET, address.c_str(), &v4) == 1) return inet_ntop(AF_INET, &v4, text.data(), text.size());
  in6_addr v6{};
  if (inet_pton(AF_INET6, address.c_str(), &v6) != 1) return address;
  if (IN6_IS_ADDR_V4MAPPED(&v6)) return inet_ntop(AF_INET, &v6.s6_addr[12], text.data(), text.size());
  return inet_ntop(AF_INET6, &v6, text.data(), text.size());
}

bool may_connect(const std::vector<std::string>& allow, const std::string& address) {
  const std::string peer = canonical_address(address);
  return loopback(peer) ||
         std::ranges::any_of(allow, [&](const std::string& allowed) { return canonical_address(allowed) == peer; });
}
}  // namespace binpick
