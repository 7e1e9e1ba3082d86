#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <span>

#include "drivers/link/cannelloni.hpp"

/// Any datagram is an error that says where, or frames that encode to themselves.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace binpick;
  using namespace binpick::drivers::link;
  const auto datagram = cannelloni::decode(std::as_bytes(std::span{data, size}));
  if (!datagram) {
    if (datagram.error().offset > size || to_string(datagram.error()).empty()) std::abort();
    return 0;
  }
  for (const CanFrame& frame : datagram->frames)
    if (frame.length > 8 || frame.id > 0x1FFFFFFF) std::abort();
  if (datagram->frames.size() > cannelloni::kFramesMax) return 0;
  const auto again = cannelloni::decode(cannelloni::encode(datagram->sequence, datagram->frames));
  if (!again || again->frames != datagram->frames || again->sequence != datagram->sequence) std::abort();
  return 0;
}
