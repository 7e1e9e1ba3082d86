#pragma once

#include <string>
#include <vector>

namespace binpick {
/// One spelling per address: IPv4-mapped IPv6 unmapped, IPv6 shortened. What is no address stays as it is.
std::string canonical_address(const std::string& address);
/// Whether a peer may connect: this machine always may, others when they are in `allow`, in whatever spelling.
bool may_connect(const std::vector<std::string>& allow, const std::string& address);
}  // namespace binpick
