#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "drivers/link/device_link.hpp"
#include "drivers/link/loop.hpp"
#include "drivers/scanner/any/scanner.hpp"

namespace binpick::drivers::scanner {
/// The way to a scanner by what it speaks. `address` is "host:port"; `listen_port` is our own for datagrams, 0: any.
/// `scanner` outlives it. Throws std::runtime_error for an address that is none.
std::unique_ptr<link::DeviceLink> open_link(link::Loop& loop, const std::string& address, std::uint16_t listen_port,
                                            Scanner& scanner);
}  // namespace binpick::drivers::scanner
