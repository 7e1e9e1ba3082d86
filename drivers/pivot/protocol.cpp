#include "drivers/pivot/protocol.hpp"

namespace binpick::drivers::pivot {
const char* to_string(Protocol protocol) { return protocol == Protocol::Motion ? "Motion Protocol" : "PowerCube"; }

std::unique_ptr<ModuleProtocol> make_protocol(const Options& options) {
  return options.protocol == Protocol::Motion ? make_motion(options) : make_powercube(options);
}
}  // namespace binpick::drivers::pivot
